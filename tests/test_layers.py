"""The rooms of the package import only downward, at the top of a file, and never in a circle."""

from __future__ import annotations

import ast
import graphlib
from pathlib import Path

import pytest

import turgor

PACKAGE = Path(turgor.__file__).parent
ROOMS = ("common", "materials", "geometry", "mesh", "fem", "solver", "results", "study", "app", "cli")
FORBIDDEN = {("results", "solver")}  # a stored run is measured and drawn without the solver
ROOT_USERS = {"cli"}  # the commands stand on the public names; nobody else may look back at them
LAZY_ROOT = "turgor"  # turgor/__init__.py resolves its public names on first access


def module_name(file: Path, package: Path) -> str:
    parts = [package.name, *file.relative_to(package).with_suffix("").parts]
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def room_of(module: str) -> str:
    parts = module.split(".")
    return parts[1] if len(parts) > 1 else ""


def imported_modules(node: ast.AST, module: str, is_package: bool, known: set[str]) -> list[str]:
    """Return the modules of ours that one statement imports, by their absolute names."""
    if isinstance(node, ast.Import):
        names = [alias.name for alias in node.names]
    elif isinstance(node, ast.ImportFrom):
        base = node.module or ""
        if node.level:
            parts = module.split(".")
            parents = parts[: len(parts) - node.level + is_package]
            base = ".".join([*parents, base] if base else parents)
        submodules = [f"{base}.{alias.name}" for alias in node.names]
        names = [name if name in known else base for name in submodules]
    elif isinstance(node, ast.Call) and ast.unparse(node.func).split(".")[-1] in {"import_module", "__import__"}:
        first = node.args[0] if node.args else None
        names = [first.value] if isinstance(first, ast.Constant) and isinstance(first.value, str) else []
    else:
        return []
    return [name for name in names if name.split(".")[0] == "turgor"]


def violations(package: Path) -> list[str]:
    """List what breaks the order of the rooms in the package folder."""
    files = {module_name(file, package): file for file in sorted(package.rglob("*.py"))}
    known = set(files)
    found: list[str] = []
    graph: dict[str, set[str]] = {}
    for module, file in files.items():
        tree = ast.parse(file.read_text(encoding="utf-8"))
        is_package = file.name == "__init__.py"
        inside_functions = {
            id(node)
            for function in ast.walk(tree)
            if isinstance(function, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda))
            for node in ast.walk(function)
        }
        graph[module] = set()
        for node in ast.walk(tree):
            for target in imported_modules(node, module, is_package, known):
                place = f"{module}:{getattr(node, 'lineno', 0)} imports {target}"
                if id(node) in inside_functions or isinstance(node, ast.Call):
                    found.append(f"{place} inside a function")
                if module != LAZY_ROOT and target != module:
                    graph[module].add(target)
                fault = _fault(module, target)
                if fault:
                    found.append(f"{place}: {fault}")
    return found + _circles(graph)


def _fault(module: str, target: str) -> str | None:
    room, other = room_of(module), room_of(target)
    if room == other or module in {LAZY_ROOT, f"{LAZY_ROOT}.__main__"}:
        return None
    unknown = next((name for name in (room, other) if name and name not in ROOMS), None)
    if unknown:
        return f"'{unknown}' is not one of the rooms"
    if not other:
        return None if room in ROOT_USERS else "only the commands use the public names"
    if (room, other) in FORBIDDEN:
        return f"{room} never imports {other}"
    return None if ROOMS.index(other) < ROOMS.index(room) else f"{room} lies below {other}"


def _circles(graph: dict[str, set[str]]) -> list[str]:
    try:
        list(graphlib.TopologicalSorter(graph).static_order())
    except graphlib.CycleError as error:
        return ["a circle: " + " → ".join(error.args[1])]
    return []


def test_the_package_keeps_its_layers() -> None:
    assert violations(PACKAGE) == []


def test_every_folder_is_a_room() -> None:
    folders = {path.name for path in PACKAGE.iterdir() if path.is_dir() and any(path.glob("*.py"))}
    assert folders <= set(ROOMS)


PLANTED = {
    "upward": ("fem/a.py", "from turgor.solver import newton\n", "fem lies below solver"),
    "upward, relative": ("fem/a.py", "from ..solver import newton\n", "fem lies below solver"),
    "upward, of a room": ("common/a.py", "from turgor import mesh\n", "common lies below mesh"),
    "for types only": (
        "common/a.py",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import turgor.mesh\n",
        "common lies below mesh",
    ),
    "inside a function": (
        "solver/a.py",
        "def solve():\n    from turgor.common import units\n    return units\n",
        "inside a function",
    ),
    "by importlib": (
        "fem/a.py",
        "import importlib\nnewton = importlib.import_module('turgor.solver.newton')\n",
        "fem lies below solver",
    ),
    "the solver from the results": ("results/a.py", "import turgor.solver.newton\n", "results never imports solver"),
    "the public names from below": ("study/a.py", "import turgor as tg\n", "only the commands use the public names"),
    "an unknown room": ("utils/a.py", "import turgor.common.units\n", "'utils' is not one of the rooms"),
    "a circle": ("fem/a.py", "import turgor.fem.b\n", "a circle"),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_planted_violation_is_found(tmp_path: Path, name: str) -> None:
    package = tmp_path / "turgor"
    for room in (*ROOMS, "utils"):
        (package / room).mkdir(parents=True)
        (package / room / "__init__.py").write_text("", encoding="utf-8")
    (package / "__init__.py").write_text("", encoding="utf-8")
    (package / "solver" / "newton.py").write_text("import turgor.fem\n", encoding="utf-8")
    (package / "fem" / "b.py").write_text("from turgor.fem import a\n", encoding="utf-8")
    assert violations(package) == []
    file, code, message = PLANTED[name]
    (package / file).write_text(code, encoding="utf-8")
    assert any(message in found for found in violations(package)), violations(package)
