"""Training beside held-out: the table of a tuning, for a terminal and for a page.

In: judgements, from a tuning that has ended or from its folder. Out: a table, metric by metric::

    metric  values    training  difference  held out  difference     overfit
    total   baseline   -0.3103           -     1.551           -      -1.862
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from runtime.experiments.analysis import (
    NEVER,
    SAME,
    PairedDifference,
    apart,
    interval,
    is_significant,
    mean_of,
    p_cell,
    too_few,
)
from runtime.experiments.tuning.judging import Evaluation, Judgement
from runtime.experiments.tuning.plan import BASELINE
from runtime.tables import NO_VALUE, Cell, Column, Table, number_cell
from runtime.terminal import with_unit

FEW = "few"
COLUMNS = (
    Column("metric"),
    Column("values"),
    Column("training", "number"),
    Column("95 % interval", "number", key="training_interval"),
    Column("difference", "number", key="training_difference"),
    Column("p", "number", key="training_p"),
    Column("held out", "number", key="held_out"),
    Column("95 % interval", "number", key="held_out_interval"),
    Column("difference", "number", key="held_out_difference"),
    Column("p", "number", key="held_out_p"),
    Column("overfit", "number"),
)
NARROW = [column.name for column in COLUMNS if column.title not in ("95 % interval", "p")]


def judgement_table(
    judgements: Sequence[Judgement],
    metrics: Sequence[str],
    units: Mapping[str, str],
    never: Mapping[str, str],
) -> Table:
    """Training beside held-out, metric by metric; :data:`NARROW` are the columns of a terminal."""
    rows = []
    for metric in metrics:
        for line in judgements:
            if line.metric == metric:
                name = "baseline" if line.number == BASELINE else str(line.number)
                words = never.get(metric, NEVER)
                cells = [*_cells(line.training, words), *_cells(line.held_out, words)]
                overfit = number_cell(line.optimism, "+")
                rows.append([with_unit(metric, units), name, *cells, overfit])
    return Table(COLUMNS, rows)


def _cells(evaluation: Evaluation, never: str) -> list[Cell]:
    """The mean, its interval, the difference with its interval, and its p value."""
    mean, paired = evaluation.mean, evaluation.difference
    shown = mean_of(mean, 1 if mean.is_same else evaluation.units, never)
    ends = Cell(SAME) if mean.is_same else interval(mean)
    if paired is None:
        return [shown, ends, Cell(NO_VALUE), Cell(NO_VALUE)]
    p = Cell(too_few(paired.needed)) if paired.is_too_small else p_cell(evaluation.p)
    return [shown, ends, _difference(evaluation, paired), p]


def _difference(evaluation: Evaluation, paired: PairedDifference) -> Cell:
    is_found = is_significant(evaluation.p)
    if math.isnan(paired.mean):
        return Cell(f"({FEW})" if paired.is_too_small else "*" if is_found else NO_VALUE)
    middle, _, ends = apart(paired)
    shown = middle.text + f" {ends.text}" * (ends.text != NO_VALUE)
    mark = f" ({FEW})" if paired.is_too_small else "*" * is_found
    return replace(middle, text=shown + mark)
