"""What a measure is a function of: the body of a run, and one of its states."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import numpy.typing as npt

from turgor.fem.cavity import Cavity
from turgor.fem.section import Section, section_of
from turgor.geometry.section import PlaneSection
from turgor.mesh.mesh import Mesh
from turgor.results.record import StepRecord

FloatArray = npt.NDArray[np.float64]
ModelKind = Literal["space", "plane", "axisymmetric"]


def kind_of(section: PlaneSection | None) -> ModelKind:
    """Return the kind of model that a drawing is, which for one in space has no section."""
    if section is None:
        return "space"
    return "axisymmetric" if section.kind == "axisymmetric" else "plane"


@dataclass(frozen=True, eq=False)
class Body:
    """What a run is about.

    Parameters
    ----------
    mesh
        The mesh, at rest.
    section
        What a plane mesh stands for; ``None`` for a body in space.
    rigid_bodies
        Names of the rigid bodies that it may meet, each of which feels a force.
    supports
        Names of the surfaces that supports hold, each of which carries a force.
    """

    mesh: Mesh
    section: PlaneSection | None = None
    rigid_bodies: tuple[str, ...] = ()
    supports: tuple[str, ...] = ()

    @cached_property
    def mechanics(self) -> Section | None:
        """What the section is to the mechanics."""
        return section_of(self.section)

    @property
    def kind(self) -> ModelKind:
        """Whether it is a body in space, a slice in a plane, or turned about the y axis."""
        return "plane" if self.section is None and self.mesh.dimension == 2 else kind_of(self.section)

    def enclosed_volume(self, surface: str, displacement: FloatArray) -> float:
        """Return the volume in mm³ that a surface encloses when its nodes have moved by `displacement` ``(n, d)``.

        It is that of the slice or of the full turn; symmetry planes, caps and the axis may close it.

        Raises
        ------
        InputError
            If there is no such surface, or it is open.
        """
        mesh = self.mesh
        cavity = Cavity(mesh.points, mesh.surface(surface), 0, surface, self.mechanics, mesh.caps)
        return cavity.volume(displacement)

    def at_rest(self) -> StoredState:
        """Return the state in which nothing has moved yet."""
        n, m = self.mesh.n_points, self.mesh.n_cells
        regions = self.mesh.regions if len(self.mesh.regions) > 1 else ()
        record = StepRecord(
            index=0,
            fraction=0.0,
            loads={},
            displacement=np.zeros_like(self.mesh.points),
            element_pressure=np.zeros(m),
            element_dilatation=np.ones(m),
            von_mises=np.zeros(n),
            von_mises_max=0.0,
            von_mises_p99=0.0,
            cavity_volumes={},
            solver={},
            von_mises_by_region={name: np.zeros(len(self.mesh.region_nodes(name))) for name in regions},
        )
        return StoredState(self, record)


@dataclass(frozen=True, eq=False)
class StoredState:
    """One state of a body."""

    body: Body
    record: StepRecord

    @property
    def mesh(self) -> Mesh:
        """The mesh, at rest."""
        return self.body.mesh

    @property
    def displacement(self) -> FloatArray:
        """Displacement of the nodes, ``(n, d)``, mm."""
        return self.record.displacement

    def von_mises_in(self, region: str) -> FloatArray:
        """Return the nodal von Mises stress of a region alone, ``(n,)``, MPa; NaN at other nodes.

        Also at its own in a state of several regions that was stored without that of each.
        """
        if len(self.mesh.regions) == 1:
            return self.record.von_mises
        field = np.full(self.mesh.n_points, np.nan)
        if region in self.record.von_mises_by_region:
            field[self.mesh.region_nodes(region)] = self.record.von_mises_by_region[region]
        return field

    @property
    def positions(self) -> FloatArray:
        """Where the nodes are now, ``(n, d)``, mm."""
        return np.asarray(self.mesh.points + self.record.displacement)
