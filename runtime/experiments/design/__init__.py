"""What an experiment varies: factors, seeds, variants, the objective, and experiment files."""

from runtime.experiments.design.additions import Additions
from runtime.experiments.design.checks import check_design, check_factor, check_objective
from runtime.experiments.design.experiment import (
    CHANGES,
    KEYS,
    PLAN_KEYS,
    VARIANT_KEYS,
    Experiment,
    check_experiment,
    is_experiment,
    read_experiment,
)
from runtime.experiments.design.factors import Factor, Range, parse_factor
from runtime.experiments.design.objective import Objective
from runtime.experiments.design.sampling import Design, Method
from runtime.experiments.design.seeds import Seeds, parse_seeds
from runtime.experiments.design.variants import (
    BASELINE,
    Variant,
    check_variants,
    grouped,
    removals,
    slugs,
)

__all__ = [
    "BASELINE",
    "CHANGES",
    "KEYS",
    "PLAN_KEYS",
    "VARIANT_KEYS",
    "Additions",
    "Design",
    "Experiment",
    "Factor",
    "Method",
    "Objective",
    "Range",
    "Seeds",
    "Variant",
    "check_design",
    "check_experiment",
    "check_factor",
    "check_objective",
    "check_variants",
    "grouped",
    "is_experiment",
    "parse_factor",
    "parse_seeds",
    "read_experiment",
    "removals",
    "slugs",
]
