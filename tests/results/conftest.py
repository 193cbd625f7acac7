"""Meshes and a finished run that several tests only read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from results.hollow_finger import finished_run, hollow_finger

from turgor.mesh.mesh import Mesh


@pytest.fixture(scope="session")
def finger() -> Mesh:
    return hollow_finger()


@pytest.fixture(scope="session")
def small_finger() -> Mesh:
    return hollow_finger((6, 3, 3))


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory, finger: Mesh) -> Path:
    """A finished run of five steps, only to be read."""
    return finished_run(tmp_path_factory.mktemp("run") / "finger", finger, np.linspace(0.2, 1.0, 5))
