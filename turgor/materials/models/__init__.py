"""Strain-energy models, one idea a file; :func:`turgor.materials.registry.models` finds them by itself."""
