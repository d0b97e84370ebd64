"""Experiments over graphs: parameter sweeps and ablations, in parallel and resumable.

``sweep`` and ``ablate`` are those of Python, ``run_sweep`` and ``run_ablation`` run a plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from runtime.lazy import importer

if TYPE_CHECKING:
    from runtime.experiments.ablation import AblationResult, run_ablation
    from runtime.experiments.from_python import ablate, sweep
    from runtime.experiments.sweeping import SweepOptions, SweepResult, run_sweep
    from runtime.experiments.tables import (
        AblationTable,
        SweepConfiguration,
        SweepTable,
        TrialRecord,
    )
    from runtime.experiments.tuning import (
        TuningRequest,
        TuningResult,
        run_tuning,
        tuning_request,
    )
    from runtime.experiments.tuning_table import TuningTable, tune

__all__ = [
    "AblationResult",
    "AblationTable",
    "SweepConfiguration",
    "SweepOptions",
    "SweepResult",
    "SweepTable",
    "TrialRecord",
    "TuningRequest",
    "TuningResult",
    "TuningTable",
    "ablate",
    "run_ablation",
    "run_sweep",
    "run_tuning",
    "sweep",
    "tune",
    "tuning_request",
]

# What an experiment file may say ('runtime.experiments.design') is read without what runs it.
__getattr__ = importer(
    __name__,
    {
        name: f"{__name__}.{module}"
        for module, names in {
            "ablation": ("AblationResult", "run_ablation"),
            "from_python": ("ablate", "sweep"),
            "sweeping": ("SweepOptions", "SweepResult", "run_sweep"),
            "tables": ("AblationTable", "SweepConfiguration", "SweepTable", "TrialRecord"),
            "tuning": ("TuningRequest", "TuningResult", "run_tuning", "tuning_request"),
            "tuning_table": ("TuningTable", "tune"),
        }.items()
        for name in names
    },
)
