"""Strain-energy models, test data, fits, stability and the library of published coefficients."""

from turgor.materials.hyperelastic import Hyperelastic, InvariantModel, StretchModel
from turgor.materials.registry import create, find_model
from turgor.materials.volumetric import Logarithmic, Quadratic, Volumetric

__all__ = [
    "Hyperelastic",
    "InvariantModel",
    "Logarithmic",
    "Quadratic",
    "StretchModel",
    "Volumetric",
    "create",
    "find_model",
]
