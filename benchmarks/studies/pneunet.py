"""The trends that the PneuNet geometry study reports, on coarse meshes of a shorter finger.

    .venv/bin/python benchmarks/studies/pneunet.py

Prints one table in Markdown: a variant, the bending angle of the free finger, and the force on a rod under its tip that
blocks it. Half of a finger of three chambers in Dragon Skin 30; self-contact where the gap is narrow, for chambers 2 mm
apart do not meet below 50 kPa. The study does not print its layers and number of chambers: compare directions.
"""

from __future__ import annotations

import time

import turgor as tg
from turgor.materials import Hyperelastic
from turgor.materials.library import get

FREE, BLOCKED = "40 kPa", "20 kPa"
BASE = {"chambers": 3}
RUBBER = "dragon-skin-30-yeoh"
VARIANTS: list[tuple[str, dict[str, object], str]] = [
    ("as printed, three chambers", {}, RUBBER),
    ("gap 0.5 mm", {"gap": "0.5 mm"}, RUBBER),
    ("gap 3 mm", {"gap": "3 mm"}, RUBBER),
    ("wall 1.5 mm", {"wall": "1.5 mm"}, RUBBER),
    ("side and top wall 1.5 mm", {"side_wall": "1.5 mm", "top_wall": "1.5 mm"}, RUBBER),
    ("first layer 3 mm", {"first_layer": "3 mm"}, RUBBER),
    ("second layer none", {"second_layer": "0 mm"}, RUBBER),
    ("four chambers", {"chambers": 4}, RUBBER),
    ("chamber height 10 mm", {"chamber_height": "10 mm"}, RUBBER),
    ("chamber width 8 mm", {"chamber_width": "8 mm"}, RUBBER),
    ("half-round section", {"cross_section": "half-round"}, RUBBER),
    ("triangular section", {"cross_section": "triangle"}, RUBBER),
    ("paper under the first layer", {}, RUBBER),
    ("Ecoflex 00-30", {}, "ecoflex-00-30-yeoh"),
    ("RTV 615", {}, "rtv615-yeoh"),
    ("TPU", {}, "tpu-0deg-mooney-rivlin-2"),
]


def rod(finger: tg.PneuNet) -> dict[str, object]:
    """Return a dynamometer: a rod across the finger, just under the bottom of its tip."""
    x, radius = finger.length - 2.0, 3.0
    ends = [[f"{x} mm", f"{y} mm", f"{-radius - 0.01} mm"] for y in (-50, 50)]
    body = {"type": "cylinder", "name": "rod", "start": ends[0], "end": ends[1], "radius": f"{radius} mm"}
    return {"bodies": [{**body, "surface": "outer"}]}


def sheets(name: str) -> list[dict[str, object]]:
    if not name.startswith("paper"):
        return []
    return [{"between": ["body", "base"], "youngs_modulus": "2 GPa", "thickness": "0.1 mm"}]


def last(name: str, finger: tg.PneuNet, rubber: Hyperelastic, pressure: str, contact: object) -> tuple[tg.Path, str]:
    """Inflate as far as it goes; return the states and the note that tells if that is not the whole way."""
    states: list[tg.Path] = []
    model = tg.Model(
        finger.mesh(size="4 mm"),
        contact=contact,
        sheets=sheets(name),
        measures=["bending_angle", "tip_position"],
        body=rubber,
    )
    try:
        model.inflate(pressure, steps=1, on_step=states.append)
    except tg.SolverError:
        return states[-1], f" (to {states[-1].pressure.magnitude[-1]:.3g} kPa)"
    return states[-1], ""


def main() -> None:
    print(f"| variant | bending at {FREE}, ° | contact, mm² | tip force at {BLOCKED}, N | elements | time, s |")
    print("|---|---|---|---|---|---|")
    for name, changes, rubber in VARIANTS:
        begun = time.perf_counter()
        finger = tg.PneuNet(**{**BASE, **changes}, symmetric=True)
        material = get(rubber)
        free, note = last(name, finger, material, FREE, finger.gap < 2.0)
        blocked, short = last(name, finger, material, BLOCKED, rod(finger))
        # Half of the finger feels half of the force.
        force = 2.0 * blocked.history[-1]["contact_rod_force_z_N"]
        area = free.history[-1].get("contact_self_area_mm2", 0.0)
        wall = time.perf_counter() - begun
        print(
            f"| {name} | {free.bending_angle.magnitude[-1]:.1f}{note} | {area:.1f} | {abs(force):.3f}{short} | "
            f"{free.mesh.n_cells} | {wall:.0f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
