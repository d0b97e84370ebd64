"""Replacing blocks: by one of another type, where what fits stays; by forms in discrete time.

In: a document, a block's name and a type. Out: the changed document and the notes::

    --replace lqr=PID     lqr: {type: LQR, q: 1, dt: 0.01}  ->  lqr: {type: PID, dt: 0.01}
    "'lqr' is now a PID, which has no q: dropped"

A replacement is for experiments with one word: where dropping were an error, it would take three
more options to try another controller.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

from blocks.core import Block, ParameterError, hint, misspelt
from blocks.files import resolved
from blocks.library.registry import Modules
from blocks.messages import Note
from runtime.document import Node, is_part, set_entry
from runtime.errors import GraphError, Problem, Problems, UsageError, Where
from runtime.network.block_types import block_class
from runtime.network.network import Network

# Entries of probes, plots and metrics whose strings are no addresses.
SIGNAL_FREE = ("kind", "title", "label", "labels", "unit")
IsLost = Callable[[str], bool]


def replace_block(
    document: Node,
    name: str,
    kind: str,
    classes: Mapping[str, type[Block]],
    origin: str = "",
    modules: Modules = True,
) -> tuple[Node, list[Note]]:
    """The document with a block, or a whole part, replaced by a block of another type.

    Parameters that the new type has as well stay, and so do wires whose ports it has. Parameters
    that it requires and that are not given yet can be set afterwards.

    Parameters
    ----------
    name : the block's name; inside a part, ``adaptive.snn_v``.
    kind : the new type, or ``file.py:Type`` for your own.
    classes : block types other than the library's.
    origin : where the change was written, for messages.
    modules : whether Python files may be imported.

    Returns
    -------
    The document, and a note about each thing that was dropped.

    Raises
    ------
    GraphError : there is no such block or type.
    """
    where = Where(origin or f"replace {name}={kind}")
    names = name.strip().split(".")
    scopes = _scopes(document, names, where)
    module, colon, type_name = kind.rpartition(":")
    if "{" in module or not type_name.strip().isidentifier():
        text = "expected a type, as PathPID or my_blocks.py:Mine (--set gives its parameters)"
        raise GraphError([Problem(where, name, f"{text}, got '{kind}'")])
    entry: dict[str, Node] = {"type": Node(type_name.strip(), where, where)}
    if colon:
        entry["module"] = Node(str(resolved(module)), where, where)
    problems = Problems()
    cls = block_class(Node(entry, where, where), name, classes, problems, modules)
    problems.raise_any()
    if cls is None:
        raise UsageError(f"{where}: no block type '{kind}'")
    change = _Replacement(name, cls)
    return change.apply(scopes, names, entry), change.notes


def _scopes(document: Node, names: list[str], where: Where) -> list[Node]:
    """The graph and the parts that contain a block, the outermost first."""
    scopes = [document]
    for depth, name in enumerate(names):
        blocks = scopes[-1].get("blocks") or Node({})
        entry = blocks.get(name)
        if entry is None or not entry.is_map:
            known = [key for key, _ in blocks.items()]
            text, other = f"there is no block '{name}'", f"; blocks: {', '.join(known) or 'none'}"
            message = misspelt("unknown-block", text, name, known, other)
            raise GraphError([Problem(where, "", message)])
        if depth < len(names) - 1:
            if not is_part(entry):
                raise GraphError([Problem(where, "", f"'{name}' is a block, not a part")])
            scopes.append(entry)
    return scopes


@dataclass
class _Replacement:
    """One replacement; collects notes about what is dropped."""

    name: str
    cls: type[Block]
    notes: list[Note] = field(default_factory=list)

    def note(self, what: str) -> None:
        text = f"'{self.name}' is now a {self.cls.__name__}, {what}"
        if text not in self.notes:
            self.notes.append(Note(text, "changed", block=self.name))

    def apply(self, scopes: list[Node], names: list[str], entry: dict[str, Node]) -> Node:
        """Change the innermost scope, and all that refers to the block in those around it."""
        scope = self.block(scopes[-1], names[-1], entry)
        # From the inside out: a wire of each graph around the block may name one of its outputs.
        for depth in range(len(names) - 1, -1, -1):
            if depth < len(names) - 1:
                blocks = scopes[depth].get("blocks") or Node({})
                scope = scopes[depth].with_item("blocks", blocks.with_item(names[depth], scope))
            scope = self.wires(scope, self.lost_test(".".join(names[depth:]), with_states=False))
        return self.observations(scope, self.lost_test(self.name, with_states=True))

    def lost_test(self, name: str, with_states: bool) -> IsLost:
        """A test for addresses of the block that the new type does not have."""
        spec = self.cls.spec
        # Probes may record states, wires may not start at them.
        known = {*spec.outputs, *(spec.states if with_states else ())}

        def is_lost(address: str) -> bool:
            port = address.removeprefix(f"{name}.").partition(".")[0]
            return address.startswith(f"{name}.") and port not in known

        return is_lost

    def block(self, scope: Node, name: str, entry: dict[str, Node]) -> Node:
        blocks = scope.get("blocks") or Node({})
        old = blocks.get(name) or Node({})
        parameters = (
            {} if is_part(old) else {k: v for k, v in old.items() if k not in ("type", "module")}
        )
        spec = self.cls.spec
        fitting = {
            key: node
            for key, node in parameters.items()
            if key in ("dt", "offset", "seed", *spec.params)
        }
        lost = [key for key in parameters if key not in fitting]
        if lost:
            self.note(f"which has no {', '.join(lost)}: dropped")
        result = scope.with_item(
            "blocks", blocks.with_item(name, Node({**entry, **fitting}, old.where, old.key))
        )
        wires = scope.get("wires") or Node({})
        mine = wires.get(name)
        for port, _ in [] if mine is None else list(mine.items()):
            if port not in spec.inputs and mine is not None:
                self.note(f"which has no input '{port}': its wire is dropped")
                mine = mine.with_item(port, None)
        if mine is not None:
            result = result.with_item("wires", wires.with_item(name, mine))
        return result

    def wires(self, scope: Node, is_lost: IsLost) -> Node:
        """A scope without the wires from outputs that are gone."""
        wires = scope.get("wires")
        if wires is None:
            return scope
        for consumer, ports in wires.items():
            for port, node in ports.items():
                rest = self.without_lost(node, is_lost)
                if rest is not node:
                    ports = ports.with_item(port, rest)
            wires = wires.with_item(consumer, ports)
        return scope.with_item("wires", wires)

    def without_lost(self, node: Node, is_lost: IsLost) -> Node | None:
        """A text or list of texts without what is gone; None if nothing is left."""
        items = node.value if node.is_list else [node]
        lost = [item for item in items if isinstance(item.value, str) and is_lost(item.value)]
        for item in [item for item in lost if "." in item.value]:
            port = item.value.rpartition(f"{self.name.rpartition('.')[2]}.")[2]
            self.note(f"which has no '{port}': '{item.value}' is dropped")
        if not lost:
            return node
        rest = [item for item in items if item not in lost]
        return Node(rest, node.where, node.key) if rest and node.is_list else None

    def observations(self, document: Node, is_lost: IsLost) -> Node:
        """A document without the probes, plots and metrics of signals that are gone."""
        lost: set[str] = set()
        for section in ("probes", "plots", "metrics"):
            entries = document.get(section)
            if entries is None:
                continue
            for name, entry in entries.items():
                rest = self.entry(entry, lambda text: is_lost(text) or text in lost)
                if rest is not entry:
                    entries = entries.with_item(name, rest)
                # Plots and metrics of a probe that is dropped are dropped with it: probes come
                # first.
                if rest is None and section == "probes":
                    lost.add(name)
            document = document.with_item(section, entries)
        return document

    def entry(self, entry: Node, is_lost: IsLost) -> Node | None:
        if not entry.is_map:
            return self.without_lost(entry, is_lost)
        for key, node in entry.items():
            if key not in SIGNAL_FREE and (node.is_list or isinstance(node.value, str)):
                rest = self.without_lost(node, is_lost)
                if rest is None:
                    return None
                if rest is not node:
                    entry = _labels_of(entry, node, rest).with_item(key, rest)
        return entry


def _labels_of(entry: Node, items: Node, rest: Node) -> Node:
    """An entry whose lists of labels, one per signal, are those of the signals that are left."""
    for key in ("label", "labels"):
        labels = entry.get(key)
        if items.is_list and labels and labels.is_list and len(labels.value) == len(items.value):
            rest_labels = [
                label
                for label, item in zip(labels.value, items.value, strict=True)
                if item in rest.value
            ]
            entry = entry.with_item(key, Node(rest_labels, labels.where, labels.key))
    return entry


METHODS = ("tustin", "zoh", "matched")


def discretize(
    network: Network,
    document: Node,
    method: str,
    step: float,
    names: Collection[str] = (),
    origin: str = "",
) -> tuple[Node, list[Note]]:
    """The document with blocks, or parts, in discrete time; all that can be, if none is named.

    Raises
    ------
    UsageError : there is no such method or block, or it has no form by this method.
    """
    place = f"{origin}: " if origin else ""
    if method not in METHODS:
        suggestion = hint(method, METHODS) or f"; expected {', '.join(METHODS)}"
        raise UsageError(f"{place}there is no method '{method}'{suggestion}")
    for name in names:
        if not any(n == name or n.startswith(f"{name}.") for n in network.entries):
            raise UsageError(f"{place}there is no block '{name}'{hint(name, network.entries)}")
    notes = []
    done: set[str] = set()
    for name, entry in sorted(network.entries.items()):
        within = [each for each in names if name == each or name.startswith(f"{each}.")]
        if (names and not within) or entry.block_or_none is None or entry.address in done:
            continue
        kind = entry.cls.__name__
        try:
            block = entry.block.discretized(method, step)
        except ParameterError as error:
            why = "; ".join(text for _, text in error.problems)
            raise UsageError(f"{place}'{name}' ({kind}) stays continuous: {why}") from None
        if block is None:
            if name in names:
                raise UsageError(f"{place}'{name}' ({kind}) has no form in discrete time")
            continue
        made = {"type": type(block).__name__, **block.parameters(), "dt": step}
        document = set_entry(document, entry.address, made, origin)
        done.add(entry.address)
        text = f"'{name}' is now a {made['type']} with dt = {step:g} ({method})"
        notes.append(Note(text, "changed", block=name))
    if not done:
        raise UsageError(f"{place}no block has a form in discrete time")
    return document, notes
