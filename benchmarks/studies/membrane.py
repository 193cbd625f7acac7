"""The T-shaped membrane chamber of the ANSYS thesis against its measured and computed rises, and mesh convergence.

    .venv/bin/python benchmarks/studies/membrane.py [--only section | quarter | meshes | widths …]

Prints tables in Markdown: the rise of the membrane's middle in mm by material, in the plane section and in the quarter
model; by mesh; and by the width of the chamber and of its bore in the section. The thesis fitted its constants to one
tensile test; beside those that are unstable stands a stable model, fitted to their tensile curve.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np

import turgor as tg
from turgor.materials import Hyperelastic
from turgor.materials.library import get

PRESSURES = (70, 103, 138, 172)
MEASURED = (0.06, 0.09, 0.11, 0.14)
ANSYS = (0.0596, 0.0900, 0.1140, 0.1332)
PROGRAMME = {
    "time": [f"{number} s" for number in range(len(PRESSURES) + 1)],
    "pressure": ["0 kPa", *(f"{value} kPa" for value in PRESSURES)],
}
SECTION = {"model": "plane", "size": "0.5 mm", "layers": 4}
QUARTER = {"model": "quarter", "size": "2 mm", "layers": 1}
WIDTH, BORE = "2.05 mm", "1.6 mm"
"""Of the chamber, calibrated on the rise at 103 kPa, and of its inlet, narrower than the 2 mm that are printed, for
between the two of them tetrahedra become tiny; the bore does not matter to the rise."""
PARTS = ("section", "quarter", "meshes", "widths")


def published(number: int) -> Hyperelastic:
    """Return the thesis's Mooney–Rivlin material of so many constants."""
    return get(f"tpu-0deg-mooney-rivlin-{number}")


def stable_fit(number: int, largest: float = 0.5) -> Hyperelastic:
    """Fit stable models to the tensile curve of a published set and return the best."""
    strain = np.linspace(0.0, largest, 51)[1:]
    stress = published(number).uniaxial(1.0 + strain)
    rows = "".join(f"{e:.6g},{s:.6g}\n" for e, s in zip(strain, stress, strict=True))
    with tempfile.TemporaryDirectory() as folder:
        table = Path(folder) / "curve.csv"
        table.write_text(f"strain (1),stress (MPa)\n{rows}", encoding="utf-8")
        return tg.fit(table, models=["yeoh-3", "ogden-2", "mooney-rivlin-2"], stability="require").best


def rise(
    rubber: Hyperelastic, *, model: str, size: str, layers: int, width: str = WIDTH, bore: str = BORE
) -> tuple[list[float], str]:
    """Return the rise of the membrane's middle at each pressure as far as it goes, and what it took."""
    shape = tg.Membrane(segments=1, model=model, chamber_width=width, inlet_diameter=bore)
    # Walls are measured in space; the section is told the size in its membrane.
    fine = {"sizes": {"membrane": f"{shape.membrane / layers} mm"}} if model == "plane" else {"layers": layers}
    mesh = shape.mesh(size=size, **fine)
    chamber = tg.Model(mesh, section=shape.section, measures=["tip_displacement"], body=rubber)
    states: list[tg.Path] = []
    begun = time.perf_counter()
    try:
        chamber.play({"cavity": PROGRAMME}, steps=len(PRESSURES), on_step=states.append)
        end = ""
    except tg.SolverError as error:
        end = f"; {error}"
    wall = time.perf_counter() - begun
    along = "y" if model == "plane" else "z"
    found = list(states[-1].series(f"tip_displacement_{along}").magnitude) if states else []
    iterations = sum(record.solver["iterations"] for record in states[-1].records) if states else 0
    return found, f"{mesh.n_cells} elements, {iterations} iterations, {wall:.1f} s{end}"


def line(name: str, values: list[float] | tuple[float, ...], note: str = "") -> None:
    cells = [f"{value:.4f}" for value in values] + [""] * (len(PRESSURES) - len(values))
    print(f"| {name} | " + " | ".join(cells) + f" | {note} |", flush=True)


def heading() -> None:
    print("\n| | " + " | ".join(f"{value} kPa" for value in PRESSURES) + " | |\n|---|" + "---|" * (len(PRESSURES) + 1))


def by_material(where: str) -> None:
    heading()
    line("measured", MEASURED)
    line("ANSYS, 5 constants, 0.3 mm", ANSYS)
    mesh = SECTION if where == "section" else QUARTER
    for number in (2, 3, 5, 9):
        line(f"{number} constants, {where}", *rise(published(number), **mesh))
        if number in (5, 9):
            name = f"stable fit to {number} constants, {where}"
            try:
                fitted = stable_fit(number)
            except tg.InputError:
                line(name, [], "none of the models tried is stable over the range")
            else:
                line(name, *rise(fitted, **mesh))


def by_mesh() -> None:
    heading()
    for where, mesh, counts in (("section", SECTION, (1, 2, 4, 8)), ("quarter", QUARTER, (1, 2))):
        for layers in counts:
            line(f"{where}, {layers} layers", *rise(published(5), **(mesh | {"layers": layers})))


def by_width() -> None:
    heading()
    for width, bore in ((2.5, 2.0), (2.2, 2.0), (2.05, 2.0), (2.05, 1.6), (2.0, 1.6), (1.8, 1.6)):
        found = rise(published(5), **SECTION, width=f"{width} mm", bore=f"{bore} mm")
        line(f"chamber {width} mm, bore {bore} mm", *found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", choices=PARTS, help="may be repeated; left out, all of them")
    chosen = parser.parse_args().only or PARTS
    for where in ("section", "quarter"):
        if where in chosen:
            by_material(where)
    if "meshes" in chosen:
        by_mesh()
    if "widths" in chosen:
        by_width()


if __name__ == "__main__":
    main()
