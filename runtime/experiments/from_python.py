"""Sweeps and ablations as functions: ``runtime.sweep(graph, {...})``, ``runtime.ablate(graph)``."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from runtime.document import Node, Value, from_python, parse_yaml
from runtime.errors import Problems, UsageError, Where
from runtime.experiments.ablation import run_ablation
from runtime.experiments.analysis import Test
from runtime.experiments.design import (
    Additions,
    Experiment,
    Method,
    Objective,
    Seeds,
    Variant,
    check_variants,
    parse_seeds,
    read_experiment,
    removals,
)
from runtime.experiments.execution import ablation_plan, chosen_pool, sweep_plan
from runtime.experiments.sweeping import SweepOptions, run_sweep
from runtime.experiments.tables import AblationTable, SweepTable
from runtime.files import slug
from runtime.graph import Graph, load
from runtime.terminal import Progress

SeedList = str | int | Iterable[int]
Source = Graph | str | Path | Mapping[str, Value]
DEFAULT_SEEDS = Seeds(((0, 9),))


def sweep(
    graph: Source,
    vary: Mapping[str, str | Iterable[object]] | None = None,
    *,
    seeds: SeedList | None = None,
    random: int | None = None,
    sobol: int | None = None,
    sampling_seed: int | None = None,
    minimize: str | None = None,
    maximize: str | None = None,
    folder: str | Path | None = None,
    keep: str = "none",
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
) -> SweepTable:
    """Run a graph with all combinations, or samples, of some values, each with every seed.

    Parameters
    ----------
    graph : a graph, or the file or name of one or of an experiment.
    vary : for each path into the graph its values: a list, or a range as on the command line
        (``"0.1..0.9:5"``, ``"log(1e-5..1e-2):7"``).
    seeds : such as ``"0..9"``, 3 or ``range(5)``; the graph's own seed by default.
    random, sobol : so many samples of the ranges, instead of all combinations.
    sampling_seed : of the samples.
    minimize, maximize : the metric that tells which configuration is best; the first is minimized
        by default.
    folder : where the sweep is written; a temporary folder by default. One that holds part of the
        same sweep is continued.
    keep : which trials leave a run folder in it: ``none``, ``failed``, ``best:N`` or ``all``.
    jobs : worker processes; one per processor by default.
    scheduler : address of a Dask cluster that runs the trials instead.
    timeout : time limit of a trial (s).

    Raises
    ------
    GraphError, UsageError : the graph, a factor or an option is invalid, or the folder belongs to
        another experiment. Trials that fail are rows of the table.
    KeyboardInterrupt : it was interrupted; with a ``folder``, the same call continues it.

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
    experiment = experiment_of(graph)
    own = experiment.graph.check().network.seed
    chosen = seeds_of(seeds) or experiment.seeds or Seeds(((own, own),))
    experiment = Additions(
        vary=[(path, node_of(values)) for path, values in (vary or {}).items()],
        method=_method(random, sobol),
        samples=(random if sobol is None else sobol) or 0,
        sampling_seed=sampling_seed,
        objective=_objective(minimize, maximize),
    ).to(experiment, chosen)
    plan = sweep_plan(experiment, chosen)
    pool = chosen_pool(jobs, scheduler, timeout)
    with folder_for(folder, plan.name) as target:
        options = SweepOptions(target, True, pool, keep, timeout)
        done = run_sweep(plan, options, Progress(plan.name))
        if done.is_interrupted:
            raise KeyboardInterrupt
        table = SweepTable.of(done)
    return table if folder is not None else table.with_temporary(target.parent)


def ablate(
    graph: Source,
    variants: Mapping[str, Graph] | None = None,
    *,
    seeds: SeedList | None = None,
    test: Test = "t",
    folder: str | Path | None = None,
    jobs: int | None = None,
    scheduler: str | None = None,
    timeout: float | None = None,
) -> AblationTable:
    """Compare variants of a graph with it, on the same seeds.

    Parameters
    ----------
    graph : the baseline: a graph, or the file or name of one or of an experiment.
    variants : changed graphs by name, as ``{"no network": graph.without("snn")}``; each block
        removed in turn by default.
    seeds : such as ``"0..19"`` or ``range(20)``; ``"0..9"`` by default.
    test : of differences, ``t`` or ``bootstrap``.
    folder, jobs, scheduler, timeout : as for :func:`sweep`.

    Raises
    ------
    GraphError, UsageError : a graph or an option is invalid, the graph has no metrics, or the
        folder belongs to another experiment. Trials that fail are rows of the table.
    KeyboardInterrupt : it was interrupted; with a ``folder``, the same call continues it.

    Examples
    --------
    >>> import runtime
    >>> graph = runtime.load("starters/adaptive").set("run.until", 0.2)
    >>> table = runtime.ablate(graph, {"alone": graph.without("adaptive")}, seeds="0..3", jobs=1)
    >>> line = table.line("alone", "mean_error")
    >>> line.runs, line.difference.mean > 0
    (4, True)
    """
    experiment = experiment_of(graph)
    baseline = experiment.graph.check()
    named = [Variant.of(name, each, baseline) for name, each in (variants or {}).items()]
    chosen = [*experiment.variants, *named]
    essential: dict[str, str] = {}
    if chosen:
        check_variants(chosen)
    else:
        chosen, essential = removals(baseline)
    plan = ablation_plan(experiment, chosen, seeds_of(seeds) or experiment.seeds or DEFAULT_SEEDS)
    if not chosen:
        raise UsageError("no block of this graph can be removed alone; give variants")
    if not plan.metrics:
        raise UsageError("the graph has no metrics to compare variants by; add some")
    pool = chosen_pool(jobs, scheduler, timeout)
    with folder_for(folder, plan.name) as target:
        progress = Progress(plan.name)
        done = run_ablation(plan, chosen, essential, target, pool, test, timeout, progress)
        if done.is_interrupted:
            raise KeyboardInterrupt
        table = AblationTable.of(done)
    return table if folder is not None else table.with_temporary(target.parent)


@contextmanager
def folder_for(folder: str | Path | None, name: str) -> Iterator[Path]:
    """The folder of an experiment: a temporary one, removed after an error, if none is given."""
    if folder is not None:
        yield Path(folder)
        return
    scratch = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
    try:
        yield scratch / name
    except BaseException:
        shutil.rmtree(scratch, ignore_errors=True)
        raise


def experiment_of(graph: Source) -> Experiment:
    """The experiment that a graph, a file or a name stands for."""
    if isinstance(graph, (str, Path)):
        return read_experiment(str(graph))
    found = graph if isinstance(graph, Graph) else load(graph)
    return Experiment(slug(found.title), found)


def seeds_of(seeds: SeedList | None) -> Seeds | None:
    """Seeds as a call gives them."""
    if seeds is None:
        return None
    given = seeds if isinstance(seeds, (str, int)) else list(seeds)
    problems = Problems()
    found = parse_seeds(from_python(given, Where("seeds")), "", problems)
    problems.raise_any()
    return found


def node_of(values: str | Iterable[object]) -> Node:
    """The values of a factor as a call gives them."""
    if isinstance(values, str):
        return parse_yaml(values, "vary")
    return from_python(list(values), Where("vary"))


def _method(random: int | None, sobol: int | None) -> Method | None:
    if random is not None and sobol is not None:
        raise UsageError("there is 'sobol' as well as 'random'; keep one")
    return "random" if random is not None else "sobol" if sobol is not None else None


def _objective(minimize: str | None, maximize: str | None) -> Objective | None:
    if minimize is not None and maximize is not None:
        raise UsageError("there is 'maximize' as well as 'minimize'; keep one")
    if maximize is not None:
        return Objective(maximize, "maximize")
    return None if minimize is None else Objective(minimize)
