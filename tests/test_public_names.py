"""The public names exist, are documented, and cost nothing until they are used."""

from __future__ import annotations

import subprocess
import sys

import pytest

import turgor

HEAVY = ("numba", "gmsh", "vtkmodules", "vtk", "pyvista", "matplotlib", "plotly", "scipy", "numpy", "pint", "meshio")


@pytest.mark.parametrize("name", turgor.__all__)
def test_a_public_name_exists_and_is_documented(name: str) -> None:
    found = getattr(turgor, name)
    assert len((found.__doc__ or "").strip()) > 20, f"{name} has no docstring"
    assert found.__doc__ != getattr(found.__mro__[1], "__doc__", None) if isinstance(found, type) else True


@pytest.mark.parametrize("name", turgor.__all__)
def test_methods_of_a_public_class_are_documented(name: str) -> None:
    found = getattr(turgor, name)
    for key, member in vars(found).items() if isinstance(found, type) else ():
        if not key.startswith("_") and (callable(member) or isinstance(member, property)):
            assert (member.__doc__ or "").strip(), f"{name}.{key} has no docstring"


def test_the_list_of_names_is_the_one_that_resolves() -> None:
    assert sorted(turgor.__all__) == sorted(name for names in turgor._HOMES.values() for name in names)
    assert set(turgor._RENAMED) <= set(turgor.__all__)
    assert set(turgor.__all__) <= set(dir(turgor))


def test_an_unknown_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Inflate'"):
        _ = turgor.Inflate


def in_a_new_process(code: str) -> str:
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=120)
    assert result.stderr == ""
    return result.stdout


def test_every_name_survives_a_star_import() -> None:
    assert in_a_new_process("from turgor import *; print(PneuNet.__name__)") == "PneuNet\n"


def test_import_loads_nothing_heavy_and_prints_nothing() -> None:
    code = f"import sys, turgor; print([name for name in {HEAVY!r} if name in sys.modules])"
    assert in_a_new_process(code) == "[]\n"


def test_the_command_loads_nothing_heavy_for_its_help() -> None:
    code = f"import sys, turgor.cli.app; print([name for name in {HEAVY!r} if name in sys.modules])"
    assert in_a_new_process(code) == "[]\n"


def test_import_is_quick() -> None:
    # Processor time, not the clock: a busy machine does not change it.
    code = (
        "import resource, turgor; used = resource.getrusage(resource.RUSAGE_SELF); print(used.ru_utime + used.ru_stime)"
    )
    assert min(float(in_a_new_process(code)) for _ in range(3)) < 0.5
