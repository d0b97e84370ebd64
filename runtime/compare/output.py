"""The output of a comparison: text with tables, and one JSON object.

In: a :class:`Comparison`, and tolerances. Out: what ``runtime compare`` prints.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

from runtime.compare.comparison import Comparison, RunComparison
from runtime.compare.documents import ABSENT, KeyDifference, text_of
from runtime.compare.probes import Column, Pair
from runtime.runs import compared_metrics
from runtime.tables import Table
from runtime.terminal import number

LISTED = 6  # columns of a probe that the text lists one by one
LISTED_IN_JSON = 12
SCHEMA_VERSION = 1
VALUE_WIDTH = 40  # characters
SIGNS = {"added": "+", "removed": "-", "changed": "~"}


def summary(comparison: Comparison, rtol: float, atol: float) -> str:
    """A comparison as text, with the differences of probes beyond a tolerance."""
    parts = [*_common(comparison)]
    parts += [_by_tolerance(comparison, other, rtol, atol) for other in comparison.others]
    return "\n\n".join(parts)


def exact_summary(comparison: Comparison) -> str:
    """A comparison as text, with the first tick at which the probes differ."""
    parts = [*_common(comparison)]
    parts += [_by_bits(comparison, other) for other in comparison.others]
    return "\n\n".join(parts)


def _common(comparison: Comparison) -> Iterator[str]:
    rows = [[run.label, run.result.title, str(run.folder)] for run in comparison.runs]
    yield f"runs\n{Table.of(['', '', ''], rows).text()}"
    for title, differences in (
        ("graph", comparison.graph),
        ("circumstances", comparison.circumstances),
    ):
        if differences:
            yield f"{title}\n{_document_table(comparison.labels, differences).text()}"
        else:
            yield f"{title}: no difference"
    if comparison.metrics:
        yield f"metrics\n{_metrics(comparison).text()}"


def _document_table(labels: Sequence[str], differences: Sequence[KeyDifference]) -> Table:
    rows = [
        [f"{SIGNS[item.change]} {item.path}", *(text_of(v, VALUE_WIDTH) for v in item.values)]
        for item in differences
    ]
    return Table.of(["", *labels], rows)


def _metrics(comparison: Comparison) -> Table:
    """One line per metric; with two runs, also the second's value minus the first's."""
    runs = {run.label: run.result for run in comparison.runs}
    shown = compared_metrics(runs, comparison.metrics)
    if len(runs) > 2:
        return shown
    differences = [_metric_difference(*values) for values in comparison.metrics.values()]
    shown = shown.append("difference", [absolute for absolute, _ in differences], "number")
    return shown.append("", [relative for _, relative in differences], "number")


def _metric_difference(a: float | None, b: float | None) -> tuple[str, str]:
    if a is None or b is None:
        return "none" if a is b else "-", ""
    if a == b:
        return "none", ""
    part = f"{100.0 * (b - a) / abs(a):+.3g} %" if a else ""
    return f"{b - a:+.4g}", part


def _by_tolerance(comparison: Comparison, other: RunComparison, rtol: float, atol: float) -> str:
    head = ["", "largest difference", "", "at [s]", "rms", "beyond tolerance"]
    rows: list[list[str]] = []
    beyond = 0
    for pair in other.pairs:
        columns = pair.columns(rtol, atol)
        beyond += any(column.beyond for column in columns)
        rows += _column_rows(pair, columns)
    first, label = comparison.labels[0], other.run.label
    compared = [pair for pair in other.pairs if not pair.fault]
    message = f"within {atol:g} + {rtol:g} |x|" if rtol else f"within {atol:g}"
    count = len(compared) - beyond
    verdict = f"{count} of {len(compared)} probes are equal {message}"
    lines = [f"probes: {label} against {first}: {verdict}"]
    if rows:
        lines.append(Table.of(head, rows, numbers=(1, 3, 4)).text())
    return "\n".join([*lines, *_list_unequal(comparison, other)])


def _column_rows(pair: Pair, columns: Sequence[Column]) -> Iterator[list[str]]:
    """A line for each column, or for the one of many that differs most."""
    if not columns:
        return
    if len(columns) > LISTED:
        worst = max(columns, key=lambda column: column.largest)
        which = f"largest difference in {worst.label}" if worst.largest else "all equal"
        chosen = [(f"{pair.name}: {len(columns)} columns, {which}", worst)]
    else:
        chosen = [(column.label, column) for column in columns]
    for label, column in chosen:
        if not column.largest:
            yield [label, "none", "", "", "", ""]
            continue
        since = "" if column.since is None else f"from {column.since:.6g} s"
        if column.beyond:
            since += f", {column.beyond} of {len(pair.t)} rows"
        yield [
            label,
            number(column.largest),
            column.unit,
            f"{column.at:.6g}",
            number(column.rms),
            since,
        ]


def _by_bits(comparison: Comparison, other: RunComparison) -> str:
    first, label = comparison.labels[0], other.run.label
    differences = other.first_differences
    recorded = _list_unequal(comparison, other)
    if not differences:
        equal = f"probes: {label} against {first}: "
        equal += "every bit is equal" if not recorded else "all bits that both recorded are equal"
        return "\n".join([equal, *recorded])
    pair, first_difference = differences[0]
    lines = [
        f"probes: {label} against {first}: first difference at tick {first_difference.tick} "
        f"(t = {first_difference.t:.9g} s) in probe '{pair.name}'"
    ]
    head = ["", "first at tick", "t [s]", "column", first, label, "rows that differ"]
    rows = []
    for pair, at in differences:
        values = [repr(value) for value in at.values]
        count = f"{pair.differing} of {len(pair.t)}"
        rows.append([pair.name, str(at.tick), f"{at.t:.9g}", at.column, *values, count])
    lines.append(Table.of(head, rows, numbers=(1, 2, 4, 5, 6)).text())
    same = [pair.name for pair in other.pairs if not pair.fault and pair.first_difference is None]
    if same:
        lines.append(f"  identical: {', '.join(same)}")
    return "\n".join([*lines, *recorded])


def _list_unequal(comparison: Comparison, other: RunComparison) -> list[str]:
    """Probes that only one run recorded, or at other times, a line each."""
    first, label = comparison.labels[0], other.run.label
    lines = [f"  {name}: not recorded by {who}" for name, who in other.missing.items()]
    for pair in other.pairs:
        if pair.fault:
            lines.append(f"  {pair.name}: not comparable: {pair.fault}")
        elif not pair.is_whole:
            rows = f"{pair.rows[0]} rows in {first}, {pair.rows[1]} in {label}"
            lines.append(f"  {pair.name}: {rows}; compared at {len(pair.t)} common times")
    return lines


def as_data(comparison: Comparison, exact: bool, rtol: float, atol: float) -> dict[str, Any]:
    """A comparison as plain values for JSON.

    Infinities and NaN are written as in YAML: ".inf", "-.inf", ".nan".
    """
    labels = comparison.labels
    data = {
        "schema_version": SCHEMA_VERSION,
        "kind": "comparison",
        "runs": [
            {
                "label": run.label,
                "folder": str(run.folder),
                **{key: run.result.manifest[key] for key in ("graph", "seed", "status", "ticks")},
            }
            for run in comparison.runs
        ],
        "graph": [_difference(labels, item) for item in comparison.graph],
        "circumstances": [_difference(labels, item) for item in comparison.circumstances],
        "metrics": {
            name: dict(zip(labels, values, strict=True))
            for name, values in comparison.metrics.items()
        },
        "against": labels[0],
        "probes": {
            other.run.label: _exact_data(other) if exact else _tolerance_data(other, rtol, atol)
            for other in comparison.others
        },
    }
    plain: dict[str, Any] = _plain(data)
    return plain


def _difference(labels: Sequence[str], item: KeyDifference) -> dict[str, Any]:
    """A difference; values has no entry for a run without the path."""
    pairs = zip(labels, item.values, strict=True)
    values = {label: value for label, value in pairs if value is not ABSENT}
    return {"path": item.path, "change": item.change, "values": values}


def _exact_data(other: RunComparison) -> dict[str, Any]:
    differences = [
        {
            "probe": pair.name,
            **asdict(at),
            "rows": len(pair.t),
            "rows_differing": pair.differing,
        }
        for pair, at in other.first_differences
    ]
    return {
        "identical": other.is_same,
        "first": differences[0] if differences else None,
        "differences": differences,
        **_unequal_recordings(other),
    }


def _tolerance_data(other: RunComparison, rtol: float, atol: float) -> dict[str, Any]:
    probes = []
    for pair in other.pairs:
        columns = pair.columns(rtol, atol)
        worst = max(columns, key=lambda column: column.largest, default=None)
        listed = columns if len(columns) <= LISTED_IN_JSON else [worst]
        probes.append(
            {
                "probe": pair.name,
                "rows": len(pair.t),
                "within": not pair.fault and not any(column.beyond for column in columns),
                "columns": [asdict(column) for column in listed if column is not None],
            }
        )
    return {"rtol": rtol, "atol": atol, "probes": probes, **_unequal_recordings(other)}


def _unequal_recordings(other: RunComparison) -> dict[str, Any]:
    """Probes that only one run recorded, or at other times."""
    partial = [pair for pair in other.pairs if not pair.is_whole]
    return {"missing": other.missing, "recorded_otherwise": [_partial(p) for p in partial]}


def _partial(pair: Pair) -> dict[str, Any]:
    return {
        "probe": pair.name,
        "rows": list(pair.rows),
        "shared_rows": len(pair.t),
        "fault": pair.fault or None,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return value
