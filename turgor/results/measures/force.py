"""Measures of force: what a rigid body feels, which serves as a dynamometer, and what a support carries."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.common.names import Name
from turgor.geometry.space import Place
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


@measure(
    "reaction_{surface}_{name}_x_N", "reaction_{surface}_{name}_y_N", "reaction_{surface}_{name}_z_N",
    "reaction_{surface}_{name}_N",
    "reaction_{surface}_{name}_torque_x_N_mm", "reaction_{surface}_{name}_torque_y_N_mm",
    "reaction_{surface}_{name}_torque_z_N_mm",
)  # fmt: skip
def reaction(
    state: StoredState, *, surface: str, about: Place | None = None, name: Name | None = None
) -> npt.NDArray[np.float64]:
    """Force in N (components, size) and torque in N mm with which the support of a surface holds the body.

    The torque is about the point `about`, left out about the centroid of the surface at rest. A half or quarter model
    has the part that its own share of the surface carries.
    """
    del name
    if surface not in state.body.supports:
        names = ", ".join(state.body.supports) or "no support of this body is known"
        raise InputError("no support holds this surface", key="surface", value=surface, expected=f"one of: {names}")
    facts = state.record.standing.get("supports", {}).get(surface)
    if facts is None:
        return np.zeros(7)
    force, torque = np.array(facts["force_N"]), np.array(facts["torque_N_mm"])
    if about is not None:
        torque = torque + np.cross(np.array(facts["about_mm"]) - np.array(about), force)
    return np.array([*force, np.linalg.norm(force), *torque])
