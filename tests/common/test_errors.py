"""Messages say where, what and what would be right; exit codes belong to them."""

from __future__ import annotations

import subprocess
import sys
from types import ModuleType

import pytest

from turgor.common import optional
from turgor.common.errors import EXIT_BAD_INPUT, EXIT_STOPPED_SHORT, InputError, MissingPackageError, SolverError
from turgor.common.log import logger


def test_the_message_names_file_key_value_and_cure() -> None:
    error = InputError("a unit is missing", file="a.yaml", key="mesh.size", value=3, expected="'3 mm'")
    assert str(error) == "a.yaml: mesh.size: a unit is missing (found 3); expected '3 mm'"
    assert error.exit_code == EXIT_BAD_INPUT


def test_a_place_is_added_but_never_replaced() -> None:
    error = InputError("wrong", key="wall").at(file="a.yaml", key="geometry")
    assert str(error) == "a.yaml: wall: wrong"
    assert str(error.at(file="b.yaml")) == str(error)


def test_a_long_value_is_shortened() -> None:
    assert len(str(InputError("wrong", value="x" * 1000))) < 120


def test_a_solver_error_carries_facts_and_advice() -> None:
    error = SolverError("stopped", advice="Refine", facts={"last_pressure_MPa": 0.03})
    assert str(error) == "stopped. Refine"
    assert error.facts == {"last_pressure_MPa": 0.03}
    assert error.exit_code == EXIT_STOPPED_SHORT


def test_an_absent_package_is_named() -> None:
    assert not optional.is_available("no_such_package")
    assert optional.is_available("json")
    with pytest.raises(MissingPackageError, match="drawing needs the package 'no_such_package': pip install"):
        optional.require("no_such_package", "drawing")
    assert isinstance(optional.require("json"), ModuleType)


@pytest.mark.parametrize("kind", [OSError, ImportError])
def test_an_absent_system_library_is_named_with_its_debian_package(
    monkeypatch: pytest.MonkeyPatch, kind: type[Exception]
) -> None:
    def broken(name: str) -> ModuleType:
        raise kind("libGLU.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.setattr(optional.importlib, "import_module", broken)
    with pytest.raises(MissingPackageError, match="apt-get install libglu1-mesa"):
        optional.require("gmsh")


def test_the_log_is_silent_unless_somebody_listens() -> None:
    code = "from turgor.common.log import logger; logger('x').error('nobody listens')"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout == result.stderr == ""
    assert logger("mesh").name == "turgor.mesh"
