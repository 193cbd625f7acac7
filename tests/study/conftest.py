"""A tube small enough to be solved in a second."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest


@pytest.fixture
def small_tube(tmp_path: Path) -> Path:
    """The case file of the small tube, in a folder of its own."""
    folder = tmp_path / "case"
    folder.mkdir()
    path = folder / "small.yaml"
    shutil.copyfile(Path(__file__).with_name("small.yaml"), path)
    return path
