"""Statistics of experiments: estimates, significance, tables, and data for figures."""

from runtime.experiments.analysis.comparison import (
    MEAN,
    PER,
    ComparisonLine,
    Questions,
    Sample,
    compare,
    correct,
)
from runtime.experiments.analysis.comparison_table import (
    NARROW,
    WIDE,
    comparison_table,
    legend,
)
from runtime.experiments.analysis.crossed import Contestant
from runtime.experiments.analysis.estimates import (
    ANY,
    CONFIDENCE,
    LEVEL,
    Estimate,
    Margin,
    PairedDifference,
    is_significant,
    number_or_nan,
    number_or_none,
)
from runtime.experiments.analysis.groups import (
    Tally,
    TrialGroup,
    failed_value,
    gather,
    has_failed,
    is_same,
    sample_of,
)
from runtime.experiments.analysis.samples import samples_of
from runtime.experiments.analysis.statistics import (
    CORRECTION,
    TESTS,
    Test,
    benjamini_hochberg,
    difference,
    estimate,
)
from runtime.experiments.analysis.sweep_data import SweepData, read_sweep
from runtime.experiments.analysis.words import (
    EQUAL,
    NEGLIGIBLE,
    NEVER,
    SAME,
    SAME_RUNS,
    THESE,
    TOO_FEW,
    UNRANKED,
    apart,
    chosen_among,
    interval,
    lost,
    mean_of,
    p_cell,
    too_few,
)
