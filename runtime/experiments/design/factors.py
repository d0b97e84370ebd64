"""Factors: a path into the graph and the values that a sweep gives it.

In: what stands after ``vary: path``. Out: :class:`Factor` or :class:`Range`::

    [1, 2, 3]           ->  three values
    [{type: LQR}, {graph: pid.yaml}]  ->  two blocks, each in place of what is there
    0.1..0.9:5          ->  0.1, 0.3, 0.5, 0.7, 0.9
    log(1e-5..1e-2)     ->  any value between, for samples: the logarithm is uniform
    int(1..9):3         ->  1, 5, 9
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blocks.core import show
from runtime.document import Node, find_file, flow_yaml, parse_scalar, parse_yaml, read_graph
from runtime.errors import GraphError, Problems

_RANGE = re.compile(
    r"(?:(?P<scale>log|int)\(\s*(?P<inner>[^()]*)\)|(?P<plain>[^():]*))(?::\s*(?P<count>[0-9]{1,9}))?"
)
EDGE = 0.02  # of a range: a best value that near to an end says that better ones may lie beyond
EXPECTED = "expected values such as [1, 2, 3], 0.1..0.9:5, log(1e-5..1e-2):7 or int(1..9):3"
DIGITS = 12


@dataclass(frozen=True)
class Factor:
    """A path into the graph, and a list of values for it."""

    path: str
    values: tuple[Any, ...]

    @property
    def written(self) -> Any:
        """The values as written in an experiment file."""
        return list(self.values)

    @property
    def count(self) -> int:
        """The number of values in a grid; 0 for a range without steps, which must be sampled."""
        return len(self.values)

    def value(self, i: int) -> Any:
        """The i-th value of a grid."""
        return self.values[i]

    def at(self, u: float) -> Any:
        """The value at a quantile, 0 <= u < 1."""
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]

    def test_values(self) -> list[Any]:
        """Values that show whether the graph accepts this factor."""
        return list(self.values)


@dataclass(frozen=True)
class Range(Factor):
    """A factor with numbers from ``low`` to ``high``: all of them, or ``steps`` of them."""

    low: float
    high: float
    scale: str
    steps: int

    @property
    def written(self) -> Any:
        ends = f"{_end(self.low)}..{_end(self.high)}"
        text = f"{self.scale}({ends})" if self.scale else ends
        return f"{text}:{self.steps}" if self.steps else text

    @property
    def count(self) -> int:
        return self.steps

    def value(self, i: int) -> Any:
        return self._between(i / (self.steps - 1))

    def at(self, u: float) -> Any:
        if self.steps:
            return self.value(min(int(u * self.steps), self.steps - 1))
        if self.scale == "int":
            return int(min(self.low + math.floor(u * (self.high - self.low + 1)), self.high))
        return self._between(u)

    def test_values(self) -> list[Any]:
        if not self.steps:
            return [self.at(u) for u in (0.0, 0.5, 1.0)]
        return [self.value(i) for i in {0, self.steps // 2, self.steps - 1}]

    def end_near(self, value: float) -> str:
        """``lower`` or ``upper`` if a value lies at that end of the range; else empty."""
        low, high, at = float(self.low), float(self.high), float(value)
        if self.scale == "log":
            low, high, at = math.log(low), math.log(high), math.log(at)
        share = (at - low) / (high - low)
        return "lower" if share < EDGE else "upper" if share > 1.0 - EDGE else ""

    def _between(self, u: float) -> Any:
        """The number at the fraction ``u`` of the range; 0 and 1 give the ends exactly."""
        if self.scale == "log":
            low, high = math.log(self.low), math.log(self.high)
            number = math.exp(low + u * (high - low))
        else:
            number = self.low + u * (self.high - self.low)
        if self.scale == "int":
            return round(number)
        if u in (0.0, 1.0):
            return float(self.high if u else self.low)
        # 0.1..0.9:5 means 0.3, not 0.30000000000000004.
        number = float(f"{number:.{DIGITS}g}")
        return min(max(number, float(self.low)), float(self.high))


def _end(number: float) -> str:
    return flow_yaml(number)


def parse_factor(path: str, node: Node, address: str, problems: Problems) -> Factor | None:
    """The factor that an entry of ``vary`` describes; None and a problem if it is invalid."""
    message: str | Factor = f"{EXPECTED}, got {node.describe()}"
    if node.is_list:
        try:
            message = _choice(path, node, address)
        except GraphError as error:
            problems.items += error.problems
            return None
    elif isinstance(node.value, str):
        message = _range(path, node.value)
    if isinstance(message, Factor):
        return message
    problems.add(node.where, address, message)
    return None


def plain_value(node: Node, address: str) -> Any:
    """What is written, a part that it names in full: a worker has only what a trial holds.

    Raises
    ------
    GraphError : the part's file does not exist, or is wrong.
    """
    part = node.get("graph") if node.is_map else None
    if part is None or not isinstance(part.value, str):
        return node.plain()
    file = find_file(part.value, (part.where, address), Path(part.where.file).parent)
    document, _ = read_graph({"blocks": {"part": {**node.plain(), "graph": str(file.resolve())}}})
    block = document.get("blocks")
    return None if block is None else block.value["part"].plain()


def value_label(text: str) -> str:
    """A value, given as YAML, as tables and figures show it: of a block its type, or its part."""
    if not text.startswith("{"):
        return text
    value = parse_yaml(text, "value").plain()
    name = value.pop("part", None) or value.pop("type", None)
    others = {k: v for k, v in value.items() if not isinstance(v, dict)}
    rest = ", ".join(f"{key}={flow_yaml(v)}" for key, v in others.items())
    return text if name is None else f"{name} ({rest})" if rest else str(name)


def _choice(path: str, node: Node, address: str) -> Factor | str:
    values = [plain_value(item, f"{address}[{i}]") for i, item in enumerate(node.value)]
    texts = [flow_yaml(value) for value in values]
    if not values:
        return f"an empty list; {EXPECTED}"
    for i, text in enumerate(texts):
        if text in texts[:i]:
            return f"duplicate value {show(values[i])}"
    return Factor(path, tuple(values))


def _range(path: str, text: str) -> Factor | str:
    match = _RANGE.fullmatch(text.strip())
    inner = (match["inner"] if match["scale"] else match["plain"]) if match else ""
    low_text, dots, high_text = (inner or "").partition("..")
    if match is None or not dots:
        listed = f"; a list needs brackets: [{text}]" if "," in text and len(text) < 40 else ""
        return f"{EXPECTED}, got the string '{text[:40]}'{listed}"
    scale, steps = match["scale"] or "", int(match["count"] or 0)
    try:
        low, high = (parse_scalar(end.strip()) for end in (low_text, high_text))
    except ValueError as error:
        return f"'{text[:40]}': {error}"
    message = _wrong_ends(low, high, scale) or _wrong_steps(low, high, scale, steps, match["count"])
    return f"'{text[:60]}': {message}" if message else Range(path, (), low, high, scale, steps)


def _wrong_ends(low: Any, high: Any, scale: str) -> str:
    for end in (low, high):
        if isinstance(end, bool) or not isinstance(end, (int, float)) or not math.isfinite(end):
            return f"expected numbers as the ends of a range, got {show(end)}"
        if scale == "int" and not isinstance(end, int):
            return f"expected integers in int(...), got {show(end)}"
        if scale == "log" and end <= 0:
            return f"expected ends above 0 in log(...), got {show(end)}"
    return f"the range is empty: {show(low)} is not below {show(high)}" if low >= high else ""


def _wrong_steps(low: Any, high: Any, scale: str, steps: int, written: str | None) -> str:
    if written is not None and steps < 2:
        return f"expected at least two values, got :{written}"
    if scale == "int" and steps > high - low + 1:
        return f"there are only {high - low + 1} integers from {low} to {high}"
    return ""
