"""Experiments over graphs: parameter sweeps and ablations, in parallel and resumable."""

from runtime.experiments.ablation import AblationResult, ablate
from runtime.experiments.sweeping import SweepOptions, SweepResult, sweep

__all__ = ["AblationResult", "SweepOptions", "SweepResult", "ablate", "sweep"]
