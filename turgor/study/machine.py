"""What a run takes of the machine."""

from __future__ import annotations

import math
import sys

if sys.platform != "win32":
    import resource


def peak_memory_mb() -> float:
    """Return the largest resident memory of this process in MB; not a number where the system does not tell."""
    if sys.platform == "win32":
        return math.nan
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak / (2**20 if sys.platform == "darwin" else 2**10)
