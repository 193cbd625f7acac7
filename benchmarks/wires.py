"""Fibres that resist bending: how fine their bars must be, and what they cost Newton's method.

    .venv/bin/python benchmarks/wires.py

Prints the rows of the two tables in docs/theory/fibres.md under "Bending": the energy and the moments of a straight
wire in a block of hexahedra that is rolled up to a circle, against ½ (E I / ρ²) l and E I / ρ; and the factorisations,
iterations and tip displacement (mm) of a tube with one steel wire, without and with its bending stiffness, at a
pressure (MPa) that is reached in so many steps.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from turgor.fem.fibres import Fibre, solid_bending_stiffness
from turgor.fem.loads import Load, Pressure
from turgor.fem.supports import Clamped, Support
from turgor.fem.system import System
from turgor.geometry.tube import CappedTube
from turgor.materials.models.neo_hookean import NeoHookean
from turgor.materials.volumetric import Quadratic
from turgor.mesh.generate import generate
from turgor.mesh.mesh import Mesh
from turgor.mesh.structured import box
from turgor.solver.path import solve_path

STEEL, DIAMETER = 200e3, 0.3


def wired(
    mesh: Mesh,
    curve: NDArray[np.float64],
    bending: float | None,
    support: Support,
    loads: Sequence[Load] = (),
    bar: float | None = None,
) -> System:
    """Return a rubber body with one steel wire."""
    rubber = NeoHookean(C10=0.05, volumetric=Quadratic(100.0))
    wire = Fibre("wire", STEEL, DIAMETER, tension_only=False, bar_length=bar, bending_stiffness=bending)
    return System(replace(mesh, curves={"wire": curve}), {"body": rubber}, [support], loads, [wire])


def rolled_up(bars: float) -> str:
    """Return energy and least and largest moment, in parts of the exact ones, with `bars` to an edge."""
    length, radius, elements = 4.0, 2.0, 8
    mesh = box((length, 1.0, 1.0), (elements, 1, 1), "hex27")
    curve = np.array([[0.0, 0.5, 0.0], [length, 0.5, 0.0]])
    system = wired(mesh, curve, 1.0, Clamped("x0"), bar=length / elements / bars)
    (bending,) = system.bending
    x, y, z = mesh.points.T
    circle = np.column_stack([(radius - z) * np.sin(x / radius), y, radius - (radius - z) * np.cos(x / radius)])
    state = system.consistent(circle - mesh.points, system.loading.at(0.0))
    # Half a bar at each end belongs to no joint.
    energy = bending.energy(state) / (0.5 / radius**2 * (length - system.fibres[0].length[0]))
    moments = bending.moment(state.u) * radius
    return f"{energy:.4f} | {moments.min():.3f} to {moments.max():.3f}"


def helix(pitch: float, tilt: float) -> NDArray[np.float64]:
    """Return the part inside the tube of a helix that is tilted by an angle."""
    t = np.arange(-100.0, 100.0, np.radians(5.0))
    z = pitch * t / (2.0 * np.pi) + 6.0 * np.tan(tilt) * np.cos(t)
    inside = np.flatnonzero((z >= 0.0) & (z <= 50.0))
    longest = max(np.split(inside, np.flatnonzero(np.diff(inside) > 1) + 1), key=len)
    return np.column_stack([6.0 * np.cos(t), 6.0 * np.sin(t), z])[longest]


def main() -> None:
    """Print both tables."""
    for bars in (1.0, 2.0, 4.0, 8.0, 16.0):
        print(f"| {bars:g} | {rolled_up(bars)} |")
    tube = generate(CappedTube(inner_radius="5 mm", wall="2 mm", length="50 mm", cap="5 mm"), size=4.0)
    wires = {
        "helix of pitch 6 mm": helix(6.0, 0.0),
        "helix of pitch 10 mm, tilted by 40°": helix(10.0, np.radians(40.0)),
    }
    for name, curve in wires.items():
        for pressure, steps in ((0.01, 1), (0.02, 1), (0.03, 1), (0.03, 4)):
            counts = []
            for bending in (None, solid_bending_stiffness(STEEL, DIAMETER)):
                system = wired(tube, curve, bending, Clamped("mount"), [Pressure("cavity", pressure)])
                path = list(solve_path(system, [k / steps for k in range(1, steps + 1)]))
                work = f"{sum(f.factorisations for f in path)} ({sum(f.iterations for f in path)})"
                tip = np.linalg.norm(path[-1].state.u[tube.surface_nodes("tip-face")].mean(axis=0))
                counts.append(f"{work} | {tip:.2f}")
            print(f"| {name} | {pressure:g} | {steps} | {' | '.join(counts)} |", flush=True)


if __name__ == "__main__":
    main()
