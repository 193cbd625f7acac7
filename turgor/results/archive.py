"""Meshes and states as ``.npz`` archives (exact, no pickle) and as ParaView's ``.vtu``."""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, TypeVar

import meshio
import numpy as np
import numpy.typing as npt

from turgor.common.errors import InputError
from turgor.mesh.files import meshio_name
from turgor.mesh.mesh import Mesh, in_space
from turgor.results.files import replacing
from turgor.results.record import ARRAY_FIELDS, PLAIN_FIELDS, StepRecord

Row = dict[str, Any]
"""One row of ``history.csv``: column → number, truth value or ``None``."""

Curves = dict[str, list[Row]]
"""The curves of a state: title → rows."""

_Content = TypeVar("_Content")
_OF_REGION = "von_mises_by_region"
_NAMED = ("regions", "surfaces", "markers", "curves", "caps")


def save_mesh(path: Path, mesh: Mesh) -> None:
    """Write the mesh with all its names; unlike the exchange formats this keeps the order of the cells.

    The states of a run hold one pressure a cell, in that order.
    """
    named = {f"{kind}/{name}": array for kind in _NAMED for name, array in getattr(mesh, kind).items()}
    _save(path, {"points": mesh.points, "cells": mesh.cells, **named})


def load_mesh(path: Path) -> Mesh:
    """Read a mesh that :func:`save_mesh` wrote; raise InputError if the file is missing or damaged."""

    def build(archive: Mapping[str, npt.NDArray[Any]]) -> Mesh:
        named: dict[str, dict[str, npt.NDArray[Any]]] = {kind: {} for kind in _NAMED}
        for key in archive:
            kind, _, name = key.partition("/")
            if name:
                named[kind][name] = archive[key]
        return Mesh(archive["points"], archive["cells"], **named)

    return _load(path, build)


def save_record(path: Path, record: StepRecord, row: Row, curves: Curves) -> None:
    """Write a state exactly, together with its row of the history and its curves."""
    plain = {name: getattr(record, name) for name in PLAIN_FIELDS}
    plain |= {name: dict(value) for name, value in plain.items() if isinstance(value, Mapping)}
    arrays = {name: np.asarray(getattr(record, name), dtype=np.float64) for name in ARRAY_FIELDS}
    if record.mode is not None:
        arrays["mode"] = np.asarray(record.mode, dtype=np.float64)
    for region, values in record.von_mises_by_region.items():
        arrays[f"{_OF_REGION}/{region}"] = np.asarray(values, dtype=np.float64)
    _save(path, {**arrays, "plain": _as_json(plain), "row": _as_json(row), "curves": _as_json(curves)})


def load_record(path: Path) -> StepRecord:
    """Read a state; raise InputError if the file is missing or damaged."""

    def build(archive: Mapping[str, npt.NDArray[Any]]) -> StepRecord:
        arrays: dict[str, Any] = {name: archive[name] for name in ARRAY_FIELDS}
        arrays["mode"] = archive.get("mode")
        prefix = f"{_OF_REGION}/"
        arrays[_OF_REGION] = {key.removeprefix(prefix): archive[key] for key in archive if key.startswith(prefix)}
        return StepRecord(**_from_json(archive["plain"]), **arrays)

    return _load(path, build)


def load_row(path: Path) -> Row:
    """Read only the state's row of the history; raise InputError if the file is missing or damaged."""
    return _load(path, lambda archive: _from_json(archive["row"]))


def load_curves(path: Path) -> Curves:
    """Read only the state's curves; raise InputError if the file is missing or damaged."""
    return _load(path, lambda archive: _from_json(archive["curves"]))


def save_vtu(path: Path, mesh: Mesh, record: StepRecord) -> None:
    """Write a state for ParaView: curved cells, displacement, von Mises stress, mean pressure, region number.

    A plane section lies in the plane z = 0.
    """
    region = np.zeros(mesh.n_cells, dtype=np.int32)
    for number, cells in enumerate(mesh.regions.values()):
        region[cells] = number
    grid = meshio.Mesh(
        in_space(mesh.points),
        [(meshio_name(mesh.cells), mesh.cells)],
        point_data={
            "displacement_mm": np.asarray(in_space(record.displacement), dtype=np.float32),
            "von_mises_MPa": np.asarray(record.von_mises, dtype=np.float32),
            **({} if record.mode is None else {"mode": np.asarray(in_space(record.mode), dtype=np.float32)}),
        },
        cell_data={
            "mean_pressure_MPa": [np.asarray(record.element_pressure, dtype=np.float32)],
            "volume_ratio": [np.asarray(record.element_dilatation, dtype=np.float32)],
            "region": [region],
        },
    )
    with replacing(path) as partial:
        meshio.write(partial, grid, file_format="vtu", binary=True, compression="zlib")


def _save(path: Path, arrays: Mapping[str, Any]) -> None:
    with replacing(path) as partial, partial.open("wb") as stream:
        np.savez_compressed(stream, **arrays)


def _load(path: Path, build: Callable[[Mapping[str, npt.NDArray[Any]]], _Content]) -> _Content:
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            return build(archive)
    except FileNotFoundError as error:
        raise InputError("the file is missing from the run's folder", file=path) from error
    except InputError as error:
        raise error.at(file=path) from error
    except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"the file is damaged: {error}", file=path, expected="a file this version wrote") from error


def _as_json(content: dict[str, Any]) -> npt.NDArray[Any]:
    return np.array(json.dumps(content, default=_plain_number))


def _from_json(text: npt.NDArray[Any]) -> dict[str, Any]:
    content = json.loads(str(text))
    if not isinstance(content, dict):
        raise ValueError("a mapping was expected")
    return content


def _plain_number(value: object) -> object:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be stored")
