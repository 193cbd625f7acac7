"""The fibre tube of the thesis with its three tilts, to 12 psi and on to the 15 psi that its pressure in MPa means.

    .venv/bin/python benchmarks/studies/fibre_tube.py [--threads 1] [NAME…]

Prints Markdown: how far each tube bends, twists and moves at steps of 3 psi, and what each run took; then the 51° one
with other pitches and on a finer mesh.
"""

from __future__ import annotations

from examples import Ran, Row, asked_for, run_example

PSI = 6.894757293168362
"""In kPa."""

STEPS = tuple(step * PSI for step in (3.0, 6.0, 9.0, 12.0, 15.0))
ON = ('loads.0.value="15 psi"', "solver.outputs=[3 psi, 6 psi, 9 psi, 12 psi, 15 psi]")
FINER = ('mesh.size="6 mm"', "mesh.per_circle=12", 'fibres.0.bar_length="4 mm"')
ROWS = (
    Row("51°", "fibre-tube", ON, STEPS),
    Row("41°", "fibre-tube", ('geometry.tilt="41 deg"',), STEPS[:4]),
    Row("61°", "fibre-tube", ('geometry.tilt="61 deg"',), STEPS[:4]),
    Row("51°, pitch 4 mm", "fibre-tube", ('geometry.pitch="4 mm"',), STEPS[:4]),
    Row("51°, finer", "fibre-tube", FINER, STEPS[:4]),
)
MEASURES = {"bending_angle_deg": "°", "twist_deg": "°", "max_displacement_mm": " mm"}


def told(found: Ran, pressure: float) -> str:
    """Return what the tube does at a pressure, as a cell of the table."""
    values = [(found.at(pressure, key), unit) for key, unit in MEASURES.items()]
    return ", ".join("–" if value is None else f"{value:.1f}{unit}" for value, unit in values)


def main() -> None:
    rows, threads = asked_for(__doc__, ROWS)
    print("| bends, twists, moves | " + " | ".join(f"{step / PSI:.0f} psi" for step in STEPS), end=" | ")
    print("elements | unknowns | states | factorisations | iterations | wall, s | ended |")
    print("|---" * (len(STEPS) + 1) + "|--:|--:|--:|--:|--:|--:|---|")
    for row in rows:
        found = run_example(row.example, row.changes, threads)
        cells = [told(found, step) if step in row.pressures else "" for step in STEPS]
        print(f"| {row.name} | {' | '.join(cells)} | {found.counts} | {found.wall:.0f} | {found.ended} |", flush=True)


if __name__ == "__main__":
    main()
