"""Runs of a benchmark's script in processes of their own, so that none finds what another left in memory."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any


def answer(script: str, *arguments: object) -> dict[str, Any]:
    """Return the JSON that a script called with ``--worker`` and these arguments prints last."""
    command = [sys.executable, script, "--worker", *map(str, arguments)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))
