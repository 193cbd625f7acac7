"""Compare the fits of Turgor with FElupe's `optimize` and scipy's plain least squares on the same curves.

Three programmes, three environments: FElupe is GPL and no dependency of Turgor. From the repository's root::

    python -m venv /tmp/peers && /tmp/peers/bin/pip install felupe tensortrax
    .venv/bin/python benchmarks/fits/compare_fits.py curves  out/    # the curves, cleaned, as CSV, and Turgor's fits
    /tmp/peers/bin/python benchmarks/fits/peer_fits.py       out/    # FElupe and scipy from their usual start values
    .venv/bin/python benchmarks/fits/compare_fits.py table   out/    # the table; fails if a peer is closer anywhere

The curves are read from ``../shared/data``; ``--data`` names another folder with ``tensile/*.csv`` and ``treloar.csv``.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

import numpy as np

from turgor.materials.fit import fit
from turgor.materials.testdata import read_tests

MODELS = [
    "neo-hookean", "mooney-rivlin-2", "mooney-rivlin-3", "mooney-rivlin-5", "mooney-rivlin-9", "yeoh-2", "yeoh-3",
    "ogden-1", "ogden-2", "ogden-3", "gent", "arruda-boyce", "van-der-waals", "extended-tube",
]  # fmt: skip

TOLERANCE = 5e-4
"""FElupe regularises its derivatives (equal stretches are shifted apart, the root of its van der Waals energy is kept
off zero), which moves its norms by up to 2e-4 against the formulas: scipy's, of these, agree with Turgor's to 1e-8."""

RANGES = {"0–300 %": (0.0, 3.0), "all": None}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("action", choices=["curves", "table"])
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).resolve().parents[3] / "shared" / "data")
    arguments = parser.parse_args()
    if arguments.action == "curves":
        write_curves(arguments.data, arguments.out)
    else:
        sys.exit(print_table(arguments.out))


def write_curves(data: Path, out: Path) -> None:
    """Write each curve as JSON, with the residual norms of Turgor's plain fits and the time they took."""
    out.mkdir(parents=True, exist_ok=True)
    for file in [*sorted((data / "tensile").glob("*.csv")), data / "treloar.csv"]:
        for name, span in RANGES.items():
            tests = read_tests(file)
            start = time.perf_counter()
            report = fit(tests, MODELS, strain_range=span, stability="ignore")
            seconds = time.perf_counter() - start
            content = {
                "curve": f"{file.stem}, {name}",
                "tests": [
                    {"mode": test.mode, "stretch": test.stretch.tolist(), "stress": test.stress.tolist()}
                    for test in report.tests
                ],
                "norms": {found.model: found.residual_norm for found in report.fits},
                "seconds": seconds,
                "recommended": _recommendation(tests, span),
            }
            target = out / f"{file.stem.replace(' ', '-')}-{'all' if span is None else '300'}.json"
            target.write_text(json.dumps(content), encoding="utf-8")


def _recommendation(tests: object, span: tuple[float, float] | None) -> str:
    start = time.perf_counter()
    report = fit(tests, strain_range=span)  # type: ignore[arg-type]
    seconds = time.perf_counter() - start
    chosen = report[report.recommended or ""]
    return f"{chosen.model}, RMSE {chosen.rmse / report.largest_stress:.2%}, {seconds:.1f} s"


def print_table(out: Path) -> int:
    """Print residual norms in MPa, a row per curve and model; return 1 if a peer is closer than Turgor anywhere."""
    worst = 0.0
    print("| curve | model | Turgor | FElupe optimize | scipy least_squares |")
    print("|---|---|---|---|---|")
    for file in sorted(out.glob("*.json")):
        if file.stem.startswith("peer-"):
            continue
        ours = json.loads(file.read_text(encoding="utf-8"))
        peers = json.loads((out / f"peer-{file.name}").read_text(encoding="utf-8"))
        for model, norm in ours["norms"].items():
            cells = []
            for peer in ("felupe", "scipy"):
                other = peers[peer].get(model)
                cells.append("–" if other is None else f"{other:.5g}")
                if other is not None and np.isfinite(other):
                    worst = max(worst, norm / other - 1.0)
            print(f"| {ours['curve']} | {model} | {norm:.5g} | {cells[0]} | {cells[1]} |")
    print("\n| curve | recommended, all models with stability | time of the 14 plain fits |\n|---|---|---|")
    for file in sorted(out.glob("*.json")):
        if not file.stem.startswith("peer-"):
            ours = json.loads(file.read_text(encoding="utf-8"))
            print(f"| {ours['curve']} | {ours['recommended']} | {ours['seconds']:.1f} s |")
    print(f"\nlargest excess of Turgor's norm over a peer's: {worst:.2e}")
    return int(worst > TOLERANCE)


if __name__ == "__main__":
    main()
