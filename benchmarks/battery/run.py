"""Two hundred random inflations: how many reach their target or end with a reason that is true?

    .venv/bin/python benchmarks/battery/run.py [--seeds 0:200] [--out results/NAME.jsonl] [--limit 300]
    .venv/bin/python benchmarks/battery/run.py --compare OLD.jsonl NEW.jsonl

Each case runs in a process of its own with a limit of processor time. A file of results is gone on with where it ends,
so that a run can be stopped at any time; `--again` runs its cases anew. Classes of outcome:

reached   the target pressure, in an equilibrium that the energy alone confirms
limit     the actuator has a limit pressure on the way, confirmed by volume control started afresh there
material  stopped, and the material has lost Drucker's stability at the last equilibrium
mesh      stopped, and an element is close to turning inside out (det F < 0.3) at the last equilibrium
refused   the input was refused with a message
failed    stopped for no reason that holds, an unconfirmed claim, or an exception
hang      no result within the time limit
"""

from __future__ import annotations

import argparse
import json
import os
import signal
import subprocess
import sys
import time
from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import Any

from cases import random_case

HERE = Path(__file__).parent
CLASSES = ("reached", "limit", "material", "mesh", "refused", "failed", "hang")
EXPLAINED = ("reached", "limit", "material")
LINES_OF_LOG = 30

ODD_HEAD = ("| seed | shape | materials | outcome | reached of target, kPa | reason |", "|--:|---|---|---|--:|---|")

Results = dict[int, dict[str, Any]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", default="0:200", help="first:last+1, or one seed")
    parser.add_argument("--out", type=Path, default=HERE / "results" / "battery.jsonl")
    parser.add_argument("--limit", type=float, default=300.0, help="processor seconds of a case on each thread")
    parser.add_argument("--most-cells", type=int, default=6000, help="larger meshes are made coarser")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--linear", default="auto", help="auto, direct or iterative")
    parser.add_argument("--again", action="store_true", help="run cases anew that the file has already")
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("OLD", "NEW"))
    asked = parser.parse_args()
    if asked.compare:
        print(comparison(*(load(path) for path in asked.compare)))
        return
    first, _, end = asked.seeds.partition(":")
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    done = load(asked.out) if asked.out.exists() else {}
    for seed in range(int(first), int(end or int(first) + 1)):
        if seed in done and not asked.again:
            continue
        done[seed] = run_case(seed, asked.most_cells, asked.limit, asked.threads, asked.linear)
        with asked.out.open("a") as out:
            out.write(json.dumps(done[seed]) + "\n")
        print(seed, done[seed]["outcome"], f"{done[seed]['cpu_s']:.0f} s", file=sys.stderr)
    text = summary(done)
    asked.out.with_suffix(".md").write_text(text)
    print(text)


def run_case(seed: int, most_cells: int, limit: float, threads: int, linear: str) -> dict[str, Any]:
    """Run one case in a process of its own, which dies when its processor time is used up."""
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    environment = os.environ | dict.fromkeys(names, str(threads))
    command = [sys.executable, str(HERE / "worker.py"), str(seed), str(most_cells), str(int(limit * threads)), linear]
    begun = time.perf_counter()
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        result = json.loads(done.stdout.strip().splitlines()[-1])
    elif done.returncode == -signal.SIGXCPU:
        result = {"outcome": "hang", "reason": f"no result in {limit:g} s", "cpu_s": limit * threads}
    else:
        result = {"outcome": "failed", "reason": f"the process ended with {done.returncode}", "cpu_s": 0.0}
    if result["outcome"] not in EXPLAINED:
        result["log"] = done.stderr.splitlines()[-LINES_OF_LOG:]
    return {"seed": seed, "case": asdict(random_case(seed))} | result | {"wall_s": time.perf_counter() - begun}


def load(path: Path) -> Results:
    """Return the results of a file by seed; of two for the same seed the later one."""
    return {item["seed"]: item for item in map(json.loads, path.read_text().splitlines())}


def summary(results: Results) -> str:
    """Return the Markdown summary: classes, shapes, and the cases that nothing explains."""
    counts = Counter(item["outcome"] for item in results.values())
    judged = len(results) - counts["refused"]
    explained = sum(counts[name] for name in EXPLAINED)
    lines = [
        f"{explained} of {judged} cases ({100 * explained / max(judged, 1):.1f} %) reached the target or ended with a "
        f"confirmed physical reason; {counts['refused']} more were refused as input.",
        "",
        "| outcome | cases | median CPU, s | longest, s |",
        "|---|--:|--:|--:|",
    ]
    for name in CLASSES:
        times = sorted(item["cpu_s"] for item in results.values() if item["outcome"] == name)
        if times:
            lines.append(f"| {name} | {len(times)} | {times[len(times) // 2]:.1f} | {times[-1]:.1f} |")
    odd = [item for item in results.values() if item["outcome"] not in (*EXPLAINED, "refused")]
    if odd:
        lines += [
            "",
            "| seed | shape | materials | outcome | reached of target, kPa | reason |",
            "|--:|---|---|---|--:|---|",
        ]
    lines += [odd_row(item) for item in sorted(odd, key=lambda item: item["seed"])]
    return "\n".join(lines) + "\n"


def odd_row(item: dict[str, Any]) -> str:
    case = item.get("case", {})
    reached = f"{item['reached_kPa']:.4g} of {item['target_kPa']:.4g}" if "reached_kPa" in item else ""
    reason = " ".join(str(item.get("reason", "")).split()).replace("|", "/")[:160]
    materials = ", ".join(dict.fromkeys(case.get("materials", [])))
    return f"| {item['seed']} | {case.get('template', '')} | {materials} | {item['outcome']} | {reached} | {reason} |"


def comparison(old: Results, new: Results) -> str:
    """Return what changed between two versions over the cases that are the same in both."""
    same = [s for s in sorted(old.keys() & new.keys()) if old[s].get("case") == new[s].get("case")]
    other = len(old.keys() & new.keys()) - len(same)
    lines = ["| outcome | old | new |", "|---|--:|--:|"]
    for name in CLASSES:
        counts = [sum(results[seed]["outcome"] == name for seed in same) for results in (old, new)]
        lines.append(f"| {name} | {counts[0]} | {counts[1]} |")
    times = [sum(results[seed]["cpu_s"] for seed in same) for results in (old, new)]
    lines += [
        "",
        f"{len(same)} cases in common ({other} left out: drawn differently): {times[0]:.0f} → {times[1]:.0f} s of CPU.",
    ]
    changed = [seed for seed in same if old[seed]["outcome"] != new[seed]["outcome"]]
    lines += [f"- seed {seed}: {old[seed]['outcome']} → {new[seed]['outcome']}" for seed in changed]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
