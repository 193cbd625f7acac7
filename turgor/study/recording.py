"""From an equilibrium of the solver to the record that is stored, and back for a run that goes on."""

from __future__ import annotations

from turgor.fem.fields import von_mises
from turgor.fem.state import State
from turgor.fem.system import System
from turgor.results.record import StepRecord
from turgor.solver.newton import Equilibrium


def record_of(system: System, equilibrium: Equilibrium, index: int, wall_s: float) -> StepRecord:
    """Return the record of an equilibrium: its state, the stress fields and how it was found."""
    state = equilibrium.state
    stress = von_mises(system, state)
    return StepRecord(
        index=index,
        fraction=equilibrium.fraction,
        loads=dict(zip(system.load_names, map(float, state.loads), strict=True)),
        displacement=state.u,
        element_pressure=system.element_pressure(state),
        element_dilatation=state.dilatation,
        von_mises=stress.nodal,
        von_mises_max=stress.largest,
        von_mises_p99=stress.percentile_99,
        cavity_volumes={cavity.name: cavity.volume(state.u) for cavity in system.cavities},
        solver={
            "iterations": equilibrium.iterations,
            "factorisations": equilibrium.factorisations,
            "stable": equilibrium.stable,
            "residual": equilibrium.residuals[-1],
            "wall_s": wall_s,
        },
    )


def equilibrium_of(system: System, record: StepRecord) -> Equilibrium:
    """Return the equilibrium that a stored record holds, to go on from."""
    state = State(record.displacement, record.element_dilatation, system.loads_at(record.fraction))
    stable = record.solver["stable"]
    return Equilibrium(
        state, record.fraction, (float(record.solver["residual"]),), 0, None if stable is None else int(not stable)
    )
