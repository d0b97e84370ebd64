"""The figure of an ablation."""

from pathlib import Path
from runtime.experiments.ablation import Ablated


def save_ablation_figure(done: Ablated) -> Path:
    return done.folder / "plan.yaml"
