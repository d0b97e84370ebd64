"""The report of a sweep: the best configurations, the effect of each factor, and failures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.compare import text_of
from runtime.experiments.analysis import (
    ANY,
    NEVER,
    SAME,
    SAME_RUNS,
    SweepData,
    Tally,
    TrialGroup,
    chosen_among,
    interval,
    mean_of,
    read_sweep,
)
from runtime.experiments.analysis.sweep_plots import sweep_figures
from runtime.experiments.execution import GRAPH, INDEX, SUMMARY, Columns, Row, read_plan, read_rows
from runtime.files import read_json
from runtime.reports import pieces
from runtime.reports.findings import of_sweep
from runtime.reports.page import page
from runtime.runs import DIAGRAM
from runtime.tables import Html, Table, element, facts, join
from runtime.terminal import short

FEW = 60  # configurations that are all listed


@dataclass(frozen=True)
class _Sweep:
    """A sweep read from disk: its plan, its data for figures, and counts of its trials."""

    folder: Path
    plan: Mapping[str, Any]
    data: SweepData
    tally: Tally
    total: int

    @property
    def factors(self) -> list[str]:
        return [axis.path for axis in self.data.axes]

    @property
    def metrics(self) -> list[str]:
        """The metrics in the order of the index."""
        return list(self.data.metrics)

    @property
    def shown(self) -> list[str]:
        """The metrics in the order of tables, the objective first."""
        goal = self.data.objective
        return sorted(self.metrics, key=lambda name: goal is None or name != goal.metric)

    def rows(self) -> Iterator[Row]:
        """The rows of the index, in the order in which they ended."""
        columns = Columns(tuple(self.factors), tuple(self.metrics))
        return read_rows(self.folder / INDEX, columns)


def sweep_report(folder: Path) -> str:
    """The report of a sweep as an HTML document.

    Parameters
    ----------
    folder : of a sweep, complete or not.

    Raises
    ------
    UsageError : its files cannot be read.
    """
    swept = _read(folder)
    configurations = swept.total // max(1, swept.data.seeds)
    best = [ranked.group for ranked in swept.tally.best]
    is_few = 1 < configurations <= FEW
    sections = {
        "Best configurations": _table(swept, best, configurations == 1, "best configurations"),
        "Figures": join(*_figures(swept)),
        "All configurations": _table(
            swept, swept.data.groups if is_few else (), True, "all configurations"
        ),
        "Failed trials": _failures(swept),
        "Diagram": pieces.diagram_file(
            folder / DIAGRAM, "diagram", f"block diagram of {swept.data.name}"
        ),
        "Graph": pieces.graph_file(folder / GRAPH, "The graph before factors are set."),
        "Provenance": pieces.plan_provenance(folder, swept.plan),
    }
    facts = _facts(swept, configurations)
    return page("Sweep", swept.data.name, _lead(swept), facts, sections, folder, _found(swept))


def _read(folder: Path) -> _Sweep:
    plan = read_plan(folder)
    data = read_sweep(folder)
    tally = Tally.of(data.seeds, list(data.metrics), data.objective, data.ends, data.never)
    swept = _Sweep(folder, plan, data, tally, plan["total"])
    for row in swept.rows():
        swept.tally.add(row)
    return swept


def _lead(swept: _Sweep) -> str:
    """The factors with their ranges, and the objective."""
    vary, goal = swept.plan.get("vary"), swept.data.objective
    factors = vary.items() if isinstance(vary, Mapping) else ()
    ranges = [f"{path} = {v if isinstance(v, str) else text_of(v)}" for path, v in factors]
    message = f"Sweep over {', '.join(ranges)}"
    if goal is None:
        return f"{message}."
    return f"{message}, to {goal.goal} {goal.metric}."


def _found(swept: _Sweep) -> str:
    """The best configuration in a sentence, if there is one."""
    goal, best = swept.data.objective, swept.tally.best
    if goal is None or not best or not best[0].objective.n:
        return ""
    unit = swept.data.units.get(goal.metric, "")
    mean = best[0].objective.mean
    text = of_sweep(swept.factors, best[0].cells, goal.metric, goal.goal, mean, unit)
    tried = swept.total // swept.data.seeds
    if tried < 2 or best[0].objective.is_same:
        return text
    return f"{text} It was {chosen_among(tried)}."


def _facts(swept: _Sweep, configurations: int) -> Html:
    tally = swept.tally
    is_whole = tally.done >= swept.total
    status = f"{tally.done} of {swept.total}" if not is_whole else str(swept.total)
    bad = tally.done - tally.counts["ok"]
    return facts(
        [
            ("trials", status if is_whole else element("span", status, class_="warn")),
            ("configurations", str(configurations)),
            ("seeds", str(swept.plan.get("seeds", ""))),
            ("not ok", element("span", str(bad), class_="bad") if bad else "none"),
            ("sampling", swept.data.method),
            ("wall time", _wall(swept.folder)),
        ]
    )


def _wall(folder: Path) -> str:
    """The duration of the last session of the sweep, if it was completed."""
    try:
        seconds = read_json(folder / SUMMARY)["wall_s"]
        return f"{float(seconds):.3g} s"
    except (OSError, ValueError, KeyError, TypeError):
        return "unknown"


def _table(swept: _Sweep, chosen: Sequence[TrialGroup], is_whole: bool, label: str) -> Html:
    """A table of the best configurations or of all, with the mean of each metric.

    Parameters
    ----------
    is_whole : with its interval: that of the best of many would not cover what it is worth.
    """
    if not chosen:
        return Html("")
    head = [*swept.factors, "ok"]
    for metric in swept.shown:
        head += [swept.data.label(metric)]
        head += [f"{metric}: 95 % interval"] * is_whole
    rows = [_configuration(swept, group, is_whole) for group in chosen]
    numbers = range(len(swept.factors), len(head))
    words = "Means and intervals are over the seeds; n/N: only n of the N seeds have a value."
    if not is_whole:
        words = "Means are over the seeds; n/N: only n of the N seeds have a value. The best are "
        words += f"{chosen_among(swept.total // swept.data.seeds)}."
    if swept.data.seeds > 1 and swept.data.is_same(swept.metrics):
        words = f"{SAME}: {SAME_RUNS}."
    note = element("p", words, class_="soft small")
    return join(Table.of(head, rows, numbers=numbers).html(label), note)


def _configuration(swept: _Sweep, group: TrialGroup, with_interval: bool) -> list[object]:
    ok = sum(row.status == "ok" for row in group.rows)
    data = swept.data
    cells: list[object] = [*map(short, group.cells), f"{ok}/{data.seeds}"]
    for metric in swept.shown:
        ends = data.ends.get(metric, ANY)
        estimate = group.estimate(swept.metrics.index(metric), ends)
        cells += [mean_of(estimate, data.seeds, data.never.get(metric, NEVER))]
        cells += [interval(estimate)] * with_interval
    return cells


def _figures(swept: _Sweep) -> Iterator[Html]:
    seeds, ends = "means over the seeds", ", with 95 % intervals"
    if swept.data.seeds == 1:
        seeds, ends = "one seed", ""
    elif swept.data.is_same(swept.metrics):
        seeds, ends = f"{SAME}, {SAME_RUNS}", ""
    captions = {
        "curves": f"Each metric over the factor: {seeds}{ends}.",
        "maps": f"Each metric over the two factors: {seeds}.",
    }
    for i, (name, figure) in enumerate(sweep_figures(swept.folder)):
        other = f"Each line is a configuration: {name.removeprefix('parallel_')}, {seeds}."
        yield pieces.plot(figure, f"figure-{i + 1}", captions.get(name, other), wide=True)


def _failures(swept: _Sweep) -> Html:
    counts = swept.tally.counts
    if counts["ok"] == swept.tally.done and not swept.tally.reasons:
        return Html("")
    rows = [[status, str(count)] for status, count in sorted(counts.items())]
    parts = [Table.of(["status", "trials"], rows, numbers=[1]).html("trials by status")]
    reasons = [[str(each["reason"]), str(each["count"])] for each in swept.tally.top_reasons()]
    if reasons:
        parts.append(element("h3", "Reasons, the most frequent first"))
        parts.append(Table.of(["reason", "trials"], reasons, numbers=[1], long=[0]).html("reasons"))
    return join(*parts)
