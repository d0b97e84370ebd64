"""Options of the verbs that run many trials: seeds and workers."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from collections.abc import Callable
from typing import TYPE_CHECKING

from runtime.cli.commands import at_least, integer
from runtime.errors import Problems

if TYPE_CHECKING:
    from runtime.experiments.design import Seeds
    from runtime.experiments.execution import WorkerPool

MAX_JOBS = 4096


def add_workers(parser: ArgumentParser, seeds: str) -> None:
    """Declare the options; ``seeds`` describes the default seeds."""
    parser.add_argument("--seeds", metavar="SEEDS", help=f"0..9, 3, or 0,4,7..9 ({seeds})")
    jobs = integer(1, MAX_JOBS)
    parser.add_argument(
        "-j", "--jobs", type=jobs, metavar="N", help="worker processes (one per processor)"
    )
    seconds = at_least(0.0, above=True)
    parser.add_argument(
        "--timeout", type=seconds, metavar="S", help="time limit of a trial, seconds"
    )
    parser.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run the trials on a Dask cluster: tcp://host:8786",
    )


def chosen_seeds(options: Namespace) -> Seeds | None:
    """The seeds given on the command line, or None.

    Raises
    ------
    GraphError : a seed is not a number.
    """
    from runtime.document import parse_yaml
    from runtime.experiments.design import parse_seeds

    if options.seeds is None:
        return None
    problems = Problems()
    origin = f"--seeds {options.seeds}"
    seeds = parse_seeds(parse_yaml(options.seeds, origin), "", problems)
    problems.raise_any()
    return seeds


def start_early(options: Namespace) -> None:
    """Start a fork server, so that it imports while the graph is read and checked."""
    if options.scheduler is None:
        from runtime.experiments.processes import choice

        choice.start_early()


def pool_of(options: Namespace) -> Callable[[], WorkerPool]:
    """A function that makes the worker pool chosen on the command line."""
    from runtime.experiments.execution import chosen_pool

    return chosen_pool(options.jobs, options.scheduler, options.timeout)
