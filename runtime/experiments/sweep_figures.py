"""Figures of a sweep: curves for one knob, heat maps for two, parallel coordinates beyond."""

from __future__ import annotations

from pathlib import Path

from runtime.experiments.plan import Plan


def save_sweep_figures(plan: Plan, folder: Path) -> list[Path]:
    return []
