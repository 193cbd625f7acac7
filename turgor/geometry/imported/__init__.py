"""Solids that other programs drew: STEP and STL files, with faces and openings selected by rules."""
