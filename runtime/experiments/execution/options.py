"""How an experiment is run, which its numbers do not depend on.

In: options of a command or a call. Out: tasks for workers, and the workers::

    RunOptions(Path("sweeps/x"), jobs=4, timeout=60.0).make_pool(program)  ->  four processes
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.engine import silent
from runtime.errors import UsageError
from runtime.experiments.execution.cluster import ClusterPool
from runtime.experiments.execution.trials import Trial
from runtime.experiments.execution.worker import LOST, Task
from runtime.experiments.execution.worker_pool import LocalPool, WorkerPool
from runtime.files import remove_tree
from runtime.runs import Program
from runtime.toolchain import processors

CHECKPOINTS = "checkpoints"  # of trials that have not ended


@dataclass(frozen=True)
class RunOptions:
    """How an experiment is run; none of this affects its numbers.

    Parameters
    ----------
    folder : where it is written.
    resume : whether an experiment that is there is continued.
    jobs : worker processes; one per processor by default.
    scheduler : the address of a Dask cluster that runs the trials instead.
    keep : which trials of a sweep leave a run folder.
    timeout : time limit of a trial in seconds.
    checkpoint : the time between two checkpoints of a trial (s of the clock); None for none.
    mixed : whether rows and workers of another version of the program are accepted.
    again : the statuses whose rows are removed, so that their trials run again.
    option : how an option is written in messages, ``--{}`` on a command line.
    note : receives that workers are waited for, or left out.

    Raises
    ------
    UsageError : a cluster shall write checkpoints, which are in a folder of this machine.
    """

    folder: Path
    resume: bool = False
    jobs: int | None = None
    scheduler: str | None = None
    keep: str = "none"
    timeout: float | None = None
    checkpoint: float | None = None
    mixed: bool = False
    again: tuple[str, ...] = (LOST,)
    option: str = "{}"
    note: Callable[[str], None] = silent

    def __post_init__(self) -> None:
        if self.scheduler is not None and self.checkpoint is not None:
            raise UsageError(
                "checkpoints of trials are files of this machine, which the workers of a cluster "
                "need not see; leave out 'checkpoint' or 'scheduler'"
            )

    def make_pool(self, program: Program) -> WorkerPool:
        """The workers for a program.

        Raises
        ------
        MissingExtraError, UsageError : as for :class:`ClusterPool`.
        """
        if self.scheduler is not None:
            return ClusterPool(self.scheduler, program, self.mixed, self.note)
        return LocalPool(self.jobs or processors(), self.timeout)

    def task(self, trial: Trial, **how: Any) -> Task:
        """How to run a trial; ``how`` as for :class:`Task`."""
        every = self.checkpoint
        checkpoints = None if every is None else (self.folder.resolve() / CHECKPOINTS, every)
        return Task(trial, timeout=self.timeout, checkpoints=checkpoints, **how)

    def remove_checkpoints(self) -> None:
        """Remove what trials that were killed have left; all have ended."""
        remove_tree(self.folder / CHECKPOINTS)
