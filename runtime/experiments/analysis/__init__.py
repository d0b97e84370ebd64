"""Statistics of experiments: estimates, significance, tables, and data for figures."""

from runtime.experiments.analysis.comparison import (
    ComparisonLine,
    compare,
    comparison_rows,
    comparison_table,
    legend,
    verdict,
)
from runtime.experiments.analysis.groups import Group, Tally, gather
from runtime.experiments.analysis.statistics import (
    CONFIDENCE,
    CORRECTION,
    LEVEL,
    TESTS,
    Estimate,
    Test,
    estimate,
    interval,
    is_significant,
)
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep

__all__ = [
    "CONFIDENCE",
    "CORRECTION",
    "LEVEL",
    "TESTS",
    "ComparisonLine",
    "Estimate",
    "Group",
    "SweepData",
    "Tally",
    "Test",
    "compare",
    "comparison_rows",
    "comparison_table",
    "estimate",
    "gather",
    "interval",
    "is_significant",
    "legend",
    "read_sweep",
    "verdict",
]
