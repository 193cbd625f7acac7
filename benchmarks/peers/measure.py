"""What every adapter shares: when Newton's method has arrived; warm up, start the clocks, solve, print JSON."""

from __future__ import annotations

import json
import math
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from case import MOST_ITERATIONS, TOLERANCE, VOLUME_TOLERANCE, Case


@dataclass(frozen=True)
class Solved:
    """What a code says of its equilibrium.

    ``tip`` is the displacement of the tip node, mm; `work` that of the forces at the supports along the displacements
    given there, N mm; `unknowns` the size of the linear system; `version` the code's.
    """

    tip: tuple[float, ...]
    work: float
    unknowns: int
    iterations: int
    factorisations: int
    settings: str
    version: str


class Newton:
    """When the benchmark's Newton iteration has arrived, told after each evaluation of the residual."""

    def __init__(self, case: Case) -> None:
        self.iterations = -1
        self._loaded = case.has_cavity
        self._load = 0.0

    def arrived(self, imbalance: float, forces: float, gap: float = 0.0) -> bool:
        """Say whether the state is an equilibrium; raise SystemExit if none is to be expected.

        `imbalance` is the norm of the residual where displacements are free, `forces` that where they are held too,
        `gap` that of the volume's residual over its parts. The load is the pressure's nodal forces, the only ones at
        rest; where there is none, what the supports carry.
        """
        self.iterations += 1
        if self.iterations == 0 or not self._loaded:
            self._load = forces
        if self.iterations and imbalance <= TOLERANCE * self._load and gap <= VOLUME_TOLERANCE:
            return True
        if self.iterations == MOST_ITERATIONS or not math.isfinite(imbalance):
            raise SystemExit(f"no equilibrium in {self.iterations} iterations, imbalance {imbalance / self._load:.2g}")
        return False


class Alone:
    """What a code that runs in one process passes for its communicator."""

    rank = 0

    def allreduce(self, value: float) -> float:
        return value

    def barrier(self) -> None:
        """Wait for nobody."""


def run(
    solve: Callable[[Case], Solved], comm: Alone | Any = None, *, warm_up: Callable[[Case], object] | None = None
) -> None:
    """Solve the mesh named first on the command line; the one named second, if any, only warms the code up.

    That is done by `solve`, or by `warm_up` where it takes something else. The clocks run from the mesh in memory to
    the displacement in memory: set-up is in, imports, compilation and what is done once per process are not. Processor
    time and memory are summed over the ranks of `comm`.
    """
    comm = comm or Alone()
    if len(sys.argv) > 2:
        (warm_up or solve)(Case.load(sys.argv[2]))
    mesh = Case.load(sys.argv[1])
    comm.barrier()
    wall, cpu = time.perf_counter(), cpu_s()
    solved = solve(mesh)
    comm.barrier()
    wall = time.perf_counter() - wall
    cpu, memory = comm.allreduce(cpu_s() - cpu), comm.allreduce(peak_memory_MB())
    if comm.rank == 0:
        print("\n" + json.dumps(asdict(solved) | {"wall_s": wall, "cpu_s": cpu, "peak_memory_MB": memory}), flush=True)


def cpu_s() -> float:
    """Return the processor seconds of this process, its threads and the processes it waited for."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def peak_memory_MB() -> float:
    """Return the largest resident memory so far of this process or one it waited for."""
    # The kernel's account of this process starts with what the one that started it had: its own image tells its own.
    image = dict(line.split(":") for line in Path("/proc/self/status").read_text().splitlines())
    own = int(image["VmHWM"].split()[0])
    return max(own, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss) / 1024
