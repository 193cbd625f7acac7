"""Run one case of the battery in this process and print what became of it as one line of JSON.

.venv/bin/python benchmarks/battery/worker.py SEED MOST_CELLS SECONDS LINEAR
"""

from __future__ import annotations

import faulthandler
import json
import logging
import resource
import signal
import sys
import time
import traceback
from dataclasses import asdict
from typing import Any

from cases import Case, mesh_of, random_case
from judge import DISTORTED, STATIONARY, Look, limit_is_confirmed, look, reached_pressure

from turgor.common.errors import InputError
from turgor.fem.loads import Pressure
from turgor.fem.supports import Clamped, Sliding
from turgor.fem.system import System
from turgor.materials.library import get
from turgor.mesh import Mesh
from turgor.solver.newton import Equilibrium, NewtonOptions
from turgor.solver.path import LimitPressureError, PathOptions, StoppedShortError, output_fractions, solve_path


def main() -> None:
    seed, most_cells, limit = (int(argument) for argument in sys.argv[1:4])
    faulthandler.register(signal.SIGXCPU, chain=True)
    resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 10))
    logging.basicConfig(level=logging.INFO, format="%(relativeCreated)d ms %(message)s")
    case = random_case(seed)
    result: dict[str, Any] = {}
    try:
        result |= outcome(case, most_cells, PathOptions(NewtonOptions(linear=sys.argv[4])))  # type: ignore[arg-type]
    except InputError as error:
        result |= {"outcome": "refused", "reason": str(error)}
    except Exception as error:  # noqa: BLE001  (whatever escapes is what the battery looks for)
        result |= {"outcome": "failed", "reason": repr(error), "traceback": traceback.format_exc(limit=-4)}
    print("\n" + json.dumps(result | {"cpu_s": time.process_time()}, default=str))


def outcome(case: Case, most_cells: int, options: PathOptions) -> dict[str, Any]:
    """Mesh, inflate and judge."""
    mesh = mesh_of(case, most_cells)
    target = case.level * case.slenderness * get(case.materials[0]).shear_modulus
    system = system_of(case, mesh, target)
    facts: dict[str, Any] = {"cells": mesh.n_cells, "unknowns": system.n_dofs, "target_kPa": 1e3 * target}
    found: list[Equilibrium] = []
    begun = time.perf_counter()
    try:
        solve_path(system, output_fractions(case.steps), options=options, on_equilibrium=found.append)
        verdict = {"outcome": "reached"}
    except LimitPressureError as error:
        verdict = {"outcome": "limit" if limit_is_confirmed(system, error) else "failed", "reason": str(error)}
    except StoppedShortError as error:
        verdict = {
            "outcome": "stopped",
            "reason": str(error),
            "facts": json.loads(json.dumps(error.facts, default=str)),
        }
    facts["solve_s"] = time.perf_counter() - begun
    facts["factorisations"] = sum(e.factorisations for e in found)
    if not found:
        return facts | verdict | ({"outcome": "failed"} if verdict["outcome"] == "stopped" else {})
    seen = look(system, found[-1])
    last = {"reached_kPa": 1e3 * reached_pressure(system, found[-1]), "stable": found[-1].stable}
    return facts | verdict | last | asdict(seen) | {"outcome": judged(verdict["outcome"], seen)}


def system_of(case: Case, mesh: Mesh, target: float) -> System:
    """Return the actuator held at its mount and symmetry planes, the target pressure in every cavity."""
    body, second = (get(name) for name in case.materials)
    materials = {region: body if region == "body" else second for region in mesh.regions}
    planes = [Sliding(name) for name in mesh.symmetry_planes]
    cavities = [name for name in mesh.surfaces if name == "cavity" or name.startswith("cavity-")]
    return System(mesh, materials, [Clamped("mount"), *planes], [Pressure(name, target) for name in cavities])


def judged(claimed: str, seen: Look) -> str:
    """Return the class of what the solver claimed, given what its last equilibrium looks like."""
    if not seen.slope < STATIONARY:
        return "failed"
    if claimed != "stopped":
        return claimed
    if seen.drucker_margin < 0.0:
        return "material"
    return "mesh" if seen.smallest_jacobian < DISTORTED else "failed"


if __name__ == "__main__":
    main()
