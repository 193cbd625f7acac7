"""Names that users give to parts and results, which become names of files and of sets in decks; names of loads."""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import AfterValidator

from turgor.common.errors import InputError

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def _checked(name: str) -> str:
    if not _NAME.fullmatch(name):
        error = InputError("this cannot be a name", value=name, expected="letters, digits, '-', '_' and '.'")
        raise ValueError(str(error)) from error
    return name


PRESSURE_PREFIX = "pressure:"
"""A load ``pressure:<cavity>`` is the pressure in that cavity in MPa; other loads are dimensionless factors."""

Name = Annotated[str, AfterValidator(_checked)]
"""A key or parameter of a case that names something new."""
