"""Experiments over graphs: sweeps of knobs and ablations of blocks, in parallel and resumable."""

from runtime.experiments.ablation import AblationResult, ablate
from runtime.experiments.sweep import SweepResult, Way, sweep

__all__ = ["AblationResult", "SweepResult", "Way", "ablate", "sweep"]
