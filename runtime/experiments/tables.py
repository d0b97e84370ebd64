"""What the tables of sweeps and ablations share: their runs, for a notebook or pandas.

In: a plan, and the rows of its index. Out: :class:`TrialRecord` for each run::

    3,1.0,1,ok,,0.25,...  ->  TrialRecord({"params.v_r": 1.0}, 1, "ok", "", {"error": 0.25})
"""

from __future__ import annotations

from abc import abstractmethod
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from runtime.document import parse_yaml
from runtime.experiments.execution import VARIANT, Columns, ExperimentPlan, Outcome, Row
from runtime.tables import Column, Table

if TYPE_CHECKING:
    from pandas import DataFrame


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


class TrialTable(Outcome):
    """An experiment whose trials are planned: all of them are runs of its table."""

    plan: ExperimentPlan

    @abstractmethod
    def all_rows(self) -> Iterable[Row]:
        """The rows of its index, in any order."""

    @property
    def name(self) -> str:
        return self.plan.name

    @property
    def seeds(self) -> tuple[int, ...]:
        """Each configuration ran with each of them."""
        return tuple(self.plan.seeds)

    @property
    def units(self) -> Mapping[str, str]:
        """Those of the metrics that have one."""
        return self.plan.units

    @property
    def never(self) -> Mapping[str, str]:
        """What an infinite value of a metric means, such as ``never settled``."""
        return self.plan.never

    @cached_property
    def trials(self) -> tuple[TrialRecord, ...]:
        """All runs, in the order of the plan."""
        rows = sorted(self.all_rows(), key=lambda row: row.trial)
        return tuple(_record(row, self.plan.columns) for row in rows)

    def to_dataframe(self) -> DataFrame:
        """One row per run, for pandas (extra ``dataframes``).

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        metrics = [Column(n, "number", self.units.get(n, "")) for n in self.plan.metrics]
        columns = [*map(Column, self.plan.columns.factors), Column("seed"), Column("status")]
        rows = [
            [*trial.values.values(), trial.seed, trial.status, *trial.metrics.values()]
            for trial in self.trials
        ]
        return Table([*columns, *metrics], rows).dataframe()

    def _counts(self) -> str:
        counts = Counter(trial.status for trial in self.trials)
        return ", ".join(f"{count} {status}" for status, count in sorted(counts.items()))

    def _failures(self) -> Iterator[str]:
        reasons = Counter(trial.reason for trial in self.trials if trial.reason)
        for reason, count in reasons.most_common(5):
            yield f"{count} x {reason}"


def values_of(columns: Columns, cells: Sequence[str]) -> dict[str, object]:
    """A row's values of the factors."""
    return {
        path: cell if path == VARIANT else parse_yaml(cell, path).plain()
        for path, cell in zip(columns.factors, cells, strict=True)
    }


def _record(row: Row, columns: Columns) -> TrialRecord:
    values = values_of(columns, row.cells)
    metrics = dict(zip(columns.metrics, row.metrics, strict=True))
    return TrialRecord(values, row.seed, row.status, row.reason, metrics, row.wall_s)
