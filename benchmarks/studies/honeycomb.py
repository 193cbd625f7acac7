"""The honeycomb network of its paper and its variants, against a wall, and in the silicone that the paper names.

    .venv/bin/python benchmarks/studies/honeycomb.py [--threads 1] [NAME…]

Prints Markdown: largest displacement in mm at 6 kPa (the silicone: at 1 and 2 kPa), what each run took and why it
ended; of the run against the wall also what the wall feels and how far the surfaces overlap.
"""

from __future__ import annotations

from examples import Row, asked_for, print_displacements

FULL, LOW = (6.0,), (1.0, 2.0)
COARSE = 'mesh.size="2 mm"'
STIFF = "materials.plate={model: neo-hookean, constants: {C10: 1000 MPa}}"
SOFT = "materials.body={library: ecoflex-00-35-fast-yeoh}"
WALL = "against a wall"

ROWS = (
    Row("L1 = 30 mm, d = 1 mm", "honeycomb", (), FULL, "29.49, measured 27"),
    Row("0.5 mm elements", "honeycomb", ('mesh.size="0.5 mm"', "solver.steps=1"), FULL, "29.49, measured 27"),
    Row("L1 = 5 mm", "honeycomb", ('geometry.web_length="5 mm"',), FULL, "expands most"),
    Row("d = 2 mm", "honeycomb", ('geometry.thickness="2 mm"',), FULL, "expands less"),
    Row("stiff plate on top", "honeycomb", ('geometry.plate="5 mm"', STIFF, "solver.steps=2"), FULL, "a rigid top"),
    Row(WALL, "honeycomb-plane", (), FULL, "full contact"),
    *(Row(f"Ecoflex 00-35, {size} mm", "honeycomb", (SOFT, f'mesh.size="{size} mm"'), LOW) for size in (3, 2, 1, 0.5)),
    *(
        Row(
            f"Ecoflex 00-35, 2 mm, rounded {radius} mm",
            "honeycomb",
            (SOFT, COARSE, f'geometry.rounding="{radius} mm"'),
            LOW,
        )
        for radius in (1, 2)
    ),
)


def main() -> None:
    ran = print_displacements(*asked_for(__doc__, ROWS))
    if WALL in ran and ran[WALL].history:
        last = ran[WALL].history[-1]
        keys = [key for key in last if key.startswith("contact_")]
        print("\nAgainst the wall: " + ", ".join(f"{key} {float(last[key]):.4g}" for key in keys))


if __name__ == "__main__":
    main()
