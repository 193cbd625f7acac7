"""Optional packages in one register: one error that names what is missing and how to get it."""

from __future__ import annotations

import ctypes
import importlib
import importlib.metadata
import importlib.util
import sys
from types import ModuleType

from turgor.common.errors import MissingPackageError
from turgor.common.log import logger

log = logger("common")

OPTIONAL: dict[str, str] = {
    "vtk": "pictures of the deformed body",
    "pyvista": "pictures of the deformed body",
    "gmsh": "meshing",
    "ipctk": "contact by the barrier method, and the check that no surfaces intersect",
}
"""Package name and what needs it."""

DEBIAN_PACKAGES: dict[str, str] = {
    "libGLU.so.1": "libglu1-mesa",
    "libGL.so.1": "libgl1",
    "libEGL.so.1": "libegl1",
    "libX11.so.6": "libx11-6",
    "libXrender.so.1": "libxrender1",
    "libXcursor.so.1": "libxcursor1",
    "libXfixes.so.3": "libxfixes3",
    "libXext.so.6": "libxext6",
    "libXft.so.2": "libxft2",
    "libXinerama.so.1": "libxinerama1",
    "libfontconfig.so.1": "libfontconfig1",
    "libgomp.so.1": "libgomp1",
}
"""System libraries that gmsh and VTK load, and the Debian package of each."""


def is_available(name: str) -> bool:
    """Say whether the package `name` can be found, without importing it."""
    return importlib.util.find_spec(name) is not None


def require(name: str, purpose: str | None = None) -> ModuleType:
    """Import and return the package `name`.

    Raises
    ------
    MissingPackageError
        If the package is absent, or a system library that it loads is.
    """
    why = purpose or OPTIONAL.get(name, "this")
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        raise MissingPackageError(f"{why} needs the package '{name}': pip install {name}") from error
    except (ImportError, OSError) as error:
        raise MissingPackageError(f"{why} needs a system library: {library_advice(str(error))}") from error


def shared_library(package: str, *beginnings: str) -> ctypes.CDLL | None:
    """Load the library of a Python package whose file name begins in one of these ways; ``None`` where there is none.

    Loaded once, it is also found by others that ask the system for it by name.
    """
    try:
        files = importlib.metadata.files(package) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    for file in files:
        if file.name.startswith(beginnings) and not file.name.endswith((".lib", ".a")):
            try:
                return ctypes.CDLL(str(file.locate()))
            except OSError as error:
                log.warning("%s is installed but does not load: %s", package, error)
    return None


def missing_debian_packages() -> list[str]:
    """Return the Debian packages whose libraries gmsh and VTK need and this Linux system lacks; elsewhere none."""
    if sys.platform != "linux":
        return []
    missing = []
    for library, package in DEBIAN_PACKAGES.items():
        try:
            ctypes.CDLL(library)
        except OSError:
            missing.append(package)
    return missing


def library_advice(message: str) -> str:
    """Turn the loader's `message` into the name of the Debian package that is missing."""
    for library, package in DEBIAN_PACKAGES.items():
        if library in message:
            return f"{library} is missing; on Debian or Ubuntu: apt-get install {package}"
    return message
