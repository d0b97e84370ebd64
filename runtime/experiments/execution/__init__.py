"""Running trials: the plan, its folder and index, worker pools, and which runs are kept."""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.experiments.execution.checksums import check_entries, write_checked
    from runtime.experiments.execution.folder import (
        DIAGRAMS,
        PLAN,
        RUNS,
        SUMMARY,
        TABLE,
        read_plan,
        write_plan,
    )
    from runtime.experiments.execution.index import (
        Columns,
        Index,
        Row,
        read_rows,
    )
    from runtime.experiments.execution.options import RunOptions
    from runtime.experiments.execution.plan import (
        GRAPH,
        INDEX,
        SCHEMA_VERSION,
        VARIANT,
        VARIANTS,
        ExperimentPlan,
        Note,
        VariantBundle,
        ablation_plan,
        bundle_for,
        bundles_of,
        engine_for,
        metrics_of,
        sweep_plan,
    )
    from runtime.experiments.execution.retention import (
        TrialRetention,
        VariantRetention,
        read_series,
    )
    from runtime.experiments.execution.runner import run_trials
    from runtime.experiments.execution.study import Outcome, Study
    from runtime.experiments.execution.trials import Configuration, Trial
    from runtime.experiments.execution.worker import LOST, TRAJECTORY_PLOTS, Task, TrialResult
else:
    __getattr__ = door(__name__)
