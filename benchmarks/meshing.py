"""How long meshing takes: every example through the command line, and a large body with its partition.

`.venv/bin/python benchmarks/meshing.py` prints the two tables of docs/performance.md.
"""

import json
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from turgor.geometry.catalogue import actuator
from turgor.geometry.space import Space
from turgor.mesh.generate import generate
from turgor.mesh.partition import partition

EXAMPLES = Path(__file__).parents[1] / "examples"
SIZES = (1.15, 0.85)
"""Of the reinforced tube, mm: about 100 000 and 200 000 tetrahedra."""
CORE = {"point": ("0 mm", "0 mm", "0 mm"), "direction": (0, 0, 1), "radius": "7 mm"}


def time_example(path: Path) -> str:
    """Return a row: what `turgor mesh` makes of an example, and the wall time of the whole command."""
    with TemporaryDirectory() as folder:
        command = [
            "-c",
            "from turgor.cli import main; main()",
            "mesh",
            str(path),
            "--out",
            str(Path(folder) / "mesh.vtu"),
            "--json",
        ]
        begun = time.perf_counter()
        done = subprocess.run([sys.executable, *command], capture_output=True, text=True, check=True)
        wall = time.perf_counter() - begun
    facts = json.loads(done.stdout)
    return f"| `{path.stem}` | {facts['elements']} | {facts['nodes']} | {wall:.1f} |"


def time_large(size: float) -> str:
    """Return a row: the reinforced tube meshed with this size, and moved to three regions in one call."""
    begun, used = time.perf_counter(), time.process_time()
    mesh = generate(actuator("reinforced-tube"), size)
    meshed, cpu = time.perf_counter(), time.process_time()
    parts = partition(mesh, {"core": Space(cylinder=CORE)})
    divided = time.perf_counter()
    assert len(parts.regions) == 3
    times = f"{meshed - begun:.1f} | {cpu - used:.1f} | {divided - meshed:.1f}"
    return f"| {size:g} mm | {mesh.n_cells} | {mesh.n_points} | {times} |"


if __name__ == "__main__":
    print("| example | elements | nodes | wall, s |\n|---|--:|--:|--:|")
    for example in sorted(EXAMPLES.glob("*.yaml")):
        print(time_example(example), flush=True)
    print("\n| size | tetrahedra | nodes | wall, s | CPU, s | partition, s |\n|---|--:|--:|--:|--:|--:|")
    for edge in SIZES:
        print(time_large(edge), flush=True)
