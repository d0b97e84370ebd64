"""Statistics of experiments: estimates, significance, tables, and data for figures."""

from runtime.experiments.analysis.comparison import (
    ComparisonLine,
    compare,
    comparison_rows,
    comparison_table,
    legend,
)
from runtime.experiments.analysis.groups import Tally, TrialGroup, gather, is_same
from runtime.experiments.analysis.statistics import (
    ANY,
    CONFIDENCE,
    CORRECTION,
    LEVEL,
    TESTS,
    Estimate,
    PairedDifference,
    Test,
    benjamini_hochberg,
    difference,
    estimate,
    is_significant,
    number_or_none,
)
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep
from runtime.experiments.analysis.words import (
    NEVER,
    SAME,
    SAME_RUNS,
    interval,
    mean_of,
    too_few,
)

__all__ = [
    "ANY",
    "CONFIDENCE",
    "CORRECTION",
    "LEVEL",
    "NEVER",
    "SAME",
    "SAME_RUNS",
    "TESTS",
    "ComparisonLine",
    "Estimate",
    "PairedDifference",
    "SweepData",
    "Tally",
    "Test",
    "TrialGroup",
    "benjamini_hochberg",
    "compare",
    "comparison_rows",
    "comparison_table",
    "difference",
    "estimate",
    "gather",
    "interval",
    "is_same",
    "is_significant",
    "legend",
    "mean_of",
    "number_or_none",
    "read_sweep",
    "too_few",
]
