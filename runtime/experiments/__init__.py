"""Experiments over graphs: parameter sweeps and ablations, in parallel and resumable.

``sweep`` and ``ablate`` are those of Python, ``run_sweep`` and ``run_ablation`` run a plan.
"""

from runtime.experiments.ablation import AblationResult, run_ablation
from runtime.experiments.from_python import ablate, sweep
from runtime.experiments.sweeping import SweepOptions, SweepResult, run_sweep
from runtime.experiments.tables import AblationTable, SweepConfiguration, SweepTable, TrialRecord
from runtime.experiments.tuning import TuningRequest, TuningResult, run_tuning, tuning_request
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
