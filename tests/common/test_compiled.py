"""Kept kernels are those of the sources as they are."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import turgor
from turgor.common.compiled import UNUSED_S, VARIABLE, keep_kernels_by_source, kernels_are_kept, kernels_of
from turgor.fem.contact.partners import balls


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.delenv(VARIABLE, raising=False)
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "kernel.py").write_text("import numba as nb\n")
    (tmp_path / "plain.py").write_text("import numpy\n")
    return tmp_path


def test_a_change_of_any_kernel_source_begins_anew_and_of_others_does_not(package: Path) -> None:
    keep_kernels_by_source(package)
    first = os.environ.pop(VARIABLE)
    assert Path(first).is_dir()
    (package / "plain.py").write_text("import numpy as np\n")
    assert kernels_of(package) == Path(first)
    (package / "inner" / "kernel.py").write_text("import numba as nb  # changed\n")
    os.utime(first, (0, os.stat(first).st_mtime - 2 * UNUSED_S))
    keep_kernels_by_source(package)
    assert os.environ[VARIABLE] != first
    assert not Path(first).exists()


def test_the_users_place_is_kept(package: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(VARIABLE, "/elsewhere")
    keep_kernels_by_source(package)
    assert os.environ[VARIABLE] == "/elsewhere"
    assert not list(package.rglob("kernels-*"))


def test_whether_kernels_were_compiled_before_is_told_by_what_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, str(tmp_path))
    assert not kernels_are_kept("fem")
    (tmp_path / "fem_0123").mkdir()
    assert not kernels_are_kept("fem")
    (tmp_path / "fem_0123" / "kernels.deformation-120.py311.nbi").touch()
    assert kernels_are_kept("fem")
    assert not kernels_are_kept("contact")


def test_numba_keeps_kernels_where_they_are_looked_for() -> None:
    corner = np.vstack([np.eye(3), 0.5 * (np.eye(3) + np.roll(np.eye(3), 1, axis=1))])
    balls(corner, np.arange(6, dtype=np.int32)[None])
    assert kernels_are_kept("contact")


def test_turgor_itself_has_such_a_place() -> None:
    assert Path(os.environ[VARIABLE]) == kernels_of(Path(turgor.__file__).parent)
