"""Solids that another program drew: STEP files, with faces selected by rules."""
