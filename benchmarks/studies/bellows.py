"""The bellows of the ANSYS thesis by its sets of constants, free and held along the radius, and the model in space.

    .venv/bin/python benchmarks/studies/bellows.py [--threads 1] [NAME…]

Prints Markdown: largest displacement in mm at the pressures of the thesis and what each run took, then that of the
quarter in space, on two sizes of elements, against the section turned about the axis.
"""

from __future__ import annotations

from examples import Row, asked_for, print_displacements

FIVE = 'loads.0.value="5 kPa"'
HELD = (50.0, 80.0, 150.0)
EMPTIED = (-16.0, -32.0, -48.0, -64.0, -80.0)
SECTION = "MR2, section of 0.2 mm"
QUARTERS = ("MR2, quarter of 2.5 mm", "MR2, quarter of 1.25 mm")


def rubber(name: str) -> str:
    return f"materials.body.library={name}"


ROWS = (
    Row("TangoPlus, 5 kPa", "bellows", (rubber("tangoplus-mooney-rivlin"), FIVE), (5.0,), "1.635"),
    Row("MR2, 5 kPa", "bellows", (FIVE, "solver.steps=1"), (5.0,), "2.149"),
    Row("MR2", "bellows", (), (50.0,), "14.5"),
    Row("MR3", "bellows", (rubber("tpu-0deg-mooney-rivlin-3"),), (50.0,), "11.15"),
    Row("MR5", "bellows", (rubber("tpu-0deg-mooney-rivlin-5"),), (50.0,), "5.95"),
    Row("MR9", "bellows", (rubber("tpu-0deg-mooney-rivlin-9"),), (50.0,), "2.51"),
    Row("held, MR3", "bellows-supported", (), HELD, "3.35 / 4.91 / 7.84 (MR5)"),
    Row("held, MR2", "bellows-supported", (rubber("tpu-0deg-mooney-rivlin-2"),), HELD),
    Row(SECTION, "bellows", ('mesh.size="0.2 mm"',), (50.0,), "14.5"),
    Row(QUARTERS[0], "bellows-quarter", (), (50.0,), "14.5"),
    Row(QUARTERS[1], "bellows-quarter", ('mesh.size="1.25 mm"',), (50.0,), "14.5"),
    Row("emptied, section", "bellows", ('loads.0.value="-80 kPa"',), EMPTIED),
    Row("emptied, quarter", "bellows-vacuum", (), EMPTIED),
)


def main() -> None:
    ran = print_displacements(*asked_for(__doc__, ROWS))
    section = ran[SECTION].at(50.0) if SECTION in ran else None
    for name in QUARTERS:
        quarter = ran[name].at(50.0) if name in ran else None
        if section and quarter:
            print(f"\n{name}: {100.0 * (quarter / section - 1.0):+.2f} % of the section")


if __name__ == "__main__":
    main()
