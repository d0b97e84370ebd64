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
    Difference,
    Estimate,
    Test,
    adjusted,
    difference,
    estimate,
    interval,
    is_significant,
    number_or_none,
)
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep

__all__ = [
    "CONFIDENCE",
    "CORRECTION",
    "LEVEL",
    "TESTS",
    "ComparisonLine",
    "Difference",
    "Estimate",
    "Group",
    "SweepData",
    "Tally",
    "Test",
    "adjusted",
    "compare",
    "comparison_rows",
    "comparison_table",
    "difference",
    "estimate",
    "gather",
    "interval",
    "is_significant",
    "legend",
    "number_or_none",
    "read_sweep",
    "verdict",
]
