"""One equilibrium state, as the solver hands it to the store."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.mesh import Mesh

FloatArray = npt.NDArray[np.float64]

SOLVER_FACTS = ("iterations", "factorisations", "stable", "residual", "wall_s")
"""What :attr:`StepRecord.solver` tells about the step, in the order of the columns of ``history.csv``."""


@dataclass(frozen=True, eq=False)
class StepRecord:
    """An equilibrium state of n nodes in d dimensions and m elements, and how the solver reached it.

    Parameters
    ----------
    index
        Number of the step, counted from 0.
    fraction
        Load parameter, 0 (nothing applied) to 1 (target).
    loads
        Value of every load: ``{"pressure:cavity": 0.03}`` in MPa, dimensionless factors under their own name.
    displacement
        Shape ``(n, d)``, mm.
    element_pressure
        Mean stress of each element, fibre families included, shape ``(m,)``, MPa, positive in tension.
    element_dilatation
        Current volume over reference volume of each element, shape ``(m,)``.
    von_mises
        Nodal von Mises stress of the Cauchy stress, shape ``(n,)``, MPa; where regions meet, the larger one.
    von_mises_max, von_mises_p99
        Largest value over the quadrature points and 99th percentile by volume, MPa.
    cavity_volumes
        Enclosed volume of each cavity, mm³.
    solver
        The :data:`SOLVER_FACTS` of the step; ``stable`` is ``None`` where the solver cannot tell. ``event`` names
        what makes the state special (``"limit-pressure"``), ``time_s`` is its time where loads follow programmes.
    standing
        How contacts (``contact``), fibres (``fibres``), the interfaces of two materials (``interfaces``) and supports
        (``supports``, by their surfaces) stand, by their names, in plain values with keys that end in their unit; only
        what the body has.
    mode
        Eigenmode in which the body gives way in this state, ``(n, 3)``, largest component one, where it does.
    von_mises_by_region
        Where the body has several regions, the nodal von Mises stress of each alone, at its
        :meth:`turgor.mesh.mesh.Mesh.region_nodes`, MPa; empty for one region, and in runs that were stored without.
    """

    index: int
    fraction: float
    loads: Mapping[str, float]
    displacement: FloatArray
    element_pressure: FloatArray
    element_dilatation: FloatArray
    von_mises: FloatArray
    von_mises_max: float
    von_mises_p99: float
    cavity_volumes: Mapping[str, float]
    solver: Mapping[str, Any]
    standing: Mapping[str, Mapping[str, Mapping[str, Any]]] = field(default_factory=dict)
    mode: FloatArray | None = None
    von_mises_by_region: Mapping[str, FloatArray] = field(default_factory=dict)

    def check(self, mesh: Mesh) -> None:
        """Raise InputError unless the arrays have the shapes that `mesh` asks for."""
        n, m = mesh.n_points, mesh.n_cells
        shapes = {
            "displacement": (n, mesh.dimension),
            "element_pressure": (m,),
            "element_dilatation": (m,),
            "von_mises": (n,),
        }
        for name, shape in shapes.items():
            _check_shape(name, getattr(self, name), shape)
        for region, values in self.von_mises_by_region.items():
            _check_shape(f"von_mises_by_region.{region}", values, mesh.region_nodes(region).shape)
        missing = [name for name in SOLVER_FACTS if name not in self.solver]
        if missing:
            raise InputError(f"the solver's facts lack {', '.join(missing)}", key="solver")


ARRAY_FIELDS = ("displacement", "element_pressure", "element_dilatation", "von_mises")
_OWN_ARRAYS = (*ARRAY_FIELDS, "mode", "von_mises_by_region")
PLAIN_FIELDS = tuple(entry.name for entry in fields(StepRecord) if entry.name not in _OWN_ARRAYS)
"""The fields of a record that JSON can hold; the others are arrays."""


def _check_shape(name: str, array: FloatArray, shape: tuple[int, ...]) -> None:
    found = np.shape(array)
    if found != shape:
        raise InputError("the array does not fit the mesh", key=name, value=found, expected=f"shape {shape}")
