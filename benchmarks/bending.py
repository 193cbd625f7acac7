"""How many layers of elements a bending wall needs: a slender cantilever against beam theory, nearly incompressible.

    .venv/bin/python benchmarks/bending.py

Prints one table in Markdown: tip deflection over that of Euler and Bernoulli in plane strain, less one.
"""

from __future__ import annotations

import turgor as tg
from turgor.fem.loads import Force
from turgor.fem.section import PlaneStrain
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.mesh.structured import box, rectangle
from turgor.solver.path import solve_path

LENGTH, DEPTH, FORCE = 40.0, 0.5, 1e-8
LAYERS = (1, 2, 4, 6, 8)
RUBBER = tg.material("neo-hookean", {"C10": "0.05 MPa"}, poisson=0.499995)


def deflection(kind: str, layers: int, per_layer: int) -> float:
    """Return the tip's rise over beam theory, less one."""
    along = per_layer * layers
    if kind == "tri6":
        mesh, section, sides = rectangle((LENGTH, 1.0), (along, layers), kind), PlaneStrain(DEPTH), []
    else:
        mesh, section = box((LENGTH, 1.0, DEPTH), (along, layers, 1)), None
        sides = [Sliding("z0"), Sliding("z1")]
    load = Force("x1", (0.0, FORCE, 0.0))
    system = System(mesh, {"body": RUBBER}, [Clamped("x0"), *sides], [load], section=section)
    state = solve_path(system, [1.0])[0].state
    tip = max(mesh.surface_nodes("x1"), key=lambda node: mesh.points[node, 1])
    stiffness = RUBBER.young_modulus / (1 - RUBBER.poisson_ratio**2)
    return float(state.u[tip, 1]) / (FORCE * LENGTH**3 / (3 * stiffness * DEPTH / 12)) - 1


def main() -> None:
    print("| element | cells along the length per layer | " + " | ".join(f"{n} layers" for n in LAYERS) + " |")
    print("|---|---|" + "---|" * len(LAYERS))
    for kind in ("tri6", "tet10"):
        for per_layer in (12, 40):
            row = [f"{100 * deflection(kind, n, per_layer):+.1f} %" if per_layer * n <= 160 else "" for n in LAYERS]
            print(f"| {kind} | {per_layer} | " + " | ".join(row) + " |")


if __name__ == "__main__":
    main()
