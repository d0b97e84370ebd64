"""runtime.experiments.analysis."""

from runtime.experiments.analysis.comparison import LEVEL, Line, compare, legend, table
from runtime.experiments.analysis.groups import Group, Tally, gather
from runtime.experiments.analysis.statistics import (
    CONFIDENCE,
    CORRECTION,
    TESTS,
    Estimate,
    Test,
    estimate,
)
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep

__all__ = [
    "CONFIDENCE",
    "CORRECTION",
    "LEVEL",
    "TESTS",
    "Estimate",
    "Group",
    "Line",
    "SweepData",
    "Tally",
    "Test",
    "compare",
    "estimate",
    "gather",
    "legend",
    "read_sweep",
    "table",
]
