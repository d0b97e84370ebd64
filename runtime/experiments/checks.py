"""What is wrong with an experiment, told before anything runs."""

from __future__ import annotations

from dataclasses import replace

from blocks.params import hint
from runtime.edits import full_path
from runtime.errors import GraphError, Problems, UsageError, Where
from runtime.experiments.design import Design
from runtime.experiments.knobs import Knob
from runtime.experiments.objective import Objective
from runtime.experiments.seeds import Seeds
from runtime.graph import Graph


def check_knob(graph: Graph, knob: Knob, where: Where, problems: Problems) -> None:
    """Try a knob's values on a graph, which has been checked itself."""
    if full_path(graph.document, knob.path) == "run.seed":
        problems.add(where, knob.path, "the seed is no knob; seeds are varied by 'seeds'")
        return
    for value in knob.trials():
        try:
            graph.set(knob.path, value, origin=str(where)).check()
        except GraphError as error:
            # A place that is only a text would not sort among the file's other places.
            problems.found += [
                replace(problem, where=where) if problem.where.file == str(where) else problem
                for problem in error.problems
            ]
            return


def check_design(graph: Graph, design: Design, seeds: Seeds) -> None:
    """Check that a design can be run.

    Raises
    ------
    UsageError : there is nothing to vary, an axis stands twice, or a range has no steps.
    """
    if not design.knobs and len(seeds) < 2:
        raise UsageError("there is nothing to vary; add --vary PATH=VALUES, or more --seeds")
    if not design.knobs and design.method != "grid":
        raise UsageError(f"there is nothing to sample for --{design.method}; add --vary PATH=RANGE")
    paths = [full_path(graph.document, knob.path) for knob in design.knobs]
    for i, path in enumerate(paths):
        if path in paths[:i]:
            raise UsageError(f"'{design.knobs[i].path}' is varied twice; keep one")
    for knob in design.knobs:
        if design.method == "grid" and not knob.count:
            raise UsageError(
                f"{knob.path}={knob.written}: how many values? Write {knob.written}:5, "
                "or sample the ranges with --random N or --sobol N"
            )


def check_objective(graph: Graph, objective: Objective, where: Where, problems: Problems) -> None:
    """Check that a graph has the metric that is to be made small or large."""
    known = [metric.name for metric in graph.observation.metrics]
    if objective.metric not in known:
        mend = hint(objective.metric, known) or f"; it has {', '.join(known) or 'none'}"
        said = f"the graph has no metric '{objective.metric}'{mend}"
        problems.add(where, objective.goal, said)
