"""Variants against their baseline: the table of an ablation, as numbers and as text."""

from __future__ import annotations

import math
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from runtime.experiments.analysis.statistics import (
    CONFIDENCE,
    CORRECTION,
    TESTS,
    Difference,
    Estimate,
    Test,
    adjusted,
    difference,
    estimate,
    presence,
)

Values = Sequence[float | None]
LEVEL = 1.0 - CONFIDENCE


@dataclass(frozen=True)
class Line:
    """A metric of a variant.

    Parameters
    ----------
    runs : how many seeds there are; ``own.n`` of them gave a value.
    apart : the paired difference to the baseline; None for the baseline itself.
    p_adjusted : ``apart.p`` corrected for the number of comparisons in the table.
    p_presence : likewise, whether it has a value as often as the baseline has.
    is_gone : the variant does not record what the metric measures.
    """

    variant: str
    metric: str
    runs: int
    own: Estimate
    apart: Difference | None = None
    p_adjusted: float = math.nan
    p_presence: float = math.nan
    is_gone: bool = False

    @property
    def is_distinguishable(self) -> bool | None:
        """Whether the difference is told from zero; None where that cannot be asked."""
        if self.apart is None or math.isnan(self.p_adjusted):
            return None
        return self.p_adjusted < LEVEL

    @property
    def is_missing_differently(self) -> bool:
        """Whether the baseline has a value on another share of the seeds."""
        return self.p_presence < LEVEL

    def to_dict(self) -> dict[str, Any]:
        """The line as JSON holds it."""
        apart = self.apart
        line: dict[str, Any] = {
            "variant": self.variant,
            "metric": self.metric,
            "runs": self.runs,
            "recorded": not self.is_gone,
            **_plain(self.own),
            "difference": None,
        }
        if apart is not None:
            line["difference"] = {
                **_plain(apart),
                "p": _number(apart.p),
                "p_adjusted": _number(self.p_adjusted),
                "distinguishable": self.is_distinguishable,
                "p_presence": _number(self.p_presence),
            }
        return line


def compare(
    values: Mapping[str, Mapping[str, Values]],
    baseline: str,
    test: Test = "t",
    gone: Container[tuple[str, str]] = (),
) -> list[Line]:
    """The lines of the table, metric by metric, the baseline first.

    Parameters
    ----------
    values : for each variant and metric, one value a seed; all with the same seeds in one order.
    gone : (variant, metric) where what the metric measures was taken out.

    Both kinds of p value, of differences and of missing values, are corrected together: a table
    of many comparisons would else find some by chance.
    """
    lines = []
    for metric, base in values[baseline].items():
        for variant, columns in values.items():
            mine = columns[metric]
            own = estimate([value for value in mine if value is not None], test)
            line = Line(variant, metric, len(mine), own, is_gone=(variant, metric) in gone)
            if variant != baseline and not line.is_gone:
                differs = [a is None for a in mine] != [b is None for b in base]
                line = replace(
                    line,
                    apart=difference(mine, base, test),
                    p_presence=presence(mine, base) if differs else math.nan,
                )
            lines.append(line)
    compared = [line.apart.p if line.apart is not None else math.nan for line in lines]
    corrected = adjusted([*compared, *(line.p_presence for line in lines)])
    found = zip(lines, corrected[: len(lines)], corrected[len(lines) :], strict=True)
    return [replace(line, p_adjusted=p, p_presence=q) for line, p, q in found]


def _plain(estimate: Estimate) -> dict[str, Any]:
    ends = {name: _number(getattr(estimate, name)) for name in ("mean", "low", "high")}
    return {"n": estimate.n, **ends}


def _number(value: float) -> float | None:
    return None if math.isnan(value) else value


def table(lines: Sequence[Line]) -> str:
    """The table for people, metric by metric."""
    header = (
        "",
        "seeds",
        "mean",
        "95 % interval",
        "difference",
        "95 % interval",
        "distinguishable",
    )
    rows: list[tuple[str, ...]] = []
    metric = ""
    for line in lines:
        if line.metric != metric:
            metric = line.metric
            rows.append((metric,))
        rows.append(_cells(line))
    full = [row for row in rows if len(row) > 1]
    widths = [max(len(row[i]) for row in [header, *full]) for i in range(len(header))]
    widths[0] = max(widths[0], *(len(row[0]) for row in rows))
    message = []
    for row in (header, *rows):
        cells = [
            row[0].ljust(widths[0]),
            *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=False)),
        ]
        message.append("  ".join(cells).rstrip())
    return "\n".join(message)


def legend(lines: Sequence[Line], test: Test) -> str:
    """What the table's columns mean, as far as they need it."""
    message = [
        f"Intervals: 95 %, {TESTS[test]}. Differences are to the baseline on the same seed.",
        f"distinguishable: p < {LEVEL:.2g}, corrected by {CORRECTION} for all comparisons here.",
    ]
    if any(line.own.n < line.runs for line in lines):
        message.append(
            "n/N: n of N seeds have a value, or for a difference one in both; means are over those."
        )
    if any(line.is_missing_differently for line in lines):
        message.append("in seeds: another share of the seeds has a value at all (McNemar's test).")
    if any(line.is_gone for line in lines):
        message.append("gone: what the metric measures was taken out.")
    return "\n".join(message)


def _cells(line: Line) -> tuple[str, ...]:
    seeds = f"{line.own.n}/{line.runs}" if line.own.n < line.runs else str(line.runs)
    cells = [f"  {line.variant}", seeds, _value(line.own.mean), _ends(line.own)]
    if line.is_gone:
        cells += ["", "", "gone"]
    elif line.apart is not None:
        mean = _value(line.apart.mean, "+")
        if 0 < line.apart.n < line.runs:
            mean += f" ({line.apart.n}/{line.runs})"
        cells += [mean, _ends(line.apart, "+"), _verdict(line)]
    else:
        cells += ["", "", ""]
    return tuple(cells)


def _verdict(line: Line) -> str:
    if line.is_missing_differently:
        return "yes, in seeds"
    if line.apart is not None and line.apart.n and line.apart.mean == 0.0 and line.apart.p == 1.0:
        return "equal"
    return {True: "yes", False: "no", None: "-"}[line.is_distinguishable]


def _value(value: float, sign: str = "") -> str:
    return "-" if math.isnan(value) else f"{value:{sign}.4g}"


def _ends(found: Estimate, sign: str = "") -> str:
    if math.isnan(found.low):
        return "-"
    return f"[{found.low:{sign}.4g}, {found.high:{sign}.4g}]"
