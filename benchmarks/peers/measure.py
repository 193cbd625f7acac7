"""What every adapter does around its solver: warm up, start the clocks, solve, print one line of JSON."""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from case_t import TubeMesh


@dataclass(frozen=True)
class Solved:
    """What a code says of its equilibrium.

    ``tip`` is the displacement of the tip node, mm; `unknowns` the size of the linear system; `version` the code's.
    """

    tip: tuple[float, float, float]
    unknowns: int
    iterations: int
    factorisations: int
    settings: str
    version: str


class Alone:
    """What a code that runs in one process passes for its communicator."""

    rank = 0

    def allreduce(self, value: float) -> float:
        return value

    def barrier(self) -> None:
        """Wait for nobody."""


def run(solve: Callable[[TubeMesh], Solved], comm: Alone | Any = None, *, warm_up: bool = True) -> None:
    """Solve the mesh named first on the command line; the one named second, if any, only warms the code up.

    The clocks run from the mesh in memory to the displacement in memory: set-up is in, imports, compilation and what
    is done once per process are not. Processor time and memory are summed over the ranks of `comm`.
    """
    comm = comm or Alone()
    if warm_up and len(sys.argv) > 2:
        solve(TubeMesh.load(sys.argv[2]))
    mesh = TubeMesh.load(sys.argv[1])
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
    return max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1024
