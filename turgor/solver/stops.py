"""Why a path ends before its target: what the last equilibrium shows, in words and in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from turgor.common.errors import SolverError
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.loads import Pressure
from turgor.fem.system import System
from turgor.materials.stability import drucker_margin, verdict
from turgor.solver.events import Outcome
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.volume import LimitPoint

Facts = dict[str, object]

DISTORTED = 0.3
"""Smallest det F at an integration point below which the mesh is to blame: in the continuum it stays near 1."""


class StoppedShortError(SolverError):
    """No equilibrium was found beyond the last one delivered; ``outcome`` says of which kind the reason is."""

    def __init__(
        self, reason: str, *, advice: str, facts: Facts | None = None, outcome: Outcome = Outcome.UNEXPLAINED
    ) -> None:
        super().__init__(reason, advice=advice, facts=facts)
        self.outcome = outcome


class LimitPressureError(StoppedShortError):
    """The load has a maximum on the way: beyond it there is no equilibrium, whatever the solver.

    ``limit`` is the state of the maximum, found by volume control, with the eigenmode in which the actuator gives way.
    """

    def __init__(self, reason: str, *, advice: str, facts: Facts, limit: LimitPoint) -> None:
        super().__init__(reason, advice=advice, facts=facts, outcome=Outcome.LIMIT)
        self.limit = limit


@dataclass(frozen=True)
class WorstPoint:
    """Where a material is least stable in a state: its region, the reference position of the point, what it does there.

    ``margin`` is Drucker's: 2 at rest, negative where stability is lost (:func:`turgor.materials.drucker_margin`).
    """

    region: str
    place: tuple[float, ...]
    stretches: tuple[float, ...]
    margin: float
    verdict: str


def stopped(system: System, here: Equilibrium, error: NotConvergedError) -> StoppedShortError:
    """Return the error for a path on which nothing was found beyond `here`, with the most likely reason."""
    facts = load_facts(system, here)
    outcome, cause, advice, details = _cause(system, here, error)
    return StoppedShortError(
        f"no equilibrium was found beyond {load_text(facts)} ({error.reason}); {cause}",
        advice=advice,
        facts=facts | error.facts | details,
        outcome=outcome,
    )


def at_limit(
    system: System, limit: LimitPoint, why_not_further: str = "", details: Facts | None = None
) -> StoppedShortError:
    """Return the error for a path that ends at a limit of its load."""
    facts = load_facts(system, limit.equilibrium)
    worst = int(np.argmax(np.linalg.norm(system.body_part(limit.mode), axis=1)))
    facts["mode_largest_at_mm"] = [round(float(x), 3) for x in system.mesh.points[worst]]
    # On the way down the pressures have a minimum, and what snaps back shrinks.
    falls = bool(np.sum(limit.equilibrium.state.loads * system.growth(limit.equilibrium.fraction)) < 0.0)
    beyond = "shrinks while the pressure rises" if falls else "grows while the pressure falls"
    advice = "Control by volume follows it further; a thicker wall, a stiffer or a stiffening material raises the limit"
    cause = ""
    if (point := worst_point(system, limit.equilibrium)).margin < 0.0:
        _, cause, advice, more = _material(point)
        facts |= more
    return LimitPressureError(
        f"the limit is reached at {load_text(facts)}: beyond it the actuator {beyond}{why_not_further}"
        + (f"; {cause}" if cause else ""),
        advice=advice,
        facts=facts | (details or {}),
        limit=limit,
    )


def load_facts(system: System, here: Equilibrium) -> Facts:
    """Return how far a path has come, in plain values: the load fraction and every load with its unit."""
    facts: Facts = {"last_fraction": here.fraction, "last_stable": here.stable}
    for load, name, value in zip(system.loads, system.load_names, here.state.loads, strict=True):
        pressure = isinstance(load, Pressure)
        facts[f"{name}_kPa" if pressure else name] = float(value) * (1e3 if pressure else 1.0)
    return facts


def load_text(facts: Facts) -> str:
    """Return the pressures among the facts of :func:`load_facts` in words."""
    pressures = [f"{value:.4g} kPa in {name[9:-4]}" for name, value in facts.items() if name.startswith("pressure:")]
    return ", ".join(pressures) or f"{facts['last_fraction']:.4g} of the load"


def worst_point(system: System, here: Equilibrium) -> WorstPoint:
    """Return the integration point whose material is least stable in a state, by the measure of the laboratory."""
    found: list[WorstPoint] = []
    for solid in system.solids:
        stretches = solid.isochoric_stretches(here.state.u)
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            margin = np.nan_to_num(drucker_margin(solid.material, stretches), nan=np.inf)
        cell, q = np.unravel_index(int(np.argmin(margin)), margin.shape)
        place = solid.cell.shape_at_quadrature[q] @ system.mesh.points[solid.nodes[cell]]
        region = next(name for name, cells in system.mesh.regions.items() if np.isin(solid.index[cell], cells))
        found.append(
            WorstPoint(
                region,
                tuple(round(float(x), 3) for x in place),
                tuple(sorted((round(float(x), 4) for x in stretches[cell, q]), reverse=True)),
                float(margin[cell, q]),
                str(verdict(solid.material)),
            )
        )
    return min(found, key=lambda point: point.margin)


def _cause(system: System, here: Equilibrium, error: NotConvergedError) -> tuple[Outcome, str, str, Facts]:
    """Return the class of a failure, the cause in words, what to try, and the facts that speak for it."""
    overlap = error.facts.get("overlap_per_wall")
    if isinstance(overlap, float) and overlap > LARGEST_OVERLAP:
        advice = "Try smaller steps (solver.largest_step), or a finer mesh where surfaces meet"
        return Outcome.CONTACT, "surfaces press into each other however stiff their contact is", advice, {}
    worst = worst_point(system, here)
    if worst.margin < 0.0:
        return _material(worst)
    smallest, cell = system.worst_jacobian(here.state.u)
    if smallest < DISTORTED:
        place = [round(float(x), 3) for x in system.mesh.points[system.mesh.cells[cell]].mean(axis=0)]
        cause = (
            f"element {cell} near ({', '.join(f'{x:g}' for x in place)}) mm is too distorted (det F = {smallest:.2g})"
        )
        facts: Facts = {"distorted_element": cell, "distorted_element_at_mm": place, "distorted_det_F": smallest}
        return Outcome.MESH, cause, "Try a finer mesh there (mesh.size, mesh.sizes), or a rounded corner", facts
    area = sum(touch.area for touch in system.touches(here.state))
    if area > 0.0:
        cause = f"surfaces touch over {area:.3g} mm², and the material and the elements are sound"
        advice = "Try smaller steps (solver.largest_step), or a finer mesh where surfaces meet"
        return Outcome.CONTACT, cause, advice, {"contact_area_mm2": area}
    cause = "the material and the elements are sound there"
    advice = "Try smaller steps (solver.smallest_step), a finer mesh, or control by volume (control.type: volume)"
    return Outcome.UNEXPLAINED, cause, advice, {"smallest_drucker_margin": worst.margin, "smallest_det_F": smallest}


def _material(worst: WorstPoint) -> tuple[Outcome, str, str, Facts]:
    stretches = ", ".join(f"{x:.3g}" for x in worst.stretches)
    cause = (
        f"the material of '{worst.region}' has lost its stability near ({', '.join(f'{x:g}' for x in worst.place)}) mm "
        f"at the principal stretches {stretches} (the laboratory finds it {worst.verdict})"
    )
    advice = "Take constants that are stable up to these stretches (turgor fit --stability require, turgor materials)"
    facts: Facts = {
        "unstable_region": worst.region,
        "unstable_at_mm": list(worst.place),
        "unstable_at_stretches": list(worst.stretches),
        "drucker_margin": worst.margin,
        "material_verdict": worst.verdict,
    }
    return Outcome.MATERIAL, cause, advice, facts
