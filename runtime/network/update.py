"""The network after an edit of a few entries, from the one before: only what the edit touches.

In: a network in which nothing was wrong, and an :class:`Edit`, whose document has only the entries
around the edit. Out: the network that ``build`` would make, and its problems; None where an
edit reaches so far that all has to be built again::

    b: {gain: 2}  ->  b: {gain: 3}     b and the blocks that read it are constructed, wired and
                                       judged; all others keep their types and units

A block that is neither touched nor reads a touched one stays right if the types and units at its
wires stay. These must not rest on themselves: of a ring of Gains, none knows its type once the
wire into the ring is gone. So for each block beside those, a way is looked for along the wires to a
port whose type is declared.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import TypeVar

from blocks.core import Same
from runtime.document import MAX_BLOCKS, Node
from runtime.errors import MissingExtraError, Problems
from runtime.network.build import BlockCache, construct_blocks, judge
from runtime.network.expansion import expand
from runtime.network.inference import infer_types
from runtime.network.network import Network, NetworkEntry, Port, Wire
from runtime.network.open_inputs import report_open_inputs
from runtime.network.scope import Scope
from runtime.network.wiring import Wiring

Value = TypeVar("Value")
MAX_TOUCHED = 200  # names; of more, building everything is not much slower
ELSEWHERE = ("without", "bypass", "from", "initial", "inputs", "outputs")
_OWNER = re.compile(r"(?:(?:blocks|wires)\.|block ')(\w+)")


@dataclass(frozen=True)
class Edit:
    """What an edit leaves: names in the order of the file, and those to be looked at.

    blocks, wires : keys of these sections. touched : keys of entries that changed, came or went.
    near : the touched blocks and those that read them, of which ``document`` has the entries.
    params : names of params that other entries use.
    """

    blocks: Sequence[str]
    wires: Sequence[str]
    touched: frozenset[str]
    near: frozenset[str]
    params: frozenset[str]
    document: Node


def near_to(network: Network, touched: Iterable[str]) -> frozenset[str]:
    """The touched blocks and those that read them: what an edit may make wrong."""
    names = frozenset(touched)
    return names | {wire.block for wire in network.wires if wire.source.block in names}


def update(
    before: Network, edit: Edit, problems: Problems, block_cache: BlockCache | None = None
) -> tuple[Network, MissingExtraError | None] | None:
    """The network after an edit, and the extra that it needs; None if all has to be built."""
    if len(edit.blocks) > MAX_BLOCKS or len(edit.touched) > MAX_TOUCHED:
        return None
    scope, document = expand(edit.document, problems)
    # A param is not unused if another entry uses it; what else is wrong with params concerns all.
    used = {f"params.{name}" for name in edit.params}
    problems.items = [each for each in problems.items if each.address not in used]
    wrong = any(problem.address.startswith("params.") for problem in problems.items)
    if wrong or scope.parts or before.signal_types or any(map(document.get, ELSEWHERE)):
        return None
    network, wiring = _wired(before, edit, scope, document, problems, block_cache)
    if network.is_continuous != before.is_continuous:
        return None  # which blocks have events between ticks
    judged = (name for name in edit.blocks if name in edit.near and name in network.entries)
    network = network.changed(only=tuple(judged))
    # Also those whose wire is gone: the type may have come along it.
    around = (*_touching(network, edit.near), *_touching(before, edit.near))
    beside = {name for wire in around for name in _ends(wire)} & network.entries.keys() - edit.near
    lost = _Search(network).without_types(beside)
    if lost is None:
        return None
    inferred = _inferred(before, network, edit.near, beside, lost, problems)
    if inferred is None:
        return None
    if lost and not problems.items:
        # Blocks further away have no type, which is a problem of each unless there are others.
        report_open_inputs(inferred, wiring, problems)
        if not problems.items:
            return None
        problems.items.clear()
    network, extra = judge(inferred, wiring, problems, can_run=True)
    if not problems.items and _changes_units(before, network, edit):
        return None
    kept = [note for note in before.notes if _owner(note) not in {*edit.near, ""}]
    notes = sorted([*kept, *network.notes], key=_order(edit)) if kept else network.notes
    return network.changed(only=None, notes=tuple(notes)), extra


def _ends(wire: Wire) -> tuple[str, str]:
    return wire.block, wire.source.block


def _touching(network: Network, near: frozenset[str]) -> list[Wire]:
    return [w for w in network.wires if w.block in near or w.source.block in near]


def _in_order(
    names: Sequence[str], near: frozenset[str], new: Mapping[str, Value], old: Mapping[str, Value]
) -> dict[str, Value]:
    """Entries in the order of the file: new ones of the names near the edit, old ones of others."""
    if new.keys() <= old.keys() and len(old) - len(near & old.keys() - new.keys()) == len(names):
        # Nothing came or moved, as in most edits: a copy is faster than a search for each name.
        result = {**old, **new}
        for name in near & old.keys() - new.keys():
            del result[name]
        if list(result) == list(names):
            return result
    pairs = ((name, (new if name in near else old).get(name)) for name in names)
    return {name: value for name, value in pairs if value is not None}


def _wired(
    before: Network,
    edit: Edit,
    scope: Scope,
    document: Node,
    problems: Problems,
    block_cache: BlockCache | None,
) -> tuple[Network, Wiring]:
    """The network with the blocks and wires near the edit made again."""
    near = edit.near
    network = replace(before, scope=scope, document=document, notes=(), only=None)
    network = construct_blocks(network, {}, {}, problems, False, block_cache)
    scope.blocks = _in_order(edit.blocks, near, scope.blocks, before.scope.blocks)
    document = document.with_item("blocks", Node(scope.blocks))
    entries = _in_order(edit.blocks, near, network.entries, before.entries)
    network = replace(network, entries=entries, document=document)
    # Only the wires of the scope are resolved; they may come from any of its blocks.
    wiring = Wiring(network, problems)
    scope.wires = _in_order(edit.wires, near, scope.wires, before.scope.wires)
    new: dict[str, list[Wire]] = {}
    for wire in wiring.wires:
        new.setdefault(wire.block, []).append(wire)
    into = _in_order(edit.wires, near, new, before.into)
    terms = {at: flags for at, flags in before.terms.items() if at[0] not in near} | wiring.terms
    wires = tuple(chain.from_iterable(into.values()))
    units = {key: unit for key, unit in before.units.items() if key[0] not in near}
    network = replace(network, wires=wires, terms=terms, units=units)
    network.__dict__["into"] = into  # as cached_property has it
    return network, wiring


def _inferred(
    before: Network,
    network: Network,
    near: frozenset[str],
    beside: set[str],
    lost: set[str],
    problems: Problems,
) -> Network | None:
    """The network with types; None if those of blocks further away depend on the edit."""
    count, wires = len(problems.items), _touching(network, near)
    again = near | lost
    all_types, all_lengths = dict(before.types), dict(before.lengths)
    search = _Search(network)
    for name in again & before.entries.keys():
        all_lengths.pop(name, None)
        for port in before.entries[name].cls.spec.ports:
            # Of a block far away only what depends on the type that is lost.
            if name in near or search.symbol(network.entries[name], port):
                all_types.pop((name, port), None)
    all_lengths |= {name: dict(network.entries[name].block.sizes()) for name in lost - near}
    network = network.changed(types=all_types, lengths=all_lengths)
    opened = [name for name in (*near, *(lost & beside)) if name in network.entries]
    types, lengths = infer_types(network, problems, wires, opened, beside - lost)
    wrong = {problem.address for problem in problems.items[count:]}
    # Which of the wires to a port without a declared type is the wrong one, all of them decide.
    if any(wire.address in wrong and any(search.open_ends(wire)) for wire in wires):
        return None
    all_types |= types
    all_lengths |= lengths
    border = {wire.source.block for wire in wires if wire.block not in near}
    for name in border - lost:
        if name in before.entries and network.is_typed(name) != before.is_typed(name) and lost:
            continue  # what reads it is lost as well
        ports = before.entries[name].cls.spec.ports if name in before.entries else ()
        if any(types.get((name, port)) != before.types.get((name, port)) for port in ports):
            return None
        if lengths.get(name) != before.lengths.get(name):
            return None
    return network


class _Search:
    """Looks along the wires for what types rest on: a port whose type is declared."""

    def __init__(self, network: Network) -> None:
        self.network = network
        # By block object: equal blocks of a graph are one object, and all of them exist meanwhile.
        self.opened: dict[tuple[int, str], str] = {}
        self.known: dict[int, frozenset[str]] = {}

    def symbol(self, entry: NetworkEntry | None, port: str) -> str:
        """The type variable or length that a port's type depends on; '' if it is declared."""
        if entry is None or entry.block_or_none is None:
            return ""
        key = (id(entry.block_or_none), port)
        if key not in self.opened:
            block = entry.block
            kind = block.port_type(port)
            if isinstance(kind, Same):
                self.opened[key] = "" if kind.variable in block.variables else kind.variable
            else:
                known = not kind.symbol or kind.symbol in block.sizes()
                self.opened[key] = "" if known else str(kind.symbol)
        return self.opened[key]

    def open_ends(self, wire: Wire) -> tuple[str, str]:
        """What the two ends of a wire depend on: its source, its target."""
        entries = self.network.entries
        source, target = entries.get(wire.source.block), entries.get(wire.block)
        return self.symbol(source, wire.source.port), self.symbol(target, wire.port)

    def without_types(self, names: Iterable[str]) -> set[str] | None:
        """The blocks that have no type any more, of those beside an edit and all around them.

        None if that cannot be told: a block depends on several types, a wire is a component's.
        """
        fine, lost = set[str](), set[str]()
        for name in names:
            if name in fine or name in lost or not self.symbols(name):
                continue
            # Upwards alone at first: most types come from there, and a long chain has many readers.
            group, is_fine, is_certain = self.around(name, (self.network.into,), fine)
            if not is_fine:
                ways = (self.network.into, self.readers)
                group, is_fine, is_certain = self.around(name, ways, fine)
            if not is_certain:
                return None
            (fine if is_fine else lost).update(group)
        return lost

    def around(
        self, name: str, ways: Sequence[Mapping[str, Sequence[Wire]]], fine: set[str]
    ) -> tuple[set[str], bool, bool]:
        """The blocks that have the type of one, whether it is declared anywhere, and if that is
        certain."""
        entries, group, waiting, certain = self.network.entries, {name}, [name], True
        while waiting:
            block = waiting.pop()
            if len(self.symbols(block)) > 1:
                return group, False, False
            for wire in (wire for way in ways for wire in way.get(block, ())):
                source, target = self.open_ends(wire)
                incoming = wire.block == block
                other = wire.source.block if incoming else wire.block
                here, there = (target, source) if incoming else (source, target)
                spread = entries[wire.block].cls.spec.inputs[wire.port].spread
                if spread or (here and wire.source.component):
                    certain = False
                elif not here or entries[other].block_or_none is None:
                    continue
                elif not there or other in fine:
                    return group, True, True
                elif other not in group:
                    group.add(other)
                    waiting.append(other)
        return group, False, certain

    @cached_property
    def readers(self) -> Mapping[str, Sequence[Wire]]:
        """The wires from each block."""
        result: dict[str, list[Wire]] = {}
        for wire in self.network.wires:
            result.setdefault(wire.source.block, []).append(wire)
        return result

    def symbols(self, name: str) -> frozenset[str]:
        """What the types of a block's ports depend on."""
        entry = self.network.entries[name]
        key = id(entry.block_or_none)
        if key not in self.known:
            found = (self.symbol(entry, port) for port in entry.cls.spec.ports)
            self.known[key] = frozenset(filter(None, found))
        return self.known[key]


def _changes_units(before: Network, network: Network, edit: Edit) -> bool:
    """Whether a unit changes that blocks further away pass on, or rests on itself."""
    near = edit.near - edit.touched
    keys = {key for key in (*before.units, *network.units) if key[0] in near}
    return any(
        before.units.get(key) != network.units.get(key) or not _is_given(network, key)
        for key in keys
    )


def _is_given(network: Network, key: Port) -> bool:
    """Whether the unit of a type variable comes from a port that declares one."""
    seen, waiting = {key[0]}, [key[0]]
    while waiting:
        name = waiting.pop()
        for wire in network.into.get(name, ()):
            port = network.entries[wire.source.block].cls.spec.outputs[wire.source.port]
            kind = network.types.get((wire.source.block, wire.source.port))
            if port.unit or not isinstance(port.type, Same) or (kind and kind.form == "record"):
                return True
            if wire.source.block not in seen:
                seen.add(wire.source.block)
                waiting.append(wire.source.block)
    return False


def closes_loop(network: Network, near: Iterable[str]) -> bool:
    """Whether an output near an edit needs itself in the same tick."""
    done: dict[Port, bool] = {}
    needs: dict[tuple[int, str], frozenset[str]] = {}

    def needed(port: Port) -> list[Port]:
        name, output = port
        entry = network.entries[name]
        key = (id(entry.block_or_none), output)
        if key not in needs:
            calls = [call for call in entry.evaluations if output in call.outputs]
            needs[key] = frozenset(each for call in calls for each in call.needs)
        own = [(name, each) for each in needs[key] if each in entry.cls.spec.outputs]
        into = network.into.get(name, ()) if needs[key] else ()
        wires = [wire.source for wire in into if wire.port in needs[key]]
        return own + [(source.block, source.port) for source in wires]

    # Depth first without recursion: a chain may be long. False in ``done``: on the way here.
    for name in near:
        entry = network.entries.get(name)
        waiting = [(name, port) for port in entry.cls.spec.outputs] if entry else []
        while waiting:
            port = waiting[-1]
            if port in done:
                waiting.pop()
                done[port] = True
                continue
            done[port] = False
            for other in needed(port):
                if other not in done:
                    waiting.append(other)
                elif not done[other]:
                    return True
    return False


def _owner(note: str) -> str:
    """The block that a note is about; '' for the whole graph, of which it is found again."""
    match = _OWNER.match(note)
    return match[1] if match else ""


def _order(edit: Edit) -> Callable[[str], tuple[int, int]]:
    """The order in which ``build`` has notes: of parameters, of wires, of open inputs, of all."""
    blocks, wires = ({n: i for i, n in enumerate(names)} for names in (edit.blocks, edit.wires))

    def key(note: str) -> tuple[int, int]:
        name = _owner(note)
        if note.startswith("wires."):
            return 1, wires.get(name, 0)
        if note.startswith("block '"):
            return 4, blocks.get(name, 0)
        stage = 3 if not name else 2 if ": nothing is wired to it: " in note else 0
        return stage, blocks.get(name, 0)

    return key
