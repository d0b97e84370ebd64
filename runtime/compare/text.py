"""A comparison for people: tables of what differs, and a sentence on where it begins."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from runtime.compare.comparison import Compared, Comparison
from runtime.compare.documents import Difference, text_of
from runtime.compare.probes import Column, Pair

FEW = 6  # columns of a probe that have a line each
VALUE = 40  # letters of a graph's value
SIGNS = {"added": "+", "removed": "-", "changed": "~"}


def summary(comparison: Comparison, rtol: float, atol: float) -> str:
    """All that was found, differences of probes by tolerance."""
    parts = [*_common(comparison)]
    parts += [_by_tolerance(comparison, other, rtol, atol) for other in comparison.others]
    return "\n\n".join(parts)


def exact_summary(comparison: Comparison) -> str:
    """All that was found, and where the bits of the probes part."""
    parts = [*_common(comparison)]
    parts += [_by_bits(comparison, other) for other in comparison.others]
    return "\n\n".join(parts)


def number(value: float | None) -> str:
    """A number for people: four digits, or a dash where there is none."""
    return "-" if value is None or math.isnan(value) else f"{value:.4g}"


def table(rows: Sequence[Sequence[str]], numbers: Sequence[int] = ()) -> str:
    """Rows as aligned columns, the first two letters of each line left free.

    Parameters
    ----------
    rows : the head first.
    numbers : the columns that are aligned at their right.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            text.rjust(width) if i in numbers else text.ljust(width)
            for i, (text, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append(("  " + "  ".join(cells)).rstrip())
    return "\n".join(lines)


def _common(comparison: Comparison) -> Iterator[str]:
    rows = [[run.label, run.result.title, str(run.folder)] for run in comparison.runs]
    yield "runs\n" + table(rows)
    for title, found in (
        ("graph", comparison.graph),
        ("circumstances", comparison.circumstances),
    ):
        if found:
            yield f"{title}\n{_documents(comparison.labels, found)}"
        else:
            yield f"{title}: no difference"
    if comparison.metrics:
        yield f"metrics\n{_metrics(comparison)}"


def _documents(labels: Sequence[str], found: Sequence[Difference]) -> str:
    rows = [["", *labels]]
    for item in found:
        values = [text_of(value, VALUE) for value in item.values]
        rows.append([f"{SIGNS[item.change]} {item.path}", *values])
    return table(rows)


def _metrics(comparison: Comparison) -> str:
    """One line a metric; with two runs, also what the second has more than the first."""
    pairs = len(comparison.runs) == 2
    head = ["", *comparison.labels, *(["difference", ""] if pairs else [])]
    rows = [head]
    for name, values in comparison.metrics.items():
        more = _more(*values) if pairs else []
        rows.append([name, *map(number, values), *more])
    return table(rows, range(1, len(head)))


def _more(a: float | None, b: float | None) -> list[str]:
    if a is None or b is None:
        return ["none" if a is b else "-", ""]
    if a == b:
        return ["none", ""]
    part = f"{100.0 * (b - a) / abs(a):+.3g} %" if a else ""
    return [f"{b - a:+.4g}", part]


def _by_tolerance(comparison: Comparison, other: Compared, rtol: float, atol: float) -> str:
    head = ["", "largest difference", "", "at [s]", "rms", "beyond tolerance"]
    rows = [head]
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
    if len(rows) > 1:
        lines.append(table(rows, (1, 3, 4)))
    return "\n".join([*lines, *_recorded(comparison, other)])


def _column_rows(pair: Pair, columns: Sequence[Column]) -> Iterator[list[str]]:
    """A line for each column, or for the worst of many."""
    if not columns:
        return
    if len(columns) > FEW:
        worst = max(columns, key=lambda column: column.largest)
        which = f"the worst of them {worst.label}" if worst.largest else "all alike"
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
            *(label, number(column.largest), column.unit),
            *(f"{column.at:.6g}", number(column.rms), since),
        ]


def _by_bits(comparison: Comparison, other: Compared) -> str:
    first, label = comparison.labels[0], other.run.label
    places = other.places
    recorded = _recorded(comparison, other)
    if not places:
        equal = f"probes: {label} against {first}: "
        equal += "every bit is equal" if not recorded else "all bits that both recorded are equal"
        return "\n".join([equal, *recorded])
    pair, place = places[0]
    lines = [
        f"probes: {label} against {first}: first difference at tick {place.tick} "
        f"(t = {place.t:.9g} s) in probe '{pair.name}'"
    ]
    rows = [["", "first at tick", "t [s]", "column", first, label, "rows that differ"]]
    for pair, place in places:
        values = [repr(value) for value in place.values]
        count = f"{pair.differing} of {len(pair.t)}"
        rows.append([pair.name, str(place.tick), f"{place.t:.9g}", place.column, *values, count])
    lines.append(table(rows, (1, 2, 4, 5, 6)))
    same = [pair.name for pair in other.pairs if not pair.fault and pair.first() is None]
    if same:
        lines.append(f"  equal to the bit: {', '.join(same)}")
    return "\n".join([*lines, *recorded])


def _recorded(comparison: Comparison, other: Compared) -> list[str]:
    """What the two did not record alike, a line each."""
    first, label = comparison.labels[0], other.run.label
    lines = [f"  {name}: not recorded by {who}" for name, who in other.missing.items()]
    for pair in other.pairs:
        if pair.fault:
            lines.append(f"  {pair.name}: not comparable: {pair.fault}")
        elif not pair.is_whole:
            rows = f"{pair.rows[0]} rows in {first}, {pair.rows[1]} in {label}"
            lines.append(f"  {pair.name}: {rows}; compared at the {len(pair.t)} times of both")
    return lines
