"""What a key of the section ``run`` is declared with, and the forms that a value may have.

In: a value as it is written. Out: the value as a run uses it, or None and a problem::

    TIME.read(node, "until", {}, problems)        # 5.0
    # line.yaml:2:13: run.until: expected a number of seconds above 0, got 'long'
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from blocks.core import misspelt
from runtime.document.node import Node
from runtime.document.scalars import parse_scalar
from runtime.document.sections import check_keys
from runtime.errors import Problems
from runtime.solvers import ADAPTIVE, SOLVERS, listed

MAX_TICKS = 10**12
STOP_DOCS = {
    "when": "a scalar signal",
    "above": "the level that ends the run when the signal rises above it",
    "below": "the level that ends the run when the signal falls below it",
    "crosses": "the level that ends the run when the signal passes it",
    "direction": "which way it crosses: rising, falling or either",
}
STOPS = ("above", "below", "crosses")
DIRECTIONS = ("either", "rising", "falling")
UNITS = {"": 1, "K": 1024, "M": 1024**2, "G": 1024**3}
Schema = Mapping[str, Any]
# Reads a node, given the key and what was read before; None if it is wrong, which is reported.
Read = Callable[[Node, str, Mapping[str, Any], Problems], Any]


@dataclass(frozen=True)
class Form:
    """A form of values: how they are read, and their JSON Schema."""

    read: Read
    schema: Schema
    choices: Collection[str] = ()


@dataclass(frozen=True)
class RunKey:
    """A key of the section, as a field of ``RunSection`` declares it.

    form : what its value may be.
    doc : what it is, in a line, as editors and the schema show it; more : what the documentation
        says beyond that.
    default, shown : what holds where it is not written, and how the documentation shows that.
    acts : the file that makes the difference; also : what other tools call the key.
    """

    form: Form
    doc: str
    default: Any
    shown: str
    acts: str
    more: str = ""
    also: tuple[str, ...] = ()


def run_key(
    default: Any,
    form: Form,
    doc: str,
    *,
    acts: str,
    shown: str = "",
    more: str = "",
    also: str = "",
) -> Any:
    """The field of a key, for ``RunSection``; ``also`` has words with spaces between them."""
    shown = shown or (f"{default:g}" if isinstance(default, float) else str(default))
    declared = RunKey(form, doc, default, shown, acts, more, tuple(also.split()))
    return field(default=default, metadata={"key": declared})


@dataclass(frozen=True)
class Stop:
    """What ends a run early: the signal ``when`` rises above a level, falls below it, or either."""

    when: str
    kind: str
    level: float
    direction: str
    node: Node = field(compare=False, repr=False)

    def entries(self) -> dict[str, float | str]:
        """The entry of the section."""
        entries: dict[str, float | str] = {"when": self.when, self.kind: self.level}
        is_told = self.kind == "crosses" and self.direction != DIRECTIONS[0]
        return entries | ({"direction": self.direction} if is_told else {})


def seconds(node: Node, address: str, problems: Problems) -> float | None:
    """A positive number of seconds; None, and a problem, for anything else."""
    value = node.value
    # In Python true is an int.
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < math.inf:
        return float(value)
    message = f"expected a number of seconds above 0, got {node.describe()}"
    problems.add(node.where, address, message)
    return None


def read_seed(node: Node | None, address: str, problems: Problems) -> int | None:
    """The seed of a run, a part or a block; None if there is none, or a wrong one."""
    if node is None:
        return None
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    message = f"expected a non-negative integer, got {node.describe()}"
    problems.add(node.where, address, message)
    return None


def one_of(choices: Collection[str]) -> Form:
    """One of a few words, or of the names of a table."""

    def read(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> str | None:
        if isinstance(node.value, str) and node.value in choices:
            return node.value
        shown = repr(node.value) if isinstance(node.value, str) else node.describe()
        text, other = f"there is no {key} {shown}", f"; expected {', '.join(choices)}"
        message = misspelt("invalid-value", text, node.value, choices, other)
        problems.add(node.where, f"run.{key}", message)
        return None

    return Form(read, {"enum": list(choices)}, choices)


def _time(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> float | None:
    return seconds(node, f"run.{key}", problems)


def _seed(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> int | None:
    return read_seed(node, f"run.{key}", problems)


def _tolerance(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> float | None:
    """A number above 0, for a solver that chooses its own steps."""
    value, solver = node.value, before["solver"]
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not SOLVERS[solver].is_adaptive:
        message = f"solver: {solver} takes one step per tick; {key} is for {listed(ADAPTIVE)}"
        problems.add(node.key, f"run.{key}", message)
    elif not is_number or not 0.0 < value < math.inf:
        message = f"expected a number above 0, got {node.describe()}"
        problems.add(node.where, f"run.{key}", message)
    else:
        return float(value)
    return None


def _keep(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> float | None:
    if node.value is None:
        return None
    unit = before["time_unit"]
    # As --checkpoint 60s has it; nothing is converted.
    try:
        value = parse_scalar(str(node.value).removesuffix(unit).strip())
    except ValueError:  # out of a float's range
        value = math.inf
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < math.inf:
        return float(value)
    message = f"expected a time above 0, as in 60 or 60{unit}: that of the recordings that is kept"
    problems.add(node.where, f"run.{key}", f"{message}; got {node.describe()}")
    return None


def _bytes(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> int | None:
    match = re.fullmatch(r"([1-9][0-9]*)([KMG]?)", str(node.value))
    if match is None or isinstance(node.value, bool):
        message = "expected a size in bytes for recordings, such as 512M or 2G"
        problems.add(node.where, f"run.{key}", f"{message}, got {node.describe()}")
        return None
    return int(match[1]) * UNITS[match[2]]


def _stop(node: Node, key: str, before: Mapping[str, Any], problems: Problems) -> Stop | None:
    if node.value is None:
        return None
    address, example = f"run.{key}", "as in {when: plant.contact, above: 0.5}"
    if not node.is_map:
        problems.add(node.where, address, f"expected {example[6:]}, got {node.describe()}")
        return None
    check_keys(node, tuple(STOP_DOCS), address, problems, "key")
    when, kinds = node.get("when"), [kind for kind in STOPS if node.get(kind) is not None]
    if when is None or not isinstance(when.value, str):
        where = node.where if when is None else when.where
        problems.add(where, f"{address}.when", f"expected the address of a number, {example}")
        return None
    # Two levels would need a rule for which of them ends the run.
    if len(kinds) != 1:
        message = f"expected one of {', '.join(STOPS)}, {example}"
        problems.add(node.where, address, message)
        return None
    level = node.get(kinds[0]) or Node(None)
    if not isinstance(level.value, (int, float)) or not abs(level.value) < math.inf:
        message = f"expected a number, got {level.describe()}"
        problems.add(level.where, f"{address}.{kinds[0]}", message)
        return None
    known = {"above": "rising", "below": "falling"}
    direction, wanted = known.get(kinds[0], DIRECTIONS[0]), node.get("direction")
    if wanted is not None and kinds[0] in known:
        message = f"'{kinds[0]}' is one direction already; it is for 'crosses'"
        problems.add(wanted.where, f"{address}.direction", message)
    elif wanted is not None and wanted.value not in DIRECTIONS:
        message = f"expected {', '.join(DIRECTIONS)}, got {wanted.describe()}"
        problems.add(wanted.where, f"{address}.direction", message)
    elif wanted is not None:
        direction = wanted.value
    return Stop(when.value, kinds[0], float(level.value), direction, when)


ABOVE_ZERO: Schema = {"type": "number", "exclusiveMinimum": 0}
TIME = Form(_time, ABOVE_ZERO)
SEED = Form(_seed, {"type": "integer", "minimum": 0})
TOLERANCE = Form(_tolerance, ABOVE_ZERO)
KEPT = Form(_keep, {"type": ["number", "string"]})
BYTES = Form(_bytes, {"type": ["integer", "string"]})
STOP = Form(
    _stop,
    {
        "type": "object",
        "properties": {key: {"description": doc} for key, doc in STOP_DOCS.items()},
        "additionalProperties": False,
    },
)
