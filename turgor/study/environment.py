"""What Turgor stands on here: versions, threads, the linear solver, and what is missing."""

from __future__ import annotations

import importlib.metadata
import os
import platform
from typing import Any

import numba

from turgor.common.errors import MissingPackageError
from turgor.common.optional import OPTIONAL, missing_debian_packages, require
from turgor.results.summary import versions
from turgor.solver.linear import solver_in_use

_SHOWN = ("pydantic", "pint", "PyYAML", "typer", "rich", "plotly", "matplotlib", "pyvista", "vtk")


def environment() -> dict[str, Any]:
    """Return what this machine offers, in plain values.

    Returns
    -------
    dict
        ``versions`` of Turgor, Python and the packages; ``platform``; ``threads`` (cores of the machine, threads that
        the element kernels use); ``linear_solver``; ``missing``, a list of sentences that name what is absent and
        how to get it, empty where nothing is; ``debian_packages``, those of them that are packages of Debian.
    """
    missing = []
    for package in OPTIONAL:
        try:
            require(package)
        except MissingPackageError as error:
            missing.append(str(error))
    packages = missing_debian_packages()
    if packages:
        missing.append(f"system libraries are missing; on Debian or Ubuntu: apt-get install {' '.join(packages)}")
    return {
        "versions": versions() | _versions(_SHOWN),
        "platform": platform.platform(),
        "threads": {"cores": os.cpu_count(), "kernels": numba.get_num_threads()},
        "linear_solver": solver_in_use().name,
        "missing": missing,
        "debian_packages": packages,
    }


def _versions(packages: tuple[str, ...]) -> dict[str, str]:
    found = {}
    for package in packages:
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            found[package] = "absent"
    return found
