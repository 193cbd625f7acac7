"""Why a path ends before its target: what the last equilibrium shows, in words and in numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from turgor.common.errors import SolverError
from turgor.common.names import PRESSURE_PREFIX
from turgor.fem.contact.term import LARGEST_OVERLAP
from turgor.fem.loads import Pressure
from turgor.fem.programme import PROPORTIONAL
from turgor.fem.surface import surface_stretches
from turgor.fem.system import System
from turgor.materials.stability import drucker_margin, verdict
from turgor.mesh.faces import boundary_faces
from turgor.solver.apiece import leading_in, taking_part
from turgor.solver.events import Outcome
from turgor.solver.newton import Equilibrium, NotConvergedError
from turgor.solver.slopes import knows_volume
from turgor.solver.volume import LimitPoint

Facts = dict[str, object]

BY_VOLUME = "by volume (control.type: volume)"
ALONG_THE_ARC = "along the path (control.type: arc-length), as the volume may turn back"

CREASED = 2.4
"""Stretch along the normal of a free surface, over the smallest one in it, beyond which rubber folds into creases.

In plane strain a compression to 0.65 (Hong, Zhao and Suo 2009; Hohlfeld and Mahadevan 2011); at 3.4, or 0.54, a flat
surface is unstable even against small waves (Biot 1963). A crease has no size of its own: no finer mesh gets past it.
"""

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


@dataclass(frozen=True)
class Fold:
    """Where the free surface is compressed most in a state: the reference position and the principal stretches.

    The smaller and the larger one in the surface, and the one along its normal.
    """

    place: tuple[float, ...]
    stretches: tuple[float, ...]

    @property
    def ratio(self) -> float:
        """The stretch along the normal over the smallest one in the surface."""
        return self.stretches[2] / self.stretches[0]


def stopped(
    system: System, here: Equilibrium, error: NotConvergedError, *, instead: str | None = BY_VOLUME
) -> StoppedShortError:
    """Return the error for a path on which nothing was found beyond `here`, with the most likely reason.

    `instead` is what else could be prescribed to get on.
    """
    facts = load_facts(system, here)
    outcome, cause, advice, details = _cause(system, here, error, instead)
    return StoppedShortError(
        f"no equilibrium was found beyond {load_text(facts)} ({error.reason}); {cause}",
        advice=advice,
        facts=facts | error.facts | details,
        outcome=outcome,
    )


def out_of_reach(system: System, here: Equilibrium, part: float, why: str) -> StoppedShortError:
    """Return the error for a path that is followed no further, though it goes on behind `here`.

    `part` is how much of the way from rest to the volume asked for it has come.
    """
    facts = load_facts(system, here)
    return StoppedShortError(
        f"the volume asked for is out of reach: at {load_text(facts)} {why}, with the volume {100.0 * part:.3g} % of "
        "the way to it",
        advice="Ask for a volume that the path reaches (control.target); along it the loads' values count as one, and "
        "with larger ones it is followed further",
        facts=facts | {"part_of_the_way": part},
        outcome=Outcome.OUT_OF_REACH,
    )


def at_limit(
    system: System, limit: LimitPoint, why_not_further: str = "", details: Facts | None = None
) -> StoppedShortError:
    """Return the error for a path that ends at a limit of its load."""
    facts = load_facts(system, limit.equilibrium)
    worst = int(np.argmax(np.linalg.norm(system.body_part(limit.mode), axis=1)))
    facts["mode_largest_at_mm"] = [round(float(x), 3) for x in system.mesh.points[worst]]
    beyond = _beyond(system, limit)
    advice = (
        "a thicker wall, a stiffer or a stiffening material raises the limit"
        if limit.maximum
        else "the state that it snaps back to is found with control.at_limit: post-snap"
    )
    if not why_not_further and _follows_volume(system, limit.equilibrium):
        advice = f"Control by volume follows it further; {advice}"
    advice = advice[0].upper() + advice[1:]
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


def _follows_volume(system: System, here: Equilibrium) -> bool:
    """Whether a volume could be prescribed in place of the pressures: those of a programme follow time instead."""
    pressures = [load for load in system.loading.loads if isinstance(load, Pressure)]
    # One in proportion to time is a programme, too, though its loads are the same.
    timed = any(load.programme is not PROPORTIONAL for load in pressures)
    return bool(pressures) and not (timed or system.rubs) and knows_volume(system, here.state)


def _beyond(system: System, limit: LimitPoint) -> str:
    """Say how the actuator goes on behind a limit: the conjugate of the load grows further while the load falls."""
    state, growth = limit.equilibrium.state, system.loading.growth(limit.equilibrium.fraction)
    leading = leading_in(system, state, limit.mode, growth)
    if not system.loading.names[leading].startswith(PRESSURE_PREFIX):
        return "gives way while the load falls"
    grows, sucked = bool(growth[leading] > 0.0), bool(state.loads[leading] < 0.0)
    load = ("suction" if sucked else "pressure") + _giving_way(system, limit, growth)
    return f"{'grows' if grows else 'shrinks'} while the {load} {'rises' if grows == sucked else 'falls'}"


def _giving_way(system: System, limit: LimitPoint, growth: NDArray[np.float64]) -> str:
    """Name the cavities that give way at a limit, where others do not."""
    part = taking_part(system, limit.equilibrium.state, limit.mode, growth)
    names = [cavity.name for cavity in system.cavities if part[cavity.channel] != 0.0]
    return f" in {', '.join(names)}" if len(names) < len(system.cavities) else ""


def load_facts(system: System, here: Equilibrium) -> Facts:
    """Return how far a path has come, in plain values: the load fraction and every load with its unit."""
    facts: Facts = {"last_fraction": here.fraction, "last_stable": here.stable}
    for name, value in zip(system.loading.names, here.state.loads, strict=True):
        pressure = name.startswith(PRESSURE_PREFIX)
        facts[f"{name}_kPa" if pressure else name] = float(value) * (1e3 if pressure else 1.0)
    return facts


def load_text(facts: Facts) -> str:
    """Return the pressures among the facts of :func:`load_facts` in words."""
    pressures = [
        f"{value:.4g} kPa in {name.removeprefix(PRESSURE_PREFIX).removesuffix('_kPa')}"
        for name, value in facts.items()
        if name.startswith(PRESSURE_PREFIX)
    ]
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


def deepest_fold(system: System, here: Equilibrium) -> Fold | None:
    """Return where the surface that nothing holds is nearest to a crease; ``None`` if all of it is held."""
    faces = boundary_faces(system.mesh.cells)
    held = np.asarray(system.constraints.fixed[: system.mesh.n_points].any(axis=1))
    faces = faces[~held[faces].all(axis=1)]
    if not len(faces):
        return None
    u = system.body_part(here.state.u)
    stretches, places = surface_stretches(system.mesh.points, u, faces, system.section)
    ratio = stretches[:, :, 2] / stretches[:, :, 0]
    worst = np.unravel_index(int(np.argmax(ratio)), ratio.shape)
    place = tuple(round(float(x), 3) for x in places[worst])
    return Fold(place, tuple(round(float(x), 4) for x in stretches[worst]))


def _cause(
    system: System, here: Equilibrium, error: NotConvergedError, instead: str | None
) -> tuple[Outcome, str, str, Facts]:
    """Return the class of a failure, the cause in words, what to try, and the facts that speak for it."""
    overlap = error.facts.get("overlap_per_wall")
    if isinstance(overlap, float) and overlap > LARGEST_OVERLAP:
        advice = "Try smaller steps (solver.largest_step), or a finer mesh where surfaces meet"
        return Outcome.CONTACT, "surfaces press into each other however stiff their contact is", advice, {}
    worst = worst_point(system, here)
    if worst.margin < 0.0:
        return _material(worst)
    fold = deepest_fold(system, here)
    if fold is not None and fold.ratio > CREASED:
        return _creased(fold)
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
    advice = "Try smaller steps (solver.largest_step, solver.smallest_step) or a finer mesh"
    if instead and _follows_volume(system, here):
        advice += f", or control {instead}"
    return Outcome.UNEXPLAINED, cause, advice, {"smallest_drucker_margin": worst.margin, "smallest_det_F": smallest}


def _creased(fold: Fold) -> tuple[Outcome, str, str, Facts]:
    cause = (
        f"the surface near ({', '.join(f'{x:g}' for x in fold.place)}) mm is compressed to {fold.stretches[0]:.2g} "
        "of its length, where rubber folds into creases"
    )
    advice = "Try a rounder corner or a thicker wall there; a finer mesh meets the crease too"
    facts: Facts = {
        "creased_at_mm": list(fold.place),
        "surface_stretches": list(fold.stretches),
        "normal_over_smallest_stretch": fold.ratio,
    }
    return Outcome.CREASE, cause, advice, facts


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
