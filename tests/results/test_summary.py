"""What a summary says of the special states of a run."""

from __future__ import annotations

from samples import sphere

from turgor.results.summary import summarise


def test_an_event_says_its_time_and_the_pressure_of_each_cavity():
    solver = {"iterations": 1, "factorisations": 1, "stable": True}
    pressures = {"pressure_kPa": 30.0, "pressure_cavity-1_kPa": 10.0, "pressure_cavity-2_kPa": 30.0}
    places = {"time_s": 1.5, **pressures, "cavity_volume_mm3": 7.0}
    row = {"step": 3, "fraction": 0.5, **places, "twist_deg": 2.0, **solver, "event": "limit-pressure"}
    summary = summarise(
        [row], sphere("tet10", 1).mesh, converged=False, reason="", dofs=1, wall_s=0.0, peak_memory_mb=1.0
    )
    assert summary["events"] == [{"event": "limit-pressure", "step": 3, **places, "stable": True}]
