"""The fit of a material as one document: what ``turgor fit --json`` prints, with the curves that a report draws."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from turgor.common.writing import writing
from turgor.materials.fit_result import FitReport
from turgor.materials.least_squares import predict
from turgor.results.files import check_targets
from turgor.results.fit_report import FILE_NAME, material_yaml, write_fit_page

_POINTS = 200
"""Points of a drawn curve; a test with more points than that is thinned out for the drawing only."""


def fit_document(report: FitReport) -> dict[str, Any]:
    """Return the fit in plain values, with ``data.strain``, ``data.stress_MPa`` and a ``curve`` for each model.

    Drawn is the first test that is not volumetric; the curves are the models' answers to its kind of deformation.
    """
    document: dict[str, Any] = report.as_dict()
    test = next((test for test in report.tests if test.mode != "volumetric"), None)
    if test is None:
        return document
    order = np.argsort(test.deformation, kind="stable")
    shown = order[np.unique(np.linspace(0, len(order) - 1, _POINTS).astype(int))]
    document["data"] |= {"strain": test.deformation[shown].tolist(), "stress_MPa": test.stress[shown].tolist()}
    strain = np.linspace(min(0.0, float(test.deformation.min())), float(test.deformation.max()), _POINTS)
    drawn = replace(test, stretch=strain if test.mode == "simple-shear" else 1.0 + strain, stress=np.zeros(_POINTS))
    for entry, found in zip(document["fits"], report.fits, strict=True):
        if found.material is not None:
            entry["curve"] = {"strain": strain.tolist(), "stress_MPa": predict(found.material, drawn).tolist()}
    return document


def write_material(report: FitReport, path: str | Path) -> None:
    """Write the recommended material as the YAML that a case file takes under ``materials``.

    Raises
    ------
    InputError
        If the file cannot be written or holds one of the tests.
    """
    check_targets([path], _files(report))
    text = material_yaml(report)
    with writing(path, "the material cannot be written"):
        Path(path).write_text(text, encoding="utf-8")


def write_fit_report(report: FitReport, folder: str | Path) -> Path:
    """Write the fit as ``fit.json`` and as the page ``fit.html``; return the path of the latter.

    Raises
    ------
    InputError
        If the folder cannot be written, or a test lies where a file is to be written.
    """
    check_targets(fit_report_files(folder), _files(report), makes_folder=True)
    document = fit_document(report)
    place = Path(folder)
    with writing(place, "the report cannot be written"):
        place.mkdir(parents=True, exist_ok=True)
        data, page = fit_report_files(place)
        data.write_text(json.dumps(document, indent=2, ensure_ascii=False) + "\n", encoding="utf-8")
        return write_fit_page(report, page)


def fit_report_files(folder: str | Path) -> tuple[Path, Path]:
    """Return the files of the report of a fit in a folder: ``fit.json`` and the page ``fit.html``."""
    return Path(folder) / "fit.json", Path(folder) / FILE_NAME


def _files(report: FitReport) -> list[str]:
    return [test.file for test in report.tests if test.file]
