"""runtime.experiments.design."""

from runtime.experiments.design.checks import check_design, check_knob, check_objective
from runtime.experiments.design.experiment import Experiment, read_experiment, slug
from runtime.experiments.design.factors import Factor, Range, parse_knob
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.sampling import Design
from runtime.experiments.design.seeds import Seeds, parse_seeds
from runtime.experiments.design.variants import (
    BASELINE,
    Variant,
    check_variants,
    each_alone,
    grouped,
    slugs,
)

__all__ = [
    "BASELINE",
    "Design",
    "Experiment",
    "Factor",
    "Objective",
    "Range",
    "Seeds",
    "Variant",
    "check_design",
    "check_knob",
    "check_objective",
    "check_variants",
    "each_alone",
    "grouped",
    "parse_knob",
    "parse_seeds",
    "read_experiment",
    "slug",
    "slugs",
]
