"""Names of regions from what the parts of a file are called."""

from __future__ import annotations

import re


def plain(label: str) -> str:
    """Turn the path of an assembly's part into a region's name."""
    name = re.sub(r"[^a-z0-9]+", "-", label.rsplit("/", 1)[-1].lower()).strip("-")
    # What CAD kernels write for a part that nobody named.
    return "body" if not name or re.fullmatch(r"open-cascade-step-translator.*|solid|shape|part", name) else name


def unique(names: list[str]) -> list[str]:
    """Number the names that occur more than once: ``body-1``, ``body-2``."""
    return [
        name if names.count(name) == 1 else f"{name}-{names[: number + 1].count(name)}"
        for number, name in enumerate(names)
    ]
