"""From the solver's equilibria to stored records, and from the last stored record back to where the solver stood."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np

from turgor.fem.contact.friction import WIDTH
from turgor.fem.contact.term import Contact
from turgor.fem.fields import von_mises
from turgor.fem.interface import Interface, interfaces
from turgor.fem.reaction import Reactions
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.results.record import StepRecord
from turgor.solver.newton import Equilibrium
from turgor.study.course import Course


def to_record(
    system: System,
    equilibrium: Equilibrium,
    index: int,
    wall_s: float,
    between: Sequence[Interface],
    reactions: Reactions,
    course: Course | None = None,
) -> StepRecord:
    """Return the record of an equilibrium.

    Parameters
    ----------
    system
        The system it is a state of.
    equilibrium
        What the solver delivered.
    index
        Number of the step.
    wall_s
        Duration of the step in s.
    between
        The interfaces of two materials.
    reactions
        What its supports carry.
    course
        What the run prescribes; left out, the loads.
    """
    state = equilibrium.state
    fraction = equilibrium.fraction if course is None else course.parameter(equilibrium)
    duration = None if course is None else course.duration
    stress = von_mises(system, state)
    return StepRecord(
        index=index,
        fraction=fraction,
        loads={name: float(value) for name, value in zip(system.loading.names, state.loads, strict=True)},
        displacement=system.body_part(state.u),
        element_pressure=system.element_pressure(state),
        element_dilatation=system.dilatation(state),
        von_mises=stress.nodal,
        von_mises_by_region=stress.by_region if len(stress.by_region) > 1 else {},
        von_mises_max=stress.largest,
        von_mises_p99=stress.percentile_99,
        cavity_volumes={cavity.name: cavity.volume(state.u) for cavity in system.cavities},
        solver={
            "iterations": equilibrium.iterations,
            "factorisations": equilibrium.factorisations,
            "stable": equilibrium.stable if course is None else course.stable(equilibrium),
            "residual": float(equilibrium.residuals[-1]),
            "wall_s": wall_s,
            "contact_penalty": state.penalty,
            "contact_margin": state.margin,
            "contact_grips": [rows.tolist() for rows in state.grips],
            "bodies_mm": state.u[system.mesh.n_points :].tolist(),
            "load_fraction": equilibrium.fraction,
            "event": equilibrium.event or "",
            **({} if duration is None else {"time_s": duration * fraction}),
        },
        standing=standing(system, state, between, reactions),
        mode=None if equilibrium.mode is None else system.body_part(equilibrium.mode),
    )


class Recorder:
    """Turns equilibria into records, counts them and times them.

    Parameters
    ----------
    system
        The system they are states of.
    first
        Number of the first record.
    course
        What the run prescribes; left out, the loads.
    """

    def __init__(self, system: System, first: int = 0, course: Course | None = None) -> None:
        self.system = system
        self._between = interfaces(system)
        self._reactions = Reactions(system)
        self.course = course
        self._next = first
        self.begin()

    def begin(self) -> None:
        """Start the clock of the next step anew; what was done since the last record is not its work."""
        self._begun = time.perf_counter()

    def record(self, equilibrium: Equilibrium) -> StepRecord:
        """Return the record of the next step."""
        wall_s = time.perf_counter() - self._begun
        made = to_record(self.system, equilibrium, self._next, wall_s, self._between, self._reactions, self.course)
        self._next += 1
        self.begin()
        return made


def standing(
    system: System, state: State, between: Sequence[Interface], reactions: Reactions
) -> dict[str, dict[str, dict[str, Any]]]:
    """Return how contacts, fibres, interfaces and supports stand in a state, in plain values; only what there is.

    Returns
    -------
    dict
        ``contact``: by its name, area, overlap or by a barrier the smallest gap (also in parts of the wall behind
        it; ``None`` beyond the barrier's reach), and what a rigid body feels;
        of the body with itself, where the IPC Toolkit is installed, whether more than 1 % of the wall overlaps;
        ``fibres``: by its curve, the largest tension and strain, and bending moment where it resists bending;
        ``interfaces``: by its regions, the traction;
        ``supports``: by its surface, force and torque on the body.
    """
    bent = {term.fibre.curve: {"largest_moment_N_mm": float(term.moment(state.u).max())} for term in system.bending}
    found = {
        "contact": {contact.name: _touch(contact, state) for contact in system.contacts},
        "fibres": {
            embedded.fibre.curve: {
                "largest_tension_N": float(embedded.tension(state.u).max()),
                "largest_strain": float(embedded.strain(state.u).max()),
            }
            | bent.get(embedded.fibre.curve, {})
            for embedded in system.fibres
        },
        "interfaces": {interface.name: interface.facts(state) for interface in between},
        "supports": reactions.facts(state),
    }
    return {kind: facts for kind, facts in found.items() if facts}


def _touch(contact: Contact, state: State) -> dict[str, Any]:
    touch = contact.touch(state)
    facts: dict[str, Any] = {"area_mm2": touch.area}
    if touch.barrier:
        facts |= {"gap_mm": touch.gap, "gap_per_wall": touch.gap_per_wall}
    else:
        facts |= {"overlap_mm": touch.overlap, "overlap_per_wall": touch.overlap_per_wall}
    if (intersect := contact.intersects(state)) is not None:
        facts["surfaces_intersect"] = intersect
    if touch.force is not None and touch.torque is not None:
        facts |= {"force_N": list(touch.force), "torque_N_mm": list(touch.torque)}
    if touch.displacement is not None:
        facts["displacement_mm"] = list(touch.displacement)
    return facts


def to_equilibrium(system: System, record: StepRecord) -> Equilibrium:
    """Return the equilibrium that a record was made of, as a start for the solver."""
    loads = np.array([record.loads[name] for name in system.loading.names])
    grips = tuple(np.array(rows).reshape(-1, WIDTH) for rows in record.solver["contact_grips"])
    bodies = np.array(record.solver.get("bodies_mm", [])).reshape(-1, system.mesh.dimension)
    u = np.vstack([record.displacement, bodies])
    penalty, margin = record.solver["contact_penalty"], record.solver.get("contact_margin", 0.0)
    state = system.consistent(u, loads, penalty, grips, margin)
    stable = record.solver["stable"]
    # The number of negative pivots is not stored; the solver only asks whether there are any.
    pivots = None if stable is None else int(not stable)
    fraction = record.solver.get("load_fraction", record.fraction)
    return Equilibrium(state, fraction, (record.solver["residual"],), 0, pivots)
