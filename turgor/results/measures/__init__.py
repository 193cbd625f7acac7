"""Measures: numbers and curves that describe a stored state, each one function of it.

A measure registers itself; by its name it can be asked for in a case file, and its keys, which end in their unit, are
columns of ``history.csv`` and entries of ``summary.json``.
"""

from turgor.results.measures import along, force, markers, motion, stress
from turgor.results.measures.registry import (
    MEASURES,
    Choice,
    Measure,
    available,
    check,
    check_kinds,
    evaluate,
    silent,
    tables,
)

__all__ = [
    "MEASURES",
    "Choice",
    "Measure",
    "along",
    "available",
    "check",
    "check_kinds",
    "evaluate",
    "force",
    "markers",
    "motion",
    "silent",
    "stress",
    "tables",
]
