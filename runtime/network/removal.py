"""Taking blocks out: ``without`` drops a block with its wires, ``bypass`` wires it straight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from blocks.core import hint
from runtime.document import Node, texts
from runtime.errors import Problems
from runtime.network.addresses import Endpoint
from runtime.network.network import Network, Wire


def remove(network: Network, document: Node, problems: Problems) -> None:
    """Apply both lists to a network, in place; what goes stays visible among its ghosts."""
    for node, address in _listed(document, "without", problems):
        for name in _named(network, node, address, problems):
            network.removed[name] = "without"
            network.asked.setdefault(name, node.value)
    bypassed = _listed(document, "bypass", problems)
    for node, address in bypassed:
        for name in _named(network, node, address, problems):
            message = _no_bypass(network, name, node.value)
            if message:
                problems.add(node.where, address, message)
            else:
                network.removed[name] = "bypass"
    for node, address in bypassed:
        if follow(network, Endpoint(node.value, _through(network, node.value))) is None:
            _check_circle(network, node, address, problems)
    if network.entries and network.removed.keys() >= network.entries.keys():
        lists = document.get("without") or document.get("bypass")
        where = document.where if lists is None else lists.where
        problems.add(where, "without", "nothing is left of the graph; keep a block")
    for name in network.removed:
        network.ghosts[name] = network.entries.pop(name)
    _rewire(network)


def _listed(document: Node, name: str, problems: Problems) -> list[tuple[Node, str]]:
    node = document.get(name)
    if node is None or node.value is None:
        return []
    return texts(node, name, "a block's name", problems)


def _rewire(network: Network) -> None:
    kept: list[Wire] = []
    for wire in network.wires:
        source = None if wire.block in network.removed else follow(network, wire.source)
        if source != wire.source:
            network.ghost_wires.append(wire)
        if source is not None:
            kept.append(replace(wire, source=source))
        elif wire.term is not None and wire.block not in network.removed:
            flags = list(network.terms[wire.block, wire.port])
            flags[wire.term] = False
            network.terms[wire.block, wire.port] = tuple(flags)
    network.wires = kept
    followed = [(wire, follow(network, wire.source)) for wire in network.part_wires]
    network.part_wires = [replace(w, source=end) for w, end in followed if end is not None]


def _chain(network: Network, end: Endpoint) -> Iterator[Endpoint]:
    """An address and what takes its place, block for block, as far as bypasses lead."""
    seen = set()
    while end.block not in seen:
        yield end
        seen.add(end.block)
        through = network.straight.get(f"{end.block}.{end.port}")
        if network.removed.get(end.block) != "bypass" or through is None:
            return
        end = replace(through, component=through.component or end.component)


def follow(network: Network, end: Endpoint) -> Endpoint | None:
    """Where a signal comes from once blocks are removed; None if it is gone with its block."""
    *_, last = _chain(network, end)
    return None if last.block in network.removed else last


def lost(network: Network, end: Endpoint) -> str:
    """The removed block with which a signal went, or the part in whose name it was removed."""
    *_, last = _chain(network, end)
    return network.asked.get(last.block, last.block)


def _through(network: Network, name: str) -> str:
    entry = network.entries.get(name)
    pair = entry.cls.spec.through if entry is not None else None
    return pair[1] if pair else ""


def _named(network: Network, node: Node, address: str, problems: Problems) -> list[str]:
    """The blocks that a name stands for: one, or all of a part."""
    name = node.value
    inside = [full for full in network.entries if full == name or full.startswith(f"{name}.")]
    known = network.scope.all_names()
    if not inside and name not in known and name not in network.scope.broken:
        suggestion = hint(name, known) or f"; blocks: {', '.join(known)}"
        problems.add(node.where, address, f"there is no block '{name}'{suggestion}", True)
    return inside


def _no_bypass(network: Network, name: str, written: str) -> str:
    """Why a block cannot be bypassed; '' if it can, and then its straight wire is noted."""
    entry = network.entries[name]
    pair = entry.cls.spec.through
    if name != written:
        return f"'{written}' is a part; only a block with a through-pair can be bypassed"
    if network.removed.get(name) == "without":
        return f"'{name}' stands in 'without' as well; keep one of the two"
    if pair is None:
        kind = entry.cls.__name__
        return f"'{name}' ({kind}) has no through-pair; 'without: [{name}]' takes it out"
    for wire in network.wires:
        if (wire.block, wire.port) == (name, pair[0]):
            network.straight[f"{name}.{pair[1]}"] = wire.source
            return ""
    return f"nothing is wired to '{name}.{pair[0]}', so there is nothing to wire straight"


def _check_circle(network: Network, node: Node, address: str, problems: Problems) -> None:
    end = Endpoint(node.value, _through(network, node.value))
    *_, last = _chain(network, end)
    if network.removed.get(last.block) == "bypass" and end.port:
        message = (
            f"the straight wire through '{node.value}' leads back to itself; keep a block of it"
        )
        problems.add(node.where, address, message)
