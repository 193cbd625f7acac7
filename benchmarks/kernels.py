"""How near the kernels come to what the machine can do, with one thread and with two.

    .venv/bin/python benchmarks/kernels.py [--size 2]

Each kernel runs on case T (`benchmarks/peers/cases.py`) as an iteration calls it. It is held against one limit: GB/s
of the arrays that must be read and written, beside those of a copy of a large array, or GFLOP/s of the operations
written out in the innermost loops, beside those of a product of large matrices (both measured in the same run, with as
many threads). The best of several repetitions counts.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numba
import numpy as np

from turgor.common.blas import dense_products_on_one_thread
from turgor.fem import kernels
from turgor.fem.kernels import CHUNKS, parallel
from turgor.fem.system import System
from turgor.materials.hyperelastic import Hyperelastic
from turgor.materials.library import get
from turgor.solver.blocks import BlockMatrix
from turgor.solver.iterative import AUGMENTATION

sys.path.insert(0, str(Path(__file__).parent / "peers"))
from case import Case
from cases import tube
from with_turgor import system_of

REPEATS = 15
LARGE = 2**25
"""Numbers in the arrays that are copied: 256 MB, more than any cache holds."""
MATRIX = 1500


@dataclass(frozen=True)
class Kernel:
    """What is timed, and how many bytes or operations it takes at least."""

    name: str
    call: Callable[[], object]
    size_bytes: float = 0.0
    operations: float = 0.0


def seconds(call: Callable[[], object]) -> float:
    call()
    times = []
    for _ in range(REPEATS):
        begun = time.perf_counter()
        call()
        times.append(time.perf_counter() - begun)
    return min(times)


@parallel
def copy(source, target):  # type: ignore[no-untyped-def]
    for chunk in numba.prange(CHUNKS):
        for k in range(chunk * len(source) // CHUNKS, (chunk + 1) * len(source) // CHUNKS):
            target[k] = source[k]


def of_the_element(system: System) -> list[Kernel]:
    """Return the kernels of the solid, at the state of rest."""
    (solid,) = system.solids
    u = np.zeros_like(system.mesh.points)
    m, q, _, n = solid.G.shape
    F, J, dilatation = np.empty((m, q, 3, 3)), np.empty((m, q)), np.empty((m, 1))
    kernels.deformation(u, solid.nodes, solid.G, solid.dV, solid.modes, F, J, dilatation)
    tau, tangent = np.zeros((m, q, 6)), np.ones((m, q, 21))
    pressure, bulk = np.zeros((m, q)), np.ones((m, 1, 1))
    force, packed = np.empty((m, n, 3)), np.empty((m, 3 * n * (3 * n + 1) // 2))
    gradient = np.empty((m, 1, 3, n))
    sizes = (kernels.counted(3), kernels.counted(n))
    places = kernels.packing(n, 3)
    # Products and sums of add_products for the six blocks on and above the diagonal, and of add_condensed.
    stiffness = m * (q * (6 * 3 * n * 5 + 6 * n * n * 6) + 6 * n * n * 2)
    return [
        Kernel(
            "deformation gradients",
            lambda: kernels.deformation(u, solid.nodes, solid.G, solid.dV, solid.modes, F, J, dilatation),
            size_bytes=solid.nodes.nbytes + solid.G.nbytes + solid.dV.nbytes + solid.modes.nbytes + F.nbytes + J.nbytes,
        ),
        Kernel(
            "forces",
            lambda: kernels.element_forces(F, solid.G, solid.dV, tau, pressure, force),
            size_bytes=F.nbytes + solid.G.nbytes + solid.dV.nbytes + tau.nbytes + pressure.nbytes + force.nbytes,
        ),
        Kernel(
            "stiffness",
            lambda: kernels.element_stiffness(
                F, solid.G, solid.dV, tau, tangent, pressure, solid.modes, bulk, *sizes, places, packed, gradient
            ),
            operations=stiffness,
        ),
    ]


def of_the_material(name: str, case: Case, material: Hyperelastic | None = None) -> Kernel:
    """Return stress and tangent of a material, or that of the case, at all quadrature points."""
    system = system_of(case)
    (solid,) = system.solids
    solid.material = material or solid.material
    rng = np.random.default_rng(0)
    u = 0.01 * rng.standard_normal(system.mesh.points.shape)
    solid.worst_jacobian(u)
    points = solid.dV.size
    # The deformation gradient and its determinant in, stress and tangent out.
    return Kernel(f"stress and tangent, {name}", solid._find_response, size_bytes=8.0 * points * (9 + 1 + 6 + 21))


def of_the_matrix(system: System) -> list[Kernel]:
    """Return assembly and sweeps."""
    pattern, state = system.pattern, system.reference_state()
    values = system.stiffness(state)
    matrix = BlockMatrix(pattern)
    system.split_stiffness(state, AUGMENTATION, matrix.layout, matrix.values)
    matrix.update()
    packed = system._packed
    right = np.random.default_rng(0).standard_normal(3 * len(matrix.order))
    pairs = sum(a.nbytes for a in pattern._pairs)
    places = sum(a.nbytes for a in vars(matrix.layout).values())
    rows = sum(a.nbytes for a in pattern._rows[:2])
    return [
        Kernel(
            "assembly, single entries",
            lambda: pattern.sum_blocks(packed, values),
            size_bytes=packed.nbytes + pairs + rows + values.nbytes,
        ),
        Kernel(
            "assembly, blocks",
            lambda: pattern.sum_into_layout(packed, matrix.layout, matrix.values),
            size_bytes=packed.nbytes + pairs + places + matrix.values.nbytes,
        ),
        Kernel("sweep and its product", lambda: matrix.sweep(right, right), size_bytes=2.0 * matrix.values.nbytes),
    ]


def measure(size: float, threads: int) -> None:
    """Print the rows of the table for so many threads, which those of this process are."""
    case = tube(size)
    system = system_of(case)
    source, target = np.ones(LARGE), np.empty(LARGE)
    one, other = np.ones((2, MATRIX, MATRIX))
    materials = [
        of_the_material("neo-Hookean", case),
        of_the_material("polynomial of second order", case, get("tpu-0deg-mooney-rivlin-5")),
        of_the_material("Ogden of two terms", case, get("dragon-skin-10-slow-ogden-2")),
    ]
    copied, multiplied = seconds(lambda: copy(source, target)), seconds(lambda: one @ other)
    bandwidth, peak = 2.0 * source.nbytes / copied, 2.0 * MATRIX**3 / multiplied
    print(f"| copy of a large array | {threads} | {1e3 * copied:.1f} | | {1e-9 * bandwidth:.1f} | | |")
    print(f"| product of large matrices | {threads} | {1e3 * multiplied:.1f} | | | {1e-9 * peak:.0f} | |")
    with dense_products_on_one_thread():
        for kernel in (*of_the_element(system), *materials, *of_the_matrix(system)):
            took = seconds(kernel.call)
            rate = (kernel.size_bytes or kernel.operations) / took
            part = rate / (bandwidth if kernel.size_bytes else peak)
            rates = f"{1e-9 * rate:.1f} | " if kernel.size_bytes else f" | {1e-9 * rate:.1f}"
            cost = f"{1e3 * took:.2f} | {1e6 * took / len(case.cells):.2f}"
            print(f"| {kernel.name} | {threads} | {cost} | {rates} | {part:.0%} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=2.0, help="element size of case T, mm")
    parser.add_argument("--threads", type=int, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.threads:
        measure(asked.size, asked.threads)
        return
    print(
        "| kernel | threads | ms | µs an element | GB/s | GFLOP/s | part of the limit |\n|---|--:|--:|--:|--:|--:|--:|"
    )
    names = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS")
    for threads in (1, 2):
        command = [sys.executable, __file__, "--size", str(asked.size), "--threads", str(threads)]
        sys.stdout.flush()
        subprocess.run(command, env=os.environ | dict.fromkeys(names, str(threads)), check=True)


if __name__ == "__main__":
    main()
