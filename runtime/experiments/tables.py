"""What a sweep, an ablation or a tuning gives in Python: typed tables that show themselves.

In: the result of an experiment, and its index. Out: a table for a terminal, a notebook or pandas::

    print(runtime.sweep(graph, {"params.v_r": [0.5, 1.0]}, seeds=range(2)))
    sweep tracking: 2 configurations x 2 seeds: 4 ok
      params.v_r  mean_error
             0.5  0.21 ± 0.03
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.document import parse_yaml
from runtime.experiments.ablation import AblationResult
from runtime.experiments.analysis import (
    ANY,
    MEAN,
    NEVER,
    SAME,
    SAME_RUNS,
    ComparisonLine,
    Estimate,
    chosen_among,
    comparison_rows,
    gather,
    mean_of,
)
from runtime.experiments.design import Objective
from runtime.experiments.execution import INDEX, VARIANT, Columns, Row, read_rows
from runtime.experiments.sweeping import SweepResult
from runtime.experiments.tuning import Candidate, Judgement, TuningResult
from runtime.runs import Figures
from runtime.tables import dataframe
from runtime.terminal import table, with_unit

if TYPE_CHECKING:
    from pandas import DataFrame

MOST = 20  # configurations that are shown
HALF = "±: half of the 95 % interval of the mean over the seeds."
SOME = "n/N: n of N seeds have a value; the mean is over those."


@dataclass(frozen=True)
class TrialRecord:
    """One run of an experiment.

    Parameters
    ----------
    values : of each factor; for an ablation, the name of its ``variant``.
    status : ``ok``, ``failed``, ``timeout`` or ``lost``; ``reason`` is '' if it is ok.
    metrics : None where a metric has no value, infinite for what was never reached.
    wall_s : how long it took (s).
    """

    values: Mapping[str, object]
    seed: int
    status: str
    reason: str
    metrics: Mapping[str, float | None]
    wall_s: float


@dataclass(frozen=True)
class SweepConfiguration:
    """One combination of factors' values, with the mean of each metric over the seeds.

    ``ok`` counts the trials that ended well; an estimate's ``n`` counts those with a value.
    """

    values: Mapping[str, object]
    ok: int
    metrics: Mapping[str, Estimate]


@dataclass(frozen=True)
class _Table:
    """What the tables of sweeps and ablations share.

    Parameters
    ----------
    seeds : each configuration ran with each of them.
    trials : all runs, in the order of the plan.
    units : of the metrics that have one.
    never : what an infinite value of a metric means, such as ``never settled``.
    folder : the experiment's folder, for ``runtime report``. Without a folder of your own it is a
        temporary one, which is removed together with this object.
    """

    name: str
    seeds: tuple[int, ...]
    trials: tuple[TrialRecord, ...] = field(repr=False)
    units: Mapping[str, str] = field(repr=False)
    never: Mapping[str, str] = field(repr=False)
    folder: Path = field(repr=False)

    def to_dataframe(self) -> DataFrame:
        """One row per run, for pandas (extra ``dataframes``).

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        keys = list(self.trials[0].values) if self.trials else []
        metrics = list(self.trials[0].metrics) if self.trials else []
        columns: dict[str, list[object]] = {
            key: [trial.values[key] for trial in self.trials] for key in keys
        }
        columns["seed"] = [trial.seed for trial in self.trials]
        columns["status"] = [trial.status for trial in self.trials]
        for name in metrics:
            values = [trial.metrics[name] for trial in self.trials]
            columns[name] = [math.nan if value is None else value for value in values]
        return dataframe(columns, self.units, "to_dataframe()")

    def _counts(self) -> str:
        counts = Counter(trial.status for trial in self.trials)
        return ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))

    def _failures(self) -> Iterator[str]:
        reasons = Counter(trial.reason for trial in self.trials if trial.reason)
        for reason, count in reasons.most_common(5):
            yield f"{count} x {reason}"


@dataclass(frozen=True)
class SweepTable(_Table):
    """A sweep: ``configurations`` in the order of the plan, ``best`` by the objective."""

    factors: tuple[str, ...]
    configurations: tuple[SweepConfiguration, ...] = field(repr=False)
    objective: Objective | None = field(repr=False)

    @classmethod
    def of(cls, result: SweepResult) -> SweepTable:
        """The table of a sweep that has ended."""
        plan = result.plan
        seeds = tuple(plan.seeds)
        columns = plan.columns
        rows = sorted(read_rows(result.folder / INDEX, columns), key=lambda row: row.trial)
        groups = sorted(gather(rows, len(seeds)), key=lambda group: group.number)
        configurations = tuple(
            SweepConfiguration(
                _values(columns, group.cells),
                sum(row.status == "ok" for row in group.rows),
                {
                    name: group.estimate(i, plan.ends.get(name, ANY))
                    for i, name in enumerate(plan.metrics)
                },
            )
            for group in groups
        )
        trials = tuple(_record(row, columns) for row in rows)
        return cls(
            *(plan.name, seeds, trials, plan.units, plan.never, result.folder),
            *(columns.factors, configurations, plan.objective),
        )

    @property
    def best(self) -> SweepConfiguration | None:
        """The best configuration among those with a value of the objective for every seed."""
        goal = self.objective
        if goal is None:
            return None
        metric, most = goal.metric, len(self.seeds)
        candidates = [each for each in self.configurations if each.metrics[metric].is_over(most)]
        return min(candidates, key=lambda each: goal.of(each.metrics[metric].mean), default=None)

    def plot(self) -> Figures:
        """The sweep's figures by their names."""
        from runtime.experiments.analysis.sweep_plots import sweep_figures

        return Figures(sweep_figures(self.folder))

    def _rows(self) -> list[tuple[str, ...]]:
        metrics = list(self.configurations[0].metrics) if self.configurations else []
        is_ok = all(each.ok == len(self.seeds) for each in self.configurations)
        ok = () if is_ok else ("ok",)
        rows = [(*self.factors, *ok, *(with_unit(name, self.units) for name in metrics))]
        for each in self.configurations[:MOST]:
            values = (_cell(value) for value in each.values.values())
            share = () if is_ok else (f"{each.ok}/{len(self.seeds)}",)
            means = (self._mean(name, each) for name, each in each.metrics.items())
            rows.append((*values, *share, *means))
        return rows

    def _mean(self, metric: str, estimate: Estimate) -> str:
        """A mean with half of its interval, and how many seeds have a value if not all."""
        return mean_of(estimate, len(self.seeds), self.never.get(metric, NEVER), spread=True)

    def _head(self) -> str:
        count = len(self.configurations)
        return f"sweep {self.name}: {count} configurations x {len(self.seeds)} seeds: " + (
            self._counts()
        )

    def _notes(self) -> list[str]:
        notes = []
        if len(self.configurations) > MOST:
            notes.append(f"... and {len(self.configurations) - MOST} more configurations")
        best = self.best
        if best is not None and self.objective is not None:
            goal = "smallest" if self.objective.goal == "minimize" else "largest"
            chosen = ", ".join(f"{path}={_cell(value)}" for path, value in best.values.items())
            found, count = best.metrics[self.objective.metric], len(self.configurations)
            never = self.never.get(self.objective.metric, NEVER)
            mean = mean_of(found, len(self.seeds), never, spread=count == 1)
            metric = with_unit(self.objective.metric, self.units)
            notes.append(f"{goal} {metric}: {mean} at {chosen or 'its only configuration'}")
            notes += [chosen_among(count)] * (count > 1 and not found.is_same)
        estimates = [e for each in self.configurations for e in each.metrics.values()]
        notes += [HALF] * any(each.n > 1 for each in estimates)
        notes += [f"{SAME}: {SAME_RUNS}."] * any(each.is_same for each in estimates)
        seeds = len(self.seeds)
        notes += [SOME] * any(each.n and not each.is_over(seeds) for each in estimates)
        return [*notes, *self._failures()]

    def __repr__(self) -> str:
        rows = self._rows()
        shown = table(rows, range(len(rows[0])), indent="  ")
        return "\n".join([self._head(), shown, *self._notes()])

    def _repr_html_(self) -> str:
        return _html(self._head(), self._rows(), self._notes()) + self.plot()._repr_html_()


@dataclass(frozen=True)
class AblationTable(_Table):
    """An ablation: ``lines`` compare each variant with the baseline, metric by metric.

    ``essential`` has the blocks that cannot be removed alone, with the reasons.
    """

    variants: tuple[str, ...]
    lines: tuple[ComparisonLine, ...] = field(repr=False)
    essential: Mapping[str, str] = field(repr=False)
    text: str = field(repr=False)
    html: str = field(repr=False)

    @classmethod
    def of(cls, result: AblationResult) -> AblationTable:
        """The table of an ablation that has ended."""
        plan, lines = result.plan, tuple(result.lines)
        rows = [row for rows in result.rows.values() for row in rows]
        return cls(
            name=plan.name,
            seeds=tuple(plan.seeds),
            trials=tuple(_record(r, plan.columns) for r in sorted(rows, key=lambda r: r.trial)),
            units=plan.units,
            never=plan.never,
            folder=result.folder,
            variants=tuple(variant.name for variant in plan.variants),
            lines=lines,
            essential=plan.essential,
            text=result.text().rstrip("\n"),
            html=_html(result.head, comparison_rows(lines, plan.units, plan.never), result.notes()),
        )

    def line(self, variant: str, metric: str, statistic: str = MEAN) -> ComparisonLine:
        """The comparison of one metric of one variant.

        Parameters
        ----------
        statistic : ``mean``, or of a file with ``quantile`` or ``worst`` such as ``0.9-quantile``.

        Raises
        ------
        KeyError : there is no such variant, metric or statistic.
        """
        for each in self.lines:
            if (each.variant, each.metric, each.statistic) == (variant, metric, statistic):
                return each
        metrics = ", ".join(dict.fromkeys(each.metric for each in self.lines))
        variants = ", ".join(self.variants)
        raise KeyError(
            f"no line for '{variant}' and '{metric}' ({statistic}); "
            f"variants: {variants}; metrics: {metrics}"
        )

    def plot(self) -> Figures:
        """The ablation's figure."""
        from runtime.experiments.analysis.ablation_plots import ablation_figure

        return Figures({"ablation": ablation_figure(self.folder)})

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return self.html + self.plot()._repr_html_()


@dataclass(frozen=True)
class TuningTable:
    """What a tuning found.

    Parameters
    ----------
    configurations : all that were tried, the graph's own values first.
    winners : the best one, or the front, of the training runs; at most five. Empty if nothing is
        better than the graph's own values.
    better : those of which the held-out runs show that they are better: by a test, or because the
        seed changes nothing.
    judgements : the graph's own values and the winners on the training and the held-out runs.
    folder : the tuning's folder, as that of :class:`SweepTable`.
    """

    configurations: tuple[Candidate, ...] = field(repr=False)
    winners: tuple[Candidate, ...]
    better: tuple[Candidate, ...]
    judgements: tuple[Judgement, ...] = field(repr=False)
    paths: tuple[str, ...]
    folder: Path = field(repr=False)
    text: str = field(repr=False)

    @classmethod
    def of(cls, result: TuningResult) -> TuningTable:
        """The table of a tuning that has ended."""
        return cls(
            tuple(result.candidates),
            tuple(result.winners),
            tuple(result.better),
            tuple(result.judgements),
            result.plan.paths,
            result.folder,
            result.text().rstrip("\n"),
        )

    @property
    def best(self) -> dict[str, object]:
        """The values of the first of ``better`` by path; empty if there is none."""
        if not self.better:
            return {}
        return dict(zip(self.paths, self.better[0].values or (), strict=True))

    def __str__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


def _values(columns: Columns, cells: Sequence[str]) -> dict[str, object]:
    """A row's values of the factors."""
    return {
        path: cell if path == VARIANT else parse_yaml(cell, path).plain()
        for path, cell in zip(columns.factors, cells, strict=True)
    }


def _record(row: Row, columns: Columns) -> TrialRecord:
    values = _values(columns, row.cells)
    metrics = dict(zip(columns.metrics, row.metrics, strict=True))
    return TrialRecord(values, row.seed, row.status, row.reason, metrics, row.wall_s)


def _cell(value: object) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _html(head: str, rows: Sequence[Sequence[str]], notes: Sequence[str]) -> str:
    """A table as a notebook shows it: its title, its rows (the header first), and notes."""
    most = max(map(len, rows))
    lines = []
    for i, row in enumerate(rows):
        tag = "th" if i == 0 or len(row) < most else "td"
        cells = [
            f"<{tag} style='padding: 2px 8px; text-align: {'left' if k == 0 else 'right'}'>"
            f"{escape(text)}</{tag}>"
            for k, text in enumerate([*row, *[""] * (most - len(row))])
        ]
        lines.append(f"<tr>{''.join(cells)}</tr>")
    below = "".join(f"<div>{escape(note)}</div>" for note in notes)
    return f"<b>{escape(head)}</b><table>{''.join(lines)}</table>{below}"
