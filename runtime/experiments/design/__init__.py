"""What an experiment varies: factors, seeds, variants, the objective, and experiment files."""

from runtime.experiments.design.additions import Additions
from runtime.experiments.design.checks import (
    check_design,
    check_factor,
    check_objective,
    own_value,
)
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
from runtime.experiments.design.tuning import (
    OVER,
    SAMPLERS,
    Constraint,
    Over,
    RunSet,
    Sampler,
    Tuning,
    TuningEntries,
    complete,
    parse_constraint,
)
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
    "OVER",
    "PLAN_KEYS",
    "SAMPLERS",
    "VARIANT_KEYS",
    "Additions",
    "Constraint",
    "Design",
    "Experiment",
    "Factor",
    "Method",
    "Objective",
    "Over",
    "Range",
    "RunSet",
    "Sampler",
    "Seeds",
    "Tuning",
    "TuningEntries",
    "Variant",
    "check_design",
    "check_experiment",
    "check_factor",
    "check_objective",
    "check_variants",
    "complete",
    "grouped",
    "is_experiment",
    "own_value",
    "parse_constraint",
    "parse_factor",
    "parse_seeds",
    "read_experiment",
    "removals",
    "slugs",
]
