"""Messages as data: a sentence with its kind, and with what would correct the problem.

In: what is wrong and what would correct it. Out: a string that carries both::

    message = misspelt("unknown-output", "'a' has no output 'pos'", "pos", ["pose"])
    message           # "'a' has no output 'pos', did you mean 'pose'?"
    message.kind      # "unknown-output"
    message.fixes     # (Replace(new="pose", old="pos"),)

A message is a string, so that it can be raised, compared and printed like one; a part of it, or two
messages joined, is a plain string without a kind.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Self

KINDS = {
    "invalid-yaml": "the file cannot be read as YAML",
    "invalid-value": "a value that cannot stand where it is written",
    "missing-value": "an entry that is required",
    "missing-type": "a block without a type",
    "missing-file": "a file that cannot be read",
    "missing-world": "a world that a block or plot needs",
    "null-value": "null where nothing is to be deleted",
    "no-blocks": "a graph or part without blocks",
    "too-large": "more than a limit allows",
    "unknown-key": "a key that is not one of a section",
    "unknown-parameter": "a parameter that a block does not have",
    "unknown-type": "a type of block, signal, plot or metric that does not exist",
    "unknown-block": "a block or part that does not exist",
    "unknown-input": "an input that a block or part does not have",
    "unknown-output": "an output that a block or part does not have",
    "unknown-param": "a name behind $ that is not one of params",
    "unknown-probe": "a probe that does not exist",
    "unknown-name": "another name that does not exist",
    "unused-param": "an entry of params that nothing uses",
    "open-input": "an input that is not connected",
    "open-type": "a signal type or a length that nothing determines",
    "type-mismatch": "a wire between different signal types",
    "unit-mismatch": "a wire between different units",
    "algebraic-loop": "an output that needs itself in the same tick",
    "block-failed": "what the code of a block raised",
    "pending": "what is not known yet, such as what a module that is being imported defines",
    "maybe-degrees": "an angle that may be meant in degrees",
    "not-wired": "a block that moves though nothing is wired to it",
    "not-used": "an entry without effect",
    "short-pulse": "a pulse that is shorter than a tick",
    "passes-walls": "a body that nothing stops or measures at the walls of the world",
    "block-note": "what a block says of its place in the graph",
    "not-recorded": "a signal of a block that is removed",
    "starts-anew": "a block that does not begin from the states of an earlier run",
    "not-reached": "a metric that needs a longer run",
    "changed": "what else a change of the graph has changed",
    "run": "what happened in a run, or follows from it",
}


@dataclass(frozen=True)
class Replace:
    """Write ``new`` in place of ``old``, a part of what is written; '' for all of it."""

    new: str
    old: str = ""
    title: str = ""


@dataclass(frozen=True)
class AddEntry:
    """Add an entry to the mapping at ``path``, which is made if it is not there."""

    path: tuple[str, ...]
    key: str
    value: str
    title: str


@dataclass(frozen=True)
class RemoveEntry:
    """Remove the entry that the problem is about."""

    title: str


@dataclass(frozen=True)
class BypassBlock:
    """List a block in ``bypass``, and no longer in ``without``."""

    block: str


@dataclass(frozen=True)
class InsertBlock:
    """Put a block of a type, named after its consumer, on the wire into ``target``."""

    type: str
    target: str


Fix = Replace | AddEntry | RemoveEntry | BypassBlock | InsertBlock
_ACTIONS = {
    Replace: "replace",
    AddEntry: "add",
    RemoveEntry: "remove",
    BypassBlock: "bypass",
    InsertBlock: "insert-block",
}


def plain_fix(fix: Fix) -> dict[str, Any]:
    """A fix as JSON has it."""
    return {"action": _ACTIONS[type(fix)], **asdict(fix)}


class Message(str):
    """A sentence about a problem, of a kind of :data:`KINDS`, with the fixes that it suggests."""

    kind: str
    fixes: tuple[Fix, ...]

    def __new__(cls, text: str, kind: str = "invalid-value", fixes: Iterable[Fix] = ()) -> Self:
        if kind not in KINDS:
            raise ValueError(f"'{kind}' is not a kind of message; the kinds are in KINDS")
        message = super().__new__(cls, text)
        message.kind, message.fixes = kind, tuple(fixes)
        return message

    def within(self, before: str = "", after: str = "") -> Message:
        """The message as a part of a longer sentence."""
        return Message(f"{before}{self}{after}", self.kind, self.fixes)


def as_message(text: str) -> Message:
    """The message itself, or a sentence as one of the kind that needs no other."""
    return text if isinstance(text, Message) else Message(text)


def message_of(error: BaseException) -> Message:
    """The message that an error was raised with."""
    first = error.args[0] if error.args else None
    return first if isinstance(first, Message) else Message(str(error))


def suggestion(names: Sequence[str]) -> str:
    """``, did you mean 'a' or 'b'?``; '' if there are none."""
    return f", did you mean {' or '.join(map(repr, names))}?" if names else ""


class Note(Message):
    """Something noteworthy about a graph that can run.

    address : of the entry that it is about, which stands before the text. block : the name of the
    block, '' for the whole graph. name : what the text quotes of the file.
    """

    address: str
    block: str
    name: str

    def __new__(
        cls,
        text: str,
        kind: str = "changed",
        address: str = "",
        block: str = "",
        name: str = "",
        fixes: Iterable[Fix] = (),
    ) -> Self:
        note = super().__new__(cls, f"{address}: {text}" if address else text, kind, fixes)
        note.address, note.block, note.name = address, block, name
        return note

    @property
    def text(self) -> str:
        """The note without its address."""
        return str(self).removeprefix(f"{self.address}: ") if self.address else str(self)

    def plain(self) -> dict[str, Any]:
        """The note as JSON has it."""
        return {
            "message": str(self),
            "kind": self.kind,
            "address": self.address,
            "block": self.block,
            "fixes": [plain_fix(fix) for fix in self.fixes],
        }


def as_note(text: str) -> Note:
    """The note itself, or a sentence about a run as one."""
    return text if isinstance(text, Note) else Note(text, "run")
