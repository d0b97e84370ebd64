"""What an experiment varies: factors, seeds, variants; experiment files, and requests."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.experiments.design.checks import check_design, check_paths, own_value
    from runtime.experiments.design.entries import ENTRY_KEYS, Over, Sampler
    from runtime.experiments.design.experiment import (
        CHANGES,
        KEYS,
        PLAN_KEYS,
        VARIANT_KEYS,
        Experiment,
        check_experiment,
        read_experiment,
    )
    from runtime.experiments.design.factors import Factor, Range, parse_factor, value_label
    from runtime.experiments.design.figures import FigureSpec, shown_probe, with_signal
    from runtime.experiments.design.measurements import Measurement, parse_measurement
    from runtime.experiments.design.objective import Constraint, Objective
    from runtime.experiments.design.recognition import is_experiment
    from runtime.experiments.design.request import ON_COMMAND_LINE, Named, Request, SeedList
    from runtime.experiments.design.sampling import Design
    from runtime.experiments.design.search import RunSet, TuningSettings, tuning_of
    from runtime.experiments.design.seeds import Seeds, parse_seeds
    from runtime.experiments.design.variants import (
        BASELINE,
        GraphVariant,
        check_contrasts,
        check_variants,
        group_changes,
        removals,
        slugs,
    )
else:
    __getattr__ = door(__name__)
