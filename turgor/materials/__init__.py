"""Strain-energy models, test data, fits and the library of published coefficients."""
