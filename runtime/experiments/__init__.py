"""Experiments over graphs: parameter sweeps and ablations, in parallel and resumable.

``sweep`` and ``ablate`` are those of Python, ``run_sweep`` and ``run_ablation`` run a plan.
"""

from runtime.experiments.ablation import AblationResult, run_ablation
from runtime.experiments.from_python import ablate, sweep
from runtime.experiments.sweeping import SweepOptions, SweepResult, run_sweep
from runtime.experiments.tables import AblationTable, SweepConfiguration, SweepTable, TrialRecord

__all__ = [
    "AblationResult",
    "AblationTable",
    "SweepConfiguration",
    "SweepOptions",
    "SweepResult",
    "SweepTable",
    "TrialRecord",
    "ablate",
    "run_ablation",
    "run_sweep",
    "sweep",
]
