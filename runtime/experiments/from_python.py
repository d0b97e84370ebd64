"""Experiments as functions: ``runtime.sweep(graph, {...})``, ``ablate(graph)`` and ``tune(...)``.

In: a graph and options in Python. Out: a table. Each function makes the request that its verb of
the command line makes, and runs the same plan::

    runtime.sweep("case_a", {"params.v_r": "0.5..1.5:3"}, seeds=range(2), folder="mine")
    runtime sweep case_a --vary params.v_r=0.5..1.5:3 --seeds 0..1 --name mine
"""

from __future__ import annotations

import shutil
import tempfile
import weakref
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from runtime.document import Value
from runtime.errors import UsageError
from runtime.experiments.ablation import AblationTable, run_ablation
from runtime.experiments.analysis import Test
from runtime.experiments.design import (
    Experiment,
    Over,
    Request,
    Sampler,
    SeedList,
    read_experiment,
)
from runtime.experiments.execution import RunOptions, ablation_plan, sweep_plan
from runtime.experiments.sweeping import SweepTable, run_sweep
from runtime.experiments.tuning import TuningTable, run_tuning, tuning_plan
from runtime.files import slug
from runtime.graph import Graph, load
from runtime.terminal import Progress

Source = Graph | str | Path | Mapping[str, Value]
TableT = TypeVar("TableT", SweepTable, AblationTable, TuningTable)


def sweep(
    graph: Source,
    vary: Mapping[str, str | Iterable[object]] | None = None,
    *,
    variants: Mapping[str, Graph] | None = None,
    seeds: SeedList | None = None,
    random: int | None = None,
    sobol: int | None = None,
    sampling_seed: int | None = None,
    minimize: str | None = None,
    maximize: str | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    keep: str = "none",
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
    checkpoint: float | None = None,
    mixed: bool = False,
) -> SweepTable:
    """Run a graph with all combinations, or samples, of some values, each with every seed.

    Parameters
    ----------
    graph : a graph, or the file or name of one or of an experiment.
    vary : for each path into the graph its values: a list, or a range as on the command line
        (``"0.1..0.9:5"``, ``"log(1e-5..1e-2):7"``).
    variants : changed graphs by name, which run with the same values, besides the graph itself.
    seeds : such as ``"0..9"``, 3 or ``range(5)``; the graph's own seed by default.
    random, sobol : so many samples of the ranges, instead of all combinations.
    sampling_seed : of the samples.
    minimize, maximize : the metric that tells which configuration is best; the first is minimized
        by default.
    folder : where the sweep is written, a new one; a temporary folder by default.
    resume : continue the sweep that the folder holds part of.
    keep : which trials leave a run folder in it: ``none``, ``failed``, ``best:N`` or ``all``.
    jobs : worker processes; one per processor by default.
    scheduler : address of a Dask cluster that runs the trials instead.
    timeout : time limit of a trial (s).
    checkpoint : the time between two checkpoints of each running trial (s of the clock), from
        which ``resume`` goes on; none by default. For trials that take minutes.
    mixed : accept rows and workers of another version of this package; refused by default.

    Raises
    ------
    GraphError, UsageError : the graph, a factor or an option is invalid, or the folder belongs to
        another experiment. Trials that fail are rows of the table.
    KeyboardInterrupt : it was interrupted; with a ``folder``, ``resume=True`` continues it.

    Examples
    --------
    >>> import runtime
    >>> graph = runtime.load("starters/adaptive").set("run.until", 0.2)
    >>> table = runtime.sweep(graph, {"params.v_r": [0.5, 1.0]}, seeds=range(2), jobs=1)
    >>> for trial in table.trials:
    ...     print(trial.values, trial.seed, trial.status)
    {'params.v_r': 0.5} 0 ok
    {'params.v_r': 0.5} 1 ok
    {'params.v_r': 1.0} 0 ok
    {'params.v_r': 1.0} 1 ok
    """
    if minimize is not None and maximize is not None:
        raise UsageError("there is 'maximize' as well as 'minimize'; keep one")
    entries: dict[str, object] = {"seeds": seeds, "random": random, "sobol": sobol}
    entries |= {"sampling_seed": sampling_seed, "minimize": minimize, "maximize": maximize}
    request = Request.of(entries, vary=(vary or {}).items(), variants=(variants or {}).items())
    plan = sweep_plan(request.apply_to(_experiment(graph)))

    def run(target: Path) -> SweepTable:
        options = _options(target, resume, jobs, scheduler, timeout, checkpoint, mixed, keep)
        return run_sweep(plan, options, Progress(plan.name))

    return _table(folder, plan.name, run)


def ablate(
    graph: Source,
    variants: Mapping[str, Graph] | None = None,
    *,
    vary: Mapping[str, str | Iterable[object]] | None = None,
    seeds: SeedList | None = None,
    test: Test = "auto",
    primary: Sequence[str] = (),
    contrasts: Sequence[tuple[str, str]] = (),
    margin: float | str | Mapping[str, float | str] | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
    checkpoint: float | None = None,
    mixed: bool = False,
) -> AblationTable:
    """Compare variants of a graph with it, on the same seeds.

    Parameters
    ----------
    graph : the baseline: a graph, or the file or name of one or of an experiment.
    variants : changed graphs by name, as ``{"no network": graph.without("snn")}``; each block
        removed in turn by default.
    vary : as for :func:`sweep`; variants are compared at each combination of these values.
    seeds : such as ``"0..19"`` or ``range(20)``; ``"0..9"`` by default.
    primary : the metrics that are tested; all by default, otherwise the others are described.
    contrasts : pairs of variants that are compared with each other, too.
    margin : the smallest difference that counts, of all metrics or by metric: a number in the
        metric's unit, or a share of the baseline's mean such as ``"5%"``.
    test : of differences: ``t``, ``ranks``, or ``auto``, which takes ranks where values are skewed.
    folder, resume, jobs, scheduler, timeout, checkpoint, mixed : as for :func:`sweep`.

    Raises
    ------
    GraphError, UsageError : a graph or an option is invalid, the graph has no metrics, or the
        folder belongs to another experiment. Trials that fail are rows of the table.
    KeyboardInterrupt : it was interrupted; with a ``folder``, ``resume=True`` continues it.

    Examples
    --------
    >>> import runtime
    >>> graph = runtime.load("starters/adaptive").set("run.until", 0.2)
    >>> table = runtime.ablate(graph, {"alone": graph.without("adaptive")}, seeds="0..3", jobs=1)
    >>> line = table.line("alone", "mean_error")
    >>> line.runs, line.difference.mean > 0
    (4, True)
    """
    entries: dict[str, object] = {"seeds": seeds, "primary": list(primary), "margin": margin}
    entries["contrasts"] = [list(pair) for pair in contrasts]
    named, values = (variants or {}).items(), (vary or {}).items()
    request = Request.of(entries, vary=values, variants=named)
    plan = ablation_plan(request.apply_to(_experiment(graph)))

    def run(target: Path) -> AblationTable:
        options = _options(target, resume, jobs, scheduler, timeout, checkpoint, mixed)
        return run_ablation(plan, options, Progress(plan.name), test)

    return _table(folder, plan.name, run)


def tune(
    graph: Source,
    vary: Mapping[str, str | Iterable[object]] | None = None,
    *,
    minimize: str | Sequence[str] = (),
    maximize: str | Sequence[str] = (),
    constraints: Sequence[str] | Mapping[str, Mapping[str, float]] = (),
    trials: int | None = None,
    sampler: Sampler | None = None,
    batch: int | None = None,
    sampling_seed: int | None = None,
    over: Over | None = None,
    stop_early: bool | None = None,
    seeds: SeedList | None = None,
    conditions: Mapping[str, Graph] | None = None,
    held_out: SeedList | None = None,
    held_out_conditions: Mapping[str, Graph] | None = None,
    folder: str | Path | None = None,
    resume: bool = False,
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
    checkpoint: float | None = None,
    mixed: bool = False,
) -> TuningTable:
    """Find the values of some factors that minimise metrics, and judge them on held-out runs.

    Parameters
    ----------
    graph : a graph, or the file or name of one or of an experiment.
    vary : for each path into the graph its values: a list, or a range as on the command line.
    minimize, maximize : metrics; several give a front. The first metric is minimised by default.
    constraints : what must hold, as ``["effort below 0.3"]`` or ``{"effort": {"below": 0.3}}``.
    trials, sampler, batch, sampling_seed : how many configurations are tried (100), by which
        optimiser (``tpe``), how many are asked for at a time (4), and its seed.
    over : over the conditions, the ``mean`` of a metric or its ``worst`` value.
    stop_early : whether configurations that half of the others beat are stopped (yes).
    seeds, conditions : of the training runs; conditions are changed graphs by name.
    held_out, held_out_conditions : of the runs that judge; other seeds, 1000..1019 by default.
    folder, resume, jobs, scheduler, timeout, checkpoint, mixed : as for :func:`sweep`.

    Raises
    ------
    GraphError, UsageError : the graph, a factor or an option is invalid.
    MissingExtraError : optuna is not installed.
    KeyboardInterrupt : it was interrupted; with a ``folder``, ``resume=True`` continues it.
    """
    entries: dict[str, object] = {"seeds": seeds, "held_out": held_out, "trials": trials}
    entries |= {"minimize": _as_list(minimize), "maximize": _as_list(maximize)}
    entries |= {"constraints": constraints or None, "sampler": sampler, "batch": batch}
    entries |= {"sampling_seed": sampling_seed, "over": over, "stop_early": stop_early}
    request = Request.of(
        entries,
        vary=(vary or {}).items(),
        conditions=(conditions or {}).items(),
        held_out_conditions=(held_out_conditions or {}).items(),
    )
    plan = tuning_plan(request.apply_to(_experiment(graph)))

    def run(target: Path) -> TuningTable:
        options = _options(target, resume, jobs, scheduler, timeout, checkpoint, mixed)
        return run_tuning(plan, options, Progress(plan.name))

    return _table(folder, plan.name, run)


def _options(
    target: Path,
    resume: bool,
    jobs: int | None,
    scheduler: str | None,
    timeout: float | None,
    checkpoint: float | None,
    mixed: bool,
    keep: str = "none",
) -> RunOptions:
    """How an experiment is run, from what the functions above have in common."""
    return RunOptions(
        folder=target,
        resume=resume,
        jobs=jobs,
        scheduler=scheduler,
        keep=keep,
        timeout=timeout,
        checkpoint=checkpoint,
        mixed=mixed,
    )


def _table(
    folder: str | Path | None,
    name: str,
    run: Callable[[Path], TableT],
) -> TableT:
    """Run an experiment, and make its table.

    Without a folder it is written to a temporary one, which is removed after an error, or together
    with the table.
    """
    scratch = None if folder is not None else Path(tempfile.mkdtemp(prefix="spikeblocks-"))
    try:
        table = run(Path(folder) if folder is not None else Path(scratch or "") / name)
        if table.is_interrupted:
            raise KeyboardInterrupt
        if isinstance(table, SweepTable):
            table.all_rows()  # are read now: the folder may be changed later
    except BaseException:
        if scratch is not None:
            shutil.rmtree(scratch, ignore_errors=True)
        raise
    if scratch is not None:
        weakref.finalize(table, shutil.rmtree, scratch, ignore_errors=True)
    return table


def _experiment(graph: Source) -> Experiment:
    """The experiment that a graph, a file or a name stands for."""
    if isinstance(graph, (str, Path)):
        return read_experiment(str(graph))
    loaded = graph if isinstance(graph, Graph) else load(graph)
    return Experiment(slug(loaded.title), loaded)


def _as_list(metrics: str | Sequence[str]) -> list[str]:
    return [metrics] if isinstance(metrics, str) else list(metrics)
