"""The six published actuators, each as its case file stands: whether they reach their loads, and what that takes.

    .venv/bin/python benchmarks/studies/all_six.py [--threads 2] [NAME…]

Prints one Markdown row per actuator; wall time is that of the whole command, meshing and report included.
"""

from __future__ import annotations

from examples import Row, asked_for, run_example

SIX = [Row(name, name) for name in ("bellows", "membrane", "pneunet", "honeycomb", "reinforced-tube", "fibre-tube")]


def main() -> None:
    """Run the examples that are asked for, one after the other."""
    rows, threads = asked_for(__doc__, SIX, threads=2)
    print("| example | elements | unknowns | states | factorisations | iterations | wall, s | ended |")
    print("|---|--:|--:|--:|--:|--:|--:|---|")
    total = 0.0
    for row in rows:
        found = run_example(row.example, row.changes, threads)
        total += found.wall
        print(f"| {row.name} | {found.counts} | {found.wall:.0f} | {found.ended} |", flush=True)
    print(f"\n{total:.0f} s in all, {threads} threads")


if __name__ == "__main__":
    main()
