"""The kind that an entry of ``metrics`` or ``plots`` names, in a registry or in a graph's file."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Generic, Protocol, TypeVar

from blocks.core import misspelt
from blocks.library.extensions import Registry
from blocks.library.registry import Modules
from blocks.messages import Message
from runtime.document import Node, check_keys, misspelt_keys
from runtime.errors import Problems
from runtime.network import own_object
from runtime.observation.other_names import OTHER_NAMES

NEEDS_WORLD = Message("needs a world, as in 'world: worlds/paper_room.yaml'", "missing-world")


class HasKeys(Protocol):
    """What a kind declares for the checks of its entries: the keys that they take."""

    @property
    def keys(self) -> tuple[str, ...]: ...


K = TypeVar("K", bound=HasKeys)


@dataclass(frozen=True)
class Chosen(Generic[K]):
    """The kind that an entry of ``plots`` or ``metrics`` names.

    Parameters
    ----------
    name : as written; '' if there is no such kind, which is reported.
    declared : the kind; None for none.
    keys : what the entry may have.
    files : those that were run for the kind, by resolved path.
    """

    name: str
    declared: K | None
    keys: tuple[str, ...]
    files: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def own(self) -> K | None:
        """The kind, if a file of the graph defines it."""
        return self.declared if self.files else None


def choose(
    kinds: Registry[K],
    node: Node,
    address: str,
    known: Callable[[str], tuple[str, ...]],
    problems: Problems,
    modules: Modules,
) -> Chosen[K] | None:
    """The kind of an entry, whose keys are checked; None if nothing more can be said about it.

    ``known`` are the kinds that a message should list, given the one that is written.
    """
    written, files = node.get("kind"), dict[str, bytes]()
    name = "" if written is None else str(written.plain())
    if node.get("module") is not None:
        definition: tuple[K, dict[str, bytes]] | None = own_object(
            node, kinds.kind, kinds.wanted, address, problems, modules
        )
        if definition is None:
            return None
        declared: K | None
        declared, files = definition
    else:
        declared = kinds.get(name)
        broken = "" if declared is not None else kinds.why_broken(name)
        if written is not None and broken:
            problems.add(written.where, f"{address}.kind", broken)
            return None
    candidates = kinds.values() if declared is None else [declared]
    every = ("kind", *(key for each in candidates for key in each.keys), "module")
    keys = tuple(dict.fromkeys(every))
    check_keys(node, keys, address, problems, "key")
    if declared is None:
        _report_kind(node, known(name), keys, f"{address}.kind", problems)
    return Chosen("" if declared is None else name, declared, keys, files)


def _report_kind(
    node: Node, known: tuple[str, ...], keys: tuple[str, ...], address: str, problems: Problems
) -> None:
    item = node.get("kind")
    if item is None:
        if "kind" not in misspelt_keys(node, keys):
            message = f"missing; expected one of {', '.join(known)}"
            problems.add(node.key, address, message, "missing-value")
        return
    text, name = f"expected one of {', '.join(known)}, got {item.describe()}", item.plain()
    message = misspelt("unknown-type", text, name, known, also=OTHER_NAMES)
    if message.fixes and isinstance(item.value, str):  # a long list would hide it
        text = f"there is no kind '{item.value[:40]}'"
        message = misspelt("unknown-type", text, name, known, also=OTHER_NAMES)
    problems.add(item.where, address, message)
