"""Errors and problems, each with its location and a suggested fix; exit codes are the CLI's.

In: what a room finds wrong, with its position in the file and its address in the graph. Out: one
exception with all of it, sorted::

    problems.add(node.where, "blocks.lqr.q", "expected 3 numbers, got 2")
    problems.raise_any()    # GraphError: line.yaml:14:7: blocks.lqr.q: expected 3 numbers, got 2
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from blocks.foreign import ROOT as ROOT
from blocks.foreign import raised_at as raised_at
from blocks.foreign import raised_text as raised_text
from blocks.foreign import text_of as text_of
from blocks.limits import PROBLEMS
from blocks.messages import Fix, as_message, plain_fix


@dataclass(frozen=True, order=True, slots=True)
class Where:
    """A position in a file: line and column count from 1; line 0 stands for the whole file."""

    file: str = ""
    line: int = 0
    column: int = 0

    def __str__(self) -> str:
        if not self.line or self.file.startswith("--"):
            return self.file  # changes on the command line have no lines
        return f"{self.file}:{self.line}:{self.column}"


NOWHERE = Where()
# Where something is written, and its address in the graph: 'blocks.lqr.q', or '' for the whole.
Location = tuple[Where, str]
# Nobody reads more, and a generated graph can have the same mistake a million times.
MAX_PROBLEMS = PROBLEMS
# Kinds of problems about a name that does not exist.
KEYS = {"unknown-key", "unknown-parameter"}
NAMES = KEYS | {"unknown-block", "unknown-input", "unknown-output"}


@dataclass(frozen=True, order=True)
class Problem:
    """One thing that is wrong: its position, its address in the graph, and how to fix it.

    ``kind`` is one of ``KINDS`` in ``blocks.messages``, by default that of the text. ``fixes`` are
    what the text suggests, as data.
    """

    where: Where
    address: str
    text: str
    kind: str = field(default="", compare=False)
    fixes: tuple[Fix, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        message = as_message(self.text)
        object.__setattr__(self, "kind", self.kind or message.kind)
        object.__setattr__(self, "fixes", self.fixes or message.fixes)

    @property
    def is_name(self) -> bool:
        """Whether a name does not exist, which no later change can correct."""
        # What is recorded may be a signal of a block that is added later.
        is_recorded = self.address.startswith(("probes.", "plots.", "metrics.", "run.stop"))
        return self.kind in (KEYS if is_recorded else NAMES)

    @property
    def is_pending(self) -> bool:
        """Whether it is not known yet, and goes away by itself."""
        return self.kind == "pending"

    def plain(self) -> dict[str, Any]:
        """The problem as JSON has it."""
        return {
            "where": str(self.where),
            "address": self.address,
            "message": str(self.text),
            "kind": self.kind,
            "fixes": [plain_fix(fix) for fix in self.fixes],
        }

    def __str__(self) -> str:
        line = ": ".join(part for part in (str(self.where), self.address, self.text) if part)
        return one_line(line)


def one_line(text: str) -> str:
    """A string as one line: characters that cannot be printed are escaped."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class SpikeblocksError(Exception):
    """Base of all errors that are reported to users; ``exit_code`` is what the CLI returns."""

    exit_code = 2

    def __reduce__(self) -> tuple[Any, ...]:
        # Errors cross processes; BaseException would call the class with the message alone.
        return _rebuild_error, (type(self), self.args, self.__dict__)


def _rebuild_error(
    cls: type[SpikeblocksError], args: tuple[Any, ...], attributes: dict[str, Any]
) -> SpikeblocksError:
    error = cls.__new__(cls, *args)
    error.__dict__.update(attributes)
    return error


class UsageError(SpikeblocksError):
    """A command or a call was given an argument that it cannot use."""


class GraphError(SpikeblocksError):
    """A graph that cannot run; ``problems`` lists everything wrong in the order of the file."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        # A part that is used ten times is checked ten times, and its mistake is one: equal problems
        # are.
        self.problems = sorted(set(problems))
        super().__init__("\n".join(map(str, self.problems)))


class SimulationError(SpikeblocksError):
    """A run that failed: in which block, at which tick and time, which is in ``unit``.

    ``result`` holds what was recorded up to then.
    """

    exit_code = 3

    def __init__(self, block: str, tick: int, time: float, text: str, unit: str = "s") -> None:
        self.block, self.tick, self.time = block, tick, time
        self.result: object = None
        place = f"block '{block}' at tick" if block else "tick"
        super().__init__(f"{place} {tick} (t = {time:g} {unit}): {text}")


class NotCopiedError(Exception):
    """A block keeps something that cannot be copied: the text says where and why."""


class MissingExtraError(SpikeblocksError):
    """A feature needs a package that is not installed."""

    exit_code = 4

    def __init__(self, feature: str, extra: str) -> None:
        from blocks.core import pip_line  # it loads NumPy, which --help does without

        super().__init__(f"{feature} needs an optional extra: {pip_line(extra)}")


class MissingLibraryError(SpikeblocksError):
    """A feature needs a system library that is not installed; the message names it."""

    exit_code = 4


@dataclass
class Problems:
    """Collects problems, so that all are reported at once, up to :data:`MAX_PROBLEMS`.

    A value at a silenced location is unknown for a reason that is reported already; further
    problems of it would only distract from that reason.
    """

    items: list[Problem] = field(default_factory=list)
    _silent: set[Where | str] = field(default_factory=set)

    def add(self, where: Where, address: str, text: str, kind: str = "") -> None:
        if where not in self._silent and address not in self._silent:
            self.items.append(Problem(where, address, text, kind))
            if len(self.items) > MAX_PROBLEMS:
                message = f"more than {MAX_PROBLEMS} problems; these are the first"
                raise GraphError([Problem(NOWHERE, "", message, "too-large"), *self.items])

    def wait(self, where: Where, address: str, text: str) -> None:
        """Add what is not known yet, which is no mistake."""
        self.items.append(Problem(where, address, text, "pending"))

    def silence(self, where: Where, address: str) -> None:
        """Ignore further problems of the value here, and of lists that contain it."""
        if where.line:
            self._silent.add(where)
        # If terms[2] is unknown, what is wrong with terms as a whole (their number) may be its
        # fault.
        while address.endswith("]"):
            self._silent.add(address)
            address = address[: address.rindex("[")]
        self._silent.add(address)

    def raise_any(self) -> None:
        if self.items:
            raise GraphError(self.items)
