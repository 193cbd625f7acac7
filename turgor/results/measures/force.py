"""Measures of what a body presses with: the force on a rigid body, which serves as a dynamometer."""

from __future__ import annotations

import numpy as np

from turgor.common.errors import InputError
from turgor.results.measures.registry import measure
from turgor.results.stored import StoredState


@measure("tip_force_N")
def tip_force(state: StoredState, *, body: str | None = None) -> float:
    """Size of the force in N that a rigid body feels: `body`, or the only one there is."""
    names = state.body.rigid_bodies
    name = names[0] if body is None and len(names) == 1 else body
    if name not in names:
        problem = "the actuator meets no rigid body" if not names else "there is no rigid body of this name"
        if body is None and names:
            problem = "there are several rigid bodies"
        expected = f"one of: {', '.join(names)}" if names else "a rigid body under contact.bodies"
        raise InputError(problem, key="body", value=body, expected=expected)
    felt = state.record.standing.get("contact", {}).get(name, {}).get("force_N")
    return 0.0 if felt is None else float(np.linalg.norm(felt))
