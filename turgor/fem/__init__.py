"""Discrete mechanics of one state: elements, kernels, assembly, degrees of freedom, constraints, terms."""
