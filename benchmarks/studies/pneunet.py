"""The PneuNet geometry study: the finger to 50 kPa, the force of its blocked tip, and every trend that it reports.

    .venv/bin/python benchmarks/studies/pneunet.py [--only NAME …] [--size 3] [--no-self-contact]

Prints Markdown: of the finger of eight chambers bending angle and tip force by pressure (`--only published`), and a
table of variants of a finger of three. Halves in Dragon Skin 30 unless said otherwise, chambers free to meet; the force
of the half is doubled. The study does not print its layers, its number of chambers and where its dynamometer lies: here
it is a plate under the finger, touching it or 8 mm below. Compare directions.
"""

from __future__ import annotations

import argparse
import contextlib
import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import turgor as tg
from turgor.materials.library import get
from turgor.solver.events import Event
from turgor.solver.path import PathOptions

FULL = 50.0
"""The study's pressure, kPa."""
TOUCHING, BELOW = 0.01, 8.0
"""How far the plate lies under the finger, mm."""

CLEAR = 0.02
"""A difference smaller than this part is none."""

PUBLISHED = "published"


@dataclass(frozen=True)
class Variant:
    """A finger that differs from the first, which way the study says that bending and tip force change, and its load.

    It is inflated in so many `steps`.
    """

    name: str
    bending: str = "–"
    force: str = "–"
    changes: Mapping[str, object] = field(default_factory=dict)
    rubber: str = "dragon-skin-30-yeoh"
    paper_layer: bool = False
    steps: int = 2


BASE = Variant("as printed, three chambers")
VARIANTS = (
    Variant("gap 0.5 mm", "more", changes={"gap": "0.5 mm"}),
    Variant("gap 3 mm", "less", changes={"gap": "3 mm"}),
    Variant("wall 1.5 mm", "more", "less", {"wall": "1.5 mm"}),
    Variant("wall 2.5 mm", "less", "more", {"wall": "2.5 mm"}),
    Variant("side wall 1.5 mm", "more", changes={"side_wall": "1.5 mm"}),
    Variant("top wall 1.5 mm", changes={"top_wall": "1.5 mm"}),
    Variant("all walls 1.5 mm", "more", "less", {"wall": "1.5 mm", "side_wall": "1.5 mm", "top_wall": "1.5 mm"}),
    Variant("first layer 3 mm", "less", "more", {"first_layer": "3 mm"}),
    Variant("no second layer", "more", "less", {"second_layer": "0 mm"}),
    Variant("four chambers", "more", "more", {"chambers": 4}),
    Variant("six chambers", "more", "more", {"chambers": 6}),
    Variant("chamber height 10 mm", changes={"chamber_height": "10 mm"}),
    Variant("chamber width 8 mm", changes={"chamber_width": "8 mm"}),
    Variant("triangular section", "less", changes={"cross_section": "triangle"}),
    Variant("half-round section", changes={"cross_section": "half-round"}),
    Variant("paper under the first layer", paper_layer=True, steps=10),
    Variant("RTV 615", rubber="rtv615-yeoh"),
    Variant("Ecoflex 00-30", "more", "less", rubber="ecoflex-00-30-yeoh"),
    Variant("TPU", "least", "least", rubber="tpu-0deg-mooney-rivlin-2"),
)


@dataclass(frozen=True)
class Found:
    """What a variant does as far as it goes: bending angle in °, contact in mm², forces in N, pressures in kPa.

    `limits` says of each run whether it ends at a limit of the pressure; `overlap` is the largest at any state of the
    three, in parts of the wall, `crossing` the number of states in which the independent look sees surfaces cross.
    """

    bending: float
    contact: float
    touching: float
    below: float
    reached: tuple[float, float, float]
    limits: tuple[bool, bool, bool]
    elements: int
    overlap: float
    crossing: int


def finger(variant: Variant, chambers: int = 3) -> tg.PneuNet:
    return tg.PneuNet(**{"chambers": chambers, **variant.changes}, symmetric=True)


def inflated(variant: Variant, shape: tg.PneuNet, size: str, plate: float | None = None, own: bool = True) -> tg.Path:
    """Inflate as far as it goes, free or above a plate so many mm under the bottom, with self-contact or without."""
    under = {"type": "plane", "name": "plate", "point": ["0 mm", "0 mm", f"{-(plate or 0.0)} mm"], "normal": [0, 0, 1]}
    bodies = [] if plate is None else [{**under, "surface": "outer"}]
    sheet = {"between": ["body", "base"], "youngs_modulus": "2 GPa", "thickness": "0.1 mm"}
    model = tg.Model(
        shape.mesh(size=size),
        contact={"self": own, "bodies": bodies} if own or bodies else None,
        sheets=[sheet] if variant.paper_layer else [],
        measures=["bending_angle", "tip_position"],
        body=get(variant.rubber),
    )
    states: list[tg.Path] = []
    with contextlib.suppress(tg.SolverError):
        model.inflate(
            f"{FULL} kPa", steps=variant.steps, on_step=states.append, options=PathOptions(smallest_step=1e-3)
        )
    return states[-1]


def force(path: tg.Path, row: int = -1) -> float:
    """Return what the plate feels, N: half of the finger presses half as much."""
    return 2.0 * float(path.history[row]["contact_plate_force_N"])


def measured(variant: Variant, size: str, own: bool) -> Found:
    shape = finger(variant)
    free, touching, below = (inflated(variant, shape, size, plate, own) for plate in (None, TOUCHING, BELOW))
    return Found(
        bending=float(free.bending_angle.magnitude[-1]),
        contact=float(free.history[-1].get("contact_self_area_mm2", 0.0)),
        touching=force(touching),
        below=force(below),
        reached=tuple(float(path.pressure.magnitude[-1]) for path in (free, touching, below)),
        limits=tuple(path.history[-1]["event"] == Event.LIMIT for path in (free, touching, below)),
        elements=free.mesh.n_cells,
        overlap=max(most(path, "overlap_per_wall") for path in (free, touching, below)),
        crossing=sum(crossings(path) for path in (free, touching, below)),
    )


def most(path: tg.Path, fact: str) -> float:
    """Return the largest value that a fact of any contact has in any state."""
    return max((float(value) for row in path.history for key, value in row.items() if key.endswith(fact)), default=0.0)


def crossings(path: tg.Path) -> int:
    """Return the number of states in which the independent look finds surfaces that cross."""
    return sum(
        any(float(value) > 0.0 for key, value in row.items() if key.endswith("intersect")) for row in path.history
    )


def published(size: str) -> None:
    """Print the finger of eight chambers, free and blocked, by pressure."""
    begun = time.perf_counter()
    shape = finger(BASE, chambers=8)
    free, blocked = (inflated(replace(BASE, steps=5), shape, size, plate) for plate in (None, TOUCHING))
    print("| pressure, kPa | bending, ° | contact, mm² | blocked: tip force, N | contact, mm² |\n|---|---|---|---|---|")
    for k, (one, other) in enumerate(zip(free.history, blocked.history, strict=False)):
        print(
            f"| {one['pressure_kPa']:.3g} | {one['bending_angle_deg']:.1f} | {one['contact_self_area_mm2']:.1f} | "
            f"{force(blocked, k):.3f} | {other['contact_self_area_mm2']:.1f} |"
        )
    print(f"\n{free.mesh.n_cells} elements, {time.perf_counter() - begun:.0f} s\n", flush=True)


def change(value: float, base: float, reached: float) -> str:
    """Say which way a value changes; what was not carried to the full pressure says nothing."""
    if reached < 0.99 * FULL:
        return "?"
    return "same" if abs(value - base) <= CLEAR * abs(base) else "more" if value > base else "less"


def cell(value: float, reached: float, limit: bool, digits: int) -> str:
    end = "limit" if limit else "stops"
    return f"{value:.{digits}f}" + ("" if reached >= 0.999 * FULL else f" ({end} at {reached:.3g} kPa)")


def trends(variants: list[Variant], size: str, own: bool) -> None:
    """Print the table of variants against the first."""
    print(
        "| variant | bending, ° | contact, mm² | force, plate touching, N | plate 8 mm below, N | paper | ours | "
        "overlap, % of the wall | crossing | s |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    base: Found | None = None
    for variant in [BASE, *variants]:
        begun = time.perf_counter()
        found = measured(variant, size, own)
        free, touching, below = found.reached
        base = base or found
        ours = [
            change(found.bending, base.bending, free),
            change(found.touching, base.touching, touching),
            change(found.below, base.below, below),
        ]
        values, digits = (found.bending, found.touching, found.below), (1, 3, 3)
        bending, *forces = map(cell, values, found.reached, found.limits, digits)
        print(
            f"| {variant.name} | {bending} | {found.contact:.1f} | {' | '.join(forces)} | "
            f"{variant.bending}, {variant.force} | {', '.join(ours)} | {100.0 * found.overlap:.2f} | "
            f"{found.crossing} | {time.perf_counter() - begun:.0f} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", help=f"'{PUBLISHED}' or the name of a variant; may be repeated")
    parser.add_argument("--size", default="3", help="element size, mm")
    parser.add_argument("--no-self-contact", action="store_true", help="variants pass through themselves")
    chosen = parser.parse_args()
    names = [PUBLISHED, *(variant.name for variant in VARIANTS)]
    unknown = set(chosen.only or ()) - set(names)
    if unknown:
        parser.error(f"there is no {', '.join(sorted(unknown))}; expected some of: {', '.join(names)}")
    wanted = chosen.only or names
    if PUBLISHED in wanted:
        published(f"{chosen.size} mm")
    variants = [variant for variant in VARIANTS if variant.name in wanted]
    if variants:
        trends(variants, f"{chosen.size} mm", not chosen.no_self_contact)


if __name__ == "__main__":
    main()
