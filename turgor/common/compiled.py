"""Where numba keeps the compiled kernels: apart for each state of their sources.

Numba takes up a kept kernel as long as the file that holds it has not changed. Kernels call functions of other files:
old code of these would stay in them, and wrong numbers with it.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import time
from pathlib import Path

VARIABLE = "NUMBA_CACHE_DIR"
UNUSED_S = 86_400.0
"""Kernels of other sources are thrown away when they are older than a day: until then a run may be using them."""


def keep_kernels_by_source(package: Path) -> None:
    """Let numba keep the kernels of a package under a name that follows from their sources.

    Without effect where the user has chosen a place, and where the package cannot be written to: numba then
    finds a place itself.
    """
    if VARIABLE in os.environ or not os.access(package, os.W_OK):
        return
    place = kernels_of(package)
    if not place.exists():
        for other in place.parent.glob("kernels-*"):
            if time.time() - other.stat().st_mtime > UNUSED_S:
                shutil.rmtree(other, ignore_errors=True)
        place.mkdir(parents=True, exist_ok=True)
    os.environ[VARIABLE] = str(place)


def kernels_are_kept(room: str) -> bool:
    """Whether kernels of a package's folder of that name were compiled before, as far as that can be told."""
    place = os.environ.get(VARIABLE)
    return place is None or any(Path(place).glob(f"{room}_*/*.nbi"))


def kernels_of(package: Path) -> Path:
    """Return the folder for the kernels of a package's sources as they are."""
    digest = hashlib.sha1(usedforsecurity=False)
    for file in sorted(package.rglob("*.py")):
        source = file.read_bytes()
        if b"import numba" in source or b"fem.kernels import" in source:
            digest.update(str(file.relative_to(package)).encode() + source)
    return package / "__pycache__" / f"kernels-{digest.hexdigest()[:16]}"
