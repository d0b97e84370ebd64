"""Experiments over graphs: sweeps, ablations and tunings, in parallel and resumable.

``sweep``, ``ablate`` and ``tune`` are those of Python; ``run_sweep``, ``run_ablation`` and
``run_tuning`` run a plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.lazy import importer

if TYPE_CHECKING:
    from runtime.experiments.ablation import AblationResult, run_ablation
    from runtime.experiments.from_python import ablate, sweep, tune
    from runtime.experiments.sweeping import SweepResult, run_sweep
    from runtime.experiments.tables import (
        AblationTable,
        SweepConfiguration,
        SweepTable,
        TrialRecord,
        TuningTable,
    )
    from runtime.experiments.tuning import TuningResult, run_tuning

# What an experiment file may say ('runtime.experiments.design') is read without what runs it.
_MODULES = {
    "ablation": ("AblationResult", "run_ablation"),
    "from_python": ("ablate", "sweep", "tune"),
    "sweeping": ("SweepResult", "run_sweep"),
    "tables": ("AblationTable", "SweepConfiguration", "SweepTable", "TrialRecord", "TuningTable"),
    "tuning": ("TuningResult", "run_tuning"),
}
__all__ = [
    "AblationResult",
    "AblationTable",
    "SweepConfiguration",
    "SweepResult",
    "SweepTable",
    "TrialRecord",
    "TuningResult",
    "TuningTable",
    "ablate",
    "run_ablation",
    "run_sweep",
    "run_tuning",
    "sweep",
    "tune",
]
__getattr__ = importer(
    __name__,
    {name: f"{__name__}.{module}" for module, names in _MODULES.items() for name in names},
)
