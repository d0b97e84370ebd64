"""Contestants must compute the same thing: their poses are compared before anything is timed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np

from blocks.core import FloatArray

TOLERANCE = 1e-9


class Run(NamedTuple):
    """The seconds that the ticks of a run took, and the poses (rows, 3) that it went through."""

    seconds: float
    poses: FloatArray


Contestants = Mapping[str, Callable[[], Run]]


class DisagreementError(Exception):
    """Two implementations of one diagram went different ways."""


def largest_difference(subject: str, runs: Mapping[str, Run]) -> float:
    """The largest difference of any pose from the first run's (m, rad).

    Raises
    ------
    DisagreementError : it is more than ``TOLERANCE``, or a run has not moved at all.
    """
    (first, reference), *others = runs.items()
    if not np.ptp(reference.poses, axis=0).max() > 0.0:
        raise DisagreementError(f"{subject}: {first} stands still")
    largest = 0.0
    for name, run in others:
        if run.poses.shape != reference.poses.shape:
            message = f"{run.poses.shape} poses against {reference.poses.shape} of {first}"
            raise DisagreementError(f"{subject}: {name} gave {message}")
        apart = np.abs(run.poses - reference.poses).max(axis=1)
        # NaN compares false: it is a disagreement, too.
        if not (apart <= TOLERANCE).all():
            row = int(np.argmin(apart <= TOLERANCE))
            message = f"part at row {row} by {apart[row]:.3g}; at most {TOLERANCE:g} is allowed"
            raise DisagreementError(f"{subject}: {name} and {first} {message}")
        largest = max(largest, float(apart.max()))
    return largest


def run_all(contestants: Contestants) -> dict[str, Run]:
    """Every contestant's run, once."""
    return {name: run() for name, run in contestants.items()}
