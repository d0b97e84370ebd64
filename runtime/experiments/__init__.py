"""Experiments over graphs: sweeps, ablations and tunings, in parallel and resumable.

``sweep``, ``ablate`` and ``tune`` are those of Python; ``run_sweep``, ``run_ablation`` and
``run_tuning`` run a plan.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from blocks.library.lazy import door

if TYPE_CHECKING:
    from runtime.experiments.ablation import AblationTable, run_ablation
    from runtime.experiments.from_python import ablate, sweep, tune
    from runtime.experiments.sweeping import SweepConfiguration, SweepTable, run_sweep
    from runtime.experiments.tables import TrialRecord
    from runtime.experiments.tuning import TuningTable, run_tuning
else:  # What an experiment file may say (design) is read without what runs it.
    __getattr__ = door(__name__)
