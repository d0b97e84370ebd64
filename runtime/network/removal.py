"""Removing blocks: ``without`` drops a block with its wires, ``bypass`` connects through it.

In: a network with all of its wires. Out: one without the named blocks, which it still lists::

    lqr.command -> limit -> plant.command       bypass: [limit]   ->   lqr.command -> plant.command
                                                without: [limit]  ->   plant.command is open

A name in a repeated part stands for all copies: ``robots.snn`` for ``robots.copy_0.snn`` and so on.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from blocks.core import misspelt, similar
from runtime.document import Node, strings
from runtime.errors import NOWHERE, Problems
from runtime.network.addresses import Endpoint, within
from runtime.network.network import Network, NetworkEntry, Wire
from runtime.network.repetition import GATHERED


def remove(network: Network, problems: Problems) -> Network:
    """The network without the blocks that its document's ``without`` and ``bypass`` name."""
    removed: dict[str, str] = {}
    removed_by: dict[str, str] = {}
    sources: dict[str, Endpoint] = {}
    for node, address in _names_under(network, "without", problems):
        for name in _blocks_named(network, node, address, problems):
            removed[name] = "without"
            removed_by.setdefault(name, node.value)
    bypassed = _names_under(network, "bypass", problems)
    for node, address in bypassed:
        for name in _blocks_named(network, node, address, problems):
            wire = _bypass_wire(network, removed, name, node.value)
            # The reason why there is no such wire, which copies have in common.
            if isinstance(wire, str):
                problems.add(node.where, address, wire)
                break
            removed[name] = "bypass"
            sources[f"{name}.{_output(network, name)}"] = wire.source
    network = replace(network, removed=removed, removed_by=removed_by, bypass_sources=sources)
    _remove_gathered(network, removed, removed_by, problems)
    for node, address in bypassed:
        # Once all are known: a circle needs every block of it to be bypassed.
        _check_circle(network, node, address, problems)
    if network.entries and removed.keys() >= network.entries.keys():
        document = network.document
        lists = document.get("without") or document.get("bypass")
        where = document.where if lists is None else lists.where
        problems.add(where, "without", "nothing is left of the graph; keep a block")
    return _rewire(network)


def _remove_gathered(
    network: Network, removed: dict[str, str], removed_by: dict[str, str], problems: Problems
) -> None:
    """Remove the blocks that gather an output of copies of which none is left.

    One of which some are left has no meaning: values of other copies would move to their places.
    """
    gathering = [name for name, entry in network.entries.items() if entry.scope.holds_copies]
    # Those of inner parts have longer names, and outer ones gather what they give.
    for name in sorted(gathering, key=len, reverse=True):
        sources = [wire.source for wire in network.into.get(name, ())]
        gone = [source for source in sources if follow(network, source) is None]
        if not gone or name in removed:
            continue
        block = missing_block(network, gone[0])
        if len(gone) == len(sources):
            removed[name] = "without"
            removed_by[name] = block
            continue
        entry = network.entries[name]
        message = f"without '{block}', '{_output_of_copies(entry)}' lacks the values of "
        message += f"{len(gone)} of its {len(sources)} copies, and those of others would move to "
        message += "their places; name "
        message += f"what all copies have, as '{network.entries[gone[0].block].plain_name}'"
        problems.add(entry.node.key, entry.scope.address, message)
        problems.silence(NOWHERE, f"{entry.address}.inputs")


def _output_of_copies(entry: NetworkEntry) -> str:
    """The output of a repeated part that a block gathers."""
    return entry.plain_name.replace(GATHERED, "")


def _names_under(network: Network, name: str, problems: Problems) -> list[tuple[Node, str]]:
    node = network.document.get(name)
    if node is None or node.value is None:
        return []
    return strings(node, name, "a block's name", problems)


def _rewire(network: Network) -> Network:
    """The network with what is removed kept apart, and wires moved to where signals come from."""
    wires: list[Wire] = []
    removed_wires: list[Wire] = []
    terms = dict(network.terms)
    for wire in network.wires:
        source = None if wire.block in network.removed else follow(network, wire.source)
        if source != wire.source:
            removed_wires.append(wire)
        if source is not None:
            wires.append(replace(wire, source=source))
        elif wire.term is not None and wire.block not in network.removed:
            # The term is open, and the others keep their places: a Sum's signs go by position.
            flags = list(terms[wire.block, wire.port])
            flags[wire.term] = False
            terms[wire.block, wire.port] = tuple(flags)
    followed = [(wire, follow(network, wire.source)) for wire in network.part_wires]
    entries = {name: e for name, e in network.entries.items() if name not in network.removed}
    return replace(
        network,
        entries=entries,
        removed_entries={name: network.entries[name] for name in network.removed},
        wires=tuple(wires),
        removed_wires=tuple(removed_wires),
        part_wires=tuple(replace(w, source=end) for w, end in followed if end is not None),
        terms=terms,
    )


def _chain(network: Network, end: Endpoint) -> Iterator[Endpoint]:
    """An address and, bypass by bypass, the addresses that take its place."""
    seen = set()
    # A circle of bypassed blocks has no end; _check_circle reports it.
    while end.block not in seen:
        yield end
        seen.add(end.block)
        through = network.bypass_sources.get(f"{end.block}.{end.port}")
        if network.removed.get(end.block) != "bypass" or through is None:
            return
        end = replace(through, component=within(through.component, end.component))


def follow(network: Network, end: Endpoint) -> Endpoint | None:
    """Where a signal comes from once blocks are removed; None if its block is removed."""
    *_, last = _chain(network, end)
    return None if last.block in network.removed else last


def missing_block(network: Network, end: Endpoint) -> str:
    """The removed block, or part, without which a signal is missing."""
    *_, last = _chain(network, end)
    return network.removed_by.get(last.block, last.block)


def _output(network: Network, name: str) -> str:
    """The output that a block's bypass stands for; '' if it has none."""
    entry = network.entries.get(name)
    pair = entry.cls.spec.through if entry is not None else None
    return pair[1] if pair else ""


def _blocks_named(network: Network, node: Node, address: str, problems: Problems) -> list[str]:
    """The blocks that a name stands for: one, or all of a part."""
    name = node.value
    inside = [full for full, entry in network.entries.items() if entry.is_named(name)]
    inputs = {port: f"inputs.{port}" for port in network.scope.inputs}
    known = [*network.scope.all_names(), *inputs.values()]
    if not inside and name not in known and name not in network.scope.broken:
        text, other = f"there is no block '{name}'", f"; blocks: {', '.join(known)}"
        similar_to = known if similar(name, known, inputs) else network.entries
        message = misspelt("unknown-block", text, name, similar_to, other, inputs)
        problems.add(node.where, address, message)
    return inside


def _bypass_wire(
    network: Network, removed: Mapping[str, str], name: str, written: str
) -> Wire | str:
    """The wire that takes the place of a block, or why the block cannot be bypassed."""
    entry = network.entries[name]
    pair = entry.cls.spec.through
    said = written if written == entry.plain_name else name
    if written not in (name, entry.plain_name):
        return f"'{written}' is a part; only a block with a pass-through can be bypassed"
    if removed.get(name) == "without":
        return f"'{said}' is in 'without' as well; keep one of the two"
    if pair is None:
        message = f"'{said}' ({entry.cls.__name__}) has no pass-through; "
        readers = [wire for wire in network.wires if wire.source.block == name]
        ports = [network.entries[wire.block].cls.spec.inputs[wire.port] for wire in readers]
        needed = [
            _target(network.entries[wire.block], wire)
            for wire, port in zip(readers, ports, strict=True)
            if port.spread or not port.optional
        ]
        if not needed:
            return f"{message}'without: [{said}]' removes it"
        return (
            f"{message}to leave it out, wire another signal to {' and '.join(needed)}, then "
            f"write 'without: [{said}]'"
        )
    for wire in network.wires:
        if (wire.block, wire.port) == (name, pair[0]):
            return wire
    return f"nothing is wired to '{said}.{pair[0]}', so there is nothing to connect directly"


def _target(entry: NetworkEntry, wire: Wire) -> str:
    """What a wire leads to; past a block that only gathers the values of copies."""
    return f"what reads '{_output_of_copies(entry)}'" if entry.scope.holds_copies else wire.target


def _check_circle(network: Network, node: Node, address: str, problems: Problems) -> None:
    """Report a bypassed block whose signal would come from bypassed blocks alone."""
    for name, entry in network.entries.items():
        if node.value not in (name, entry.plain_name):
            continue
        end = Endpoint(name, _output(network, name))
        *_, last = _chain(network, end)
        if network.removed.get(last.block) == "bypass" and end.port:
            message = f"bypassing '{node.value}' would close a circle of wires; keep a block of it"
            problems.add(node.where, address, message)
            return
