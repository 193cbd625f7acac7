"""Contact where two faces meet at an angle: nothing jumps as points pass from one to the other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from contact_bodies import merged, shifted_mesh
from contact_checks import check_contact, force_of
from samples import neo_hookean

from turgor.fem.contact.shapes import on_rim
from turgor.fem.contact.spec import SelfContact
from turgor.fem.section import PlaneStrain
from turgor.fem.state import State
from turgor.fem.supports import Clamped
from turgor.fem.system import System
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box, rectangle

KINDS = ["tri6", "quad9", "tet10", "hex27"]
FLAT = ("tri6", "quad9")


def bent(mesh: Mesh, slope: float, part: np.ndarray) -> Mesh:
    """A block whose points move up by a part of the slope times their distance from the middle along x and along y."""
    points = mesh.points.copy()
    middle = 0.5 * points.max(axis=0)
    points[:, -1] += slope * part * np.abs(points - middle)[:, :-1].sum(axis=1)
    return Mesh(points, mesh.cells, surfaces=mesh.surfaces)


class Tip:
    """A block with a groove in the middle of its top, in space a pit, and a small one with a blunter tip above it.

    Of negative slope, a ridge or peak.
    """

    def __init__(self, kind: str, slope: float = 0.3) -> None:
        self.slope = slope
        if kind in FLAT:
            low, high = rectangle((2.0, 1.0), (2, 1), kind), rectangle((0.2, 0.5), (2, 1), kind)
            place, section = {"x": 0.9, "y": 1.0}, PlaneStrain()
            self.way = np.array([1.0, 0.0])
        else:
            low, high = box((2.0, 2.0, 1.0), (2, 2, 1), kind), box((0.2, 0.2, 0.5), (2, 2, 1), kind)
            place, section = {"x": 0.9, "y": 0.9, "z": 1.0}, None
            self.way = np.array([0.9, np.sqrt(0.19), 0.0])
        mesh = merged(
            low=bent(low, slope, low.points[:, -1]),
            high=shifted_mesh(bent(high, max(2.0 * slope, 0.0), 1.0 - 2.0 * high.points[:, -1]), **place),
        )
        supports = [Clamped(name) for name in (("low-y0", "high-y1") if kind in FLAT else ("low-z0", "high-z1"))]
        self.system = System(mesh, {"body": neo_hookean()}, supports, section=section, contact=[SelfContact()])
        self.contact = self.system.contacts[0]
        self.high = np.arange(mesh.n_points) >= low.n_points

    def at(self, aside: float, lift: float, margin: float = 0.0) -> State:
        """The state in which the small block has moved sideways, its tip by `lift` above what is below."""
        u = np.zeros_like(self.system.mesh.points)
        u[self.high] = aside * self.way
        u[self.high, -1] += self.slope * np.abs(aside * self.way).sum() + lift
        return self.system.consistent(u, np.zeros(0), margin=margin)

    def on_rims(self, state: State) -> int:
        """Number of points that meet the rim of a face."""
        pairs = self.contact._touching(state)
        return sum(on_rim(self.contact.skin.faces.shape[1], local) for local in pairs.local)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_energy_changes_by_the_work_of_the_force_over_a_groove(kind, margin):
    # Where a gap jumps, energy comes or goes for which no force has done work.
    tip = Tip(kind)
    states = [tip.at(aside, margin - 0.02, margin) for aside in np.linspace(-0.1, 0.1, 401)]
    energy = np.array([tip.contact.energy(state) for state in states])
    force = [force_of(tip.contact, state) for state in states]
    work = [
        0.5 * np.vdot(before + after, here.u - there.u)
        for before, after, there, here in zip(force, force[1:], states, states[1:], strict=False)
    ]
    assert max(map(tip.on_rims, states)) > 0
    assert np.abs(np.diff(energy) - work).max() < 2e-3 * energy.max()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("margin", [0.0, 0.01])
def test_stiffness_on_the_rim(kind, margin):
    tip, rng = Tip(kind), np.random.default_rng(3)
    found = 0
    for aside in np.linspace(-0.1, 0.1, 81):
        state = tip.at(aside, margin - 0.02, margin)
        state = replace(state, u=state.u + 1e-4 * rng.standard_normal(state.u.shape))
        # not where a point begins to touch within the steps of the differences
        if tip.on_rims(state) and tip.contact._touching(state).overlap.max() < -2e-4:
            found += 1
            check_contact(tip.contact, state)
    assert found > 1


@pytest.mark.parametrize("kind", KINDS)
def test_a_face_is_not_met_beyond_its_end(kind):
    # A small flat block slides over a ridge, which it does not touch, though it lies behind the flanks drawn out.
    tip = Tip(kind, -0.3)
    for aside in np.linspace(-0.1, 0.1, 21):
        level = 0.3 * np.abs(aside * tip.way).sum()
        assert tip.contact.touch(tip.at(aside, level + 0.001)).area == 0.0
    assert tip.contact.touch(tip.at(0.0, -0.02)).area > 0.0
