"""From names to a checked network: blocks constructed, wires resolved, types inferred.

In: a complete document. Out: a :class:`Network` and, in ``problems``, everything wrong with it. It
goes on after a problem as far as the rest can be judged: a block that cannot be constructed is in
the network without an object, so that the wires to it are still checked::

    blocks: {lqr: {type: LQR, q: -1}}   ->   entries["lqr"].block_or_none is None, one problem
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, MutableMapping
from dataclasses import dataclass, replace
from typing import Any

from blocks.core import (
    TYPES,
    Block,
    GraphInput,
    ParameterError,
    SignalType,
    Variant,
    maybe_degrees,
    misspelt,
    signal_type,
    similar,
    unknown_parameter,
)
from blocks.library.registry import ModuleReader, Modules
from blocks.messages import Message, Note, Replace
from blocks.world import World
from runtime.document import Node, read_run, read_seed, read_title, section
from runtime.errors import MissingExtraError, Problems
from runtime.network.block_types import (
    block_class,
    own_types,
    own_variant,
    relative_with,
    written_types,
)
from runtime.network.contexts import check_contexts, check_enabling, context_notes, failure_text
from runtime.network.defaults import with_defaults
from runtime.network.expansion import expand
from runtime.network.inference import infer_types, report_open
from runtime.network.initial import read_initial
from runtime.network.network import Network, NetworkEntry, place_of
from runtime.network.open_inputs import open_notes, report_open_inputs
from runtime.network.ports import check_defaults, input_entries, with_ports
from runtime.network.removal import remove
from runtime.network.scope import INPUTS, Scope
from runtime.network.ticks import edge_notes, rate_notes, sampling
from runtime.network.units import check_units
from runtime.network.wiring import Wiring

BLOCK_KEYS = ("type", "module", "dt", "offset", "seed")
SOLVER_KEYS = ("solver", "rtol", "atol", "max_step")
BlockCache = MutableMapping[tuple[type[Block], str], Block]


def build(
    document: Node,
    problems: Problems,
    classes: Mapping[str, type[Block]] | None = None,
    kinds: Mapping[str, SignalType] | None = None,
    modules: Modules = True,
    block_cache: BlockCache | None = None,
    is_part: bool = False,
) -> tuple[Network, MissingExtraError | None]:
    """Build the network of a document in which nothing is left to extend or inline.

    Parameters
    ----------
    problems : collects what is wrong; the network is valid only if nothing is.
    classes, kinds : block types and signal types beside the library's, of graphs made in Python.
    modules : whether Python files that the graph names are imported, or how they are read.
    block_cache : blocks by type and parameters, which are used again; new ones are added.
    is_part : whether it is the document of a part, whose inputs come from outside.

    Returns
    -------
    tuple : the network, and the extra that one of its blocks needs and that is not installed.

    Notes
    -----
    The order of the steps decides what can be reported:

    * Blocks are removed after all wires are resolved, so that a message can say which input
      ``without`` leaves open, and before types are inferred, on which they must have no influence.
    * Units are compared only where all types are right: a component's unit comes from its type.
    * Open types are reported only where nothing else is wrong, which is usually their reason.
    * States of earlier runs come last: their shapes are compared with those that types determine.
    """
    scope, document = expand(document, problems, is_part)
    before = len(problems.items)
    run, title = read_run(document, problems), read_title(document, problems)
    world = _world(document, problems)
    network = Network(title=title, **vars(run), scope=scope, document=document, world=world)
    # A wrong dt or world would be reported again by each block that asks its context for it.
    can_run = len(problems.items) == before
    kinds = {**(kinds or {}), **written_types(document, problems)}
    network = _construct_blocks(network, classes or {}, kinds, problems, modules, block_cache)
    wiring = Wiring(network, problems)
    network = replace(
        network,
        wires=tuple(wiring.wires),
        part_wires=tuple(wiring.part_wires),
        terms=wiring.terms,
    )
    check_defaults(network, problems)
    network = remove(network, problems)
    types, lengths = infer_types(network, problems)
    network = replace(network, types=types, lengths=lengths)
    network, extra = _check(network, wiring, problems, can_run)
    network = with_ports(network, problems)
    if not problems.items:
        initial, notes = read_initial(network, problems)
        network = replace(network, initial=initial, notes=(*network.notes, *notes))
    return network, extra


def _check(
    network: Network, wiring: Wiring, problems: Problems, can_run: bool
) -> tuple[Network, MissingExtraError | None]:
    """The network with its notes and units, once its types are known; reports what is wrong.

    ``can_run`` says whether ``run`` and ``world`` have no errors, without which no block can check
    its context. Returns the extra that a block needs as well.
    """
    if not problems.items:
        notes, units = check_units(network, problems)
        network = network.changed(notes=(*network.notes, *notes), units=units)
    report_open_inputs(network, wiring, problems)
    notes = [*open_notes(network), *_unused_solver(network), *edge_notes(network)]
    network = network.changed(notes=(*network.notes, *notes))
    check_enabling(network, problems)
    if not problems.items:
        report_open(network, problems)
    missing = check_contexts(network, problems) if can_run else None
    extra = None if missing is None else MissingExtraError(missing.feature, missing.extra)
    if can_run and not problems.items:
        notes = [*network.notes, *rate_notes(network), *context_notes(network)]
        network = network.changed(notes=tuple(notes))
    return network, extra


def _unused_solver(network: Network) -> list[Note]:
    """A note if the graph sets a solver that has nothing to integrate."""
    run = network.document.get("run")
    keys = [key for key in SOLVER_KEYS if run is not None and run.is_map and run.get(key)]
    if not keys or network.is_continuous:
        return []
    text = "not used, since no block has continuous states to integrate"
    return [Note(text, "not-used", f"run.{keys[0]}")]


def _world(document: Node, problems: Problems) -> World | None:
    node = document.get("world")
    if node is None or node.value is None:
        return None
    if not node.is_map:
        section(document, "world", "world", problems)
        return None
    try:
        return World(node.plain())
    except ArithmeticError as error:
        problems.add(
            node.where, "world", f"expected lengths in m, got one that is too large: {error}"
        )
        return None
    except ParameterError as error:
        for address, text in error.problems:
            place = node
            for name in re.findall(r"\w+", address):
                inner = place.get(name) if place.is_map else None
                if place.is_list and name.isdigit() and int(name) < len(place.value):
                    inner = place.value[int(name)]
                place = place if inner is None else inner
            problems.add(place.where, f"world.{address}".rstrip("."), text)
        return None


@dataclass(frozen=True)
class _Definition:
    """A block as the graph defines it, before it is constructed."""

    scope: Scope
    name: str
    node: Node
    cls: type[Block]

    @property
    def address(self) -> str:
        return self.scope.path_of(self.name)

    @property
    def full_name(self) -> str:
        return self.scope.prefix + self.name


def _construct_blocks(
    network: Network,
    classes: Mapping[str, type[Block]],
    kinds: Mapping[str, SignalType],
    problems: Problems,
    modules: Modules,
    block_cache: BlockCache | None,
) -> Network:
    """The network with its blocks, constructed once all classes and signal types are known."""
    definitions = _definitions(network, classes, problems, modules)
    # All classes first: a parameter may name a signal type that another block's module defines.
    own = _signal_types(definitions, kinds, problems, modules)
    entries, notes, part_inputs = {}, [], {}
    for definition in definitions:
        block, block_notes = _construct(definition, own, problems, block_cache, modules)
        scope, node, name = definition.scope, definition.node, definition.name
        full = definition.full_name
        if isinstance(block, GraphInput) and "T" in block.variables:
            part_inputs[scope.prefix + name.removeprefix(INPUTS)] = block.variables["T"]
        if definition.cls is GraphInput and not scope.own_value(name.removeprefix(INPUTS)):
            continue  # what is wired to it takes its place
        every, offset = sampling(node, definition.cls, network, definition.address, problems)
        seed = _seed(definition, problems)
        sampled = node.get("dt") is not None
        if sampled and definition.cls.spec.continuous:
            message = "its states are continuous and integrated over every step; leave dt out"
            problems.add(node.where, f"{definition.address}.dt", message)
        entries[full] = NetworkEntry(
            full, scope, node, definition.cls, block, every, sampled, offset, seed
        )
        notes += block_notes
    return replace(
        network, signal_types=own, entries=entries, notes=tuple(notes), part_inputs=part_inputs
    )


def _definitions(
    network: Network, classes: Mapping[str, type[Block]], problems: Problems, modules: Modules
) -> list[_Definition]:
    """The blocks with their classes and defaults, and the inputs of the graph and its parts."""
    definitions = []
    for scope in network.scope.walk():
        for name, node in scope.blocks.items():
            cls = block_class(node, scope.path("blocks", name), classes, problems, modules)
            if cls is not None:
                definitions.append(_Definition(scope, name, node, cls))
    written = [(each.scope, each.node, each.cls) for each in definitions]
    definitions = [
        replace(each, node=node)
        for each, node in zip(definitions, with_defaults(written, problems), strict=True)
    ]
    inputs = (
        _Definition(scope, name, node, GraphInput)
        for scope in network.scope.walk()
        for name, node in input_entries(scope)
    )
    return [*definitions, *inputs]


def parameters_of(network: Network, entry: NetworkEntry, node: Node) -> dict[str, Any] | None:
    """The parameters in a node of an entry, as the block takes them; None if one is wrong."""
    definition = _Definition(entry.scope, entry.short, node, entry.cls)
    values = {key: item for key, item in node.items() if key in entry.cls.spec.params}
    try:
        found = _parameter_values(values, entry.cls, network.signal_types)
    except ParameterError:
        return None
    return found if _take_variants(found, definition, Problems(), True) else None


def _seed(definition: _Definition, problems: Problems) -> int | None:
    """A block's own seed, or that of a part around it; None for the run's."""
    node = None if "seed" in definition.cls.spec.params else definition.node.get("seed")
    seed = read_seed(node, f"{definition.address}.seed", problems)
    return definition.scope.seed if seed is None else seed


def _signal_types(
    definitions: Iterable[_Definition],
    kinds: Mapping[str, SignalType],
    problems: Problems,
    modules: Modules,
) -> dict[str, SignalType]:
    """The signal types that the blocks' classes and modules define, beside those given."""
    types = dict(kinds)
    for definition in definitions:
        for kind in own_types(definition.cls, definition.node, modules):
            if types.setdefault(kind.name, kind) != kind or kind.name in TYPES:
                message = (
                    f"the signal type '{kind.name}' of this block differs from another of that "
                    "name in the graph; rename one of them"
                )
                problems.add(definition.node.key, definition.address, message)
    return types


def _construct(
    definition: _Definition,
    own: Mapping[str, SignalType],
    problems: Problems,
    block_cache: BlockCache | None = None,
    modules: Modules = True,
) -> tuple[Block | None, list[Note]]:
    """A block, None where it cannot be constructed, and notes about its parameters."""
    node, cls, address = definition.node, definition.cls, definition.address
    params = cls.spec.params
    common = () if cls is GraphInput else BLOCK_KEYS
    values = {key: item for key, item in node.items() if key in params or key not in common}
    unknown = [key for key in values if key not in params]
    for key in unknown:
        problems.add(values[key].key, f"{address}.{key}", _unknown_parameter(key, values, cls))
    try:
        parameters = _parameter_values(
            {k: item for k, item in values.items() if k in params}, cls, own
        )
        if not _take_variants(parameters, definition, problems, modules):
            return None, []
        block = _cached_block(cls, parameters, block_cache)
        # A user's methods, called here so that what they raise is reported with the block.
        dict(block.variables), dict(block.sizes())
        return block, _large_angles(definition, values)
    except ParameterError as error:
        # A required parameter that is missing because its key is misspelt is one mistake.
        misspelt_names = {similar(key, params) for key in unknown}
        for parameter, text in error.problems:
            if parameter in values or parameter not in misspelt_names:
                where = place_of(node, parameter)
                # An input may be written as its type alone: 'push: Scalar'.
                short = cls is GraphInput and parameter == "type"
                problems.add(where, address if short else f"{address}.{parameter}", text)
    except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything
        problems.add(node.key, address, failure_text(cls, error), "block-failed")
    return None, []


def _unknown_parameter(key: str, values: Mapping[str, Node], cls: type[Block]) -> Message:
    """The message about a parameter that a block does not have."""
    instead = _instead_of(key, values, cls)
    if instead:
        return Message(f"unknown parameter{instead}", "unknown-parameter")
    return unknown_parameter(key, cls.spec.params)


def _instead_of(key: str, values: Mapping[str, Node], cls: type[Block]) -> str:
    """What to write instead of a parameter that another block has, or none; '' if not known."""
    params = cls.spec.params
    base, bracket, rest = key.partition("[")
    if bracket and base in params and rest.removesuffix("]").isdecimal():
        return f"; one of its numbers is named {base}.{rest.removesuffix(']')}"
    # A decimal comma: YAML reads {gain: 0,5} as gain: 0 and a key 5 without a value.
    if key[:1].isdecimal() and values[key].value is None and key != next(iter(values)):
        before = list(values)[list(values).index(key) - 1]
        return f"; a decimal point is a dot, as in {before}: {values[before].plain()}.{key}"
    if relative := relative_with(cls, key):
        return f"; the block with this parameter is a {relative}"
    if key == "repeat":
        suggestion = "; only parts are repeated: put the block into one"
        return suggestion + (", or use groups" if "groups" in params else "")
    if cls is GraphInput and key == "to":
        return "; wires name their source: wires: {block: {port: inputs.NAME}}"
    if key == "graph":
        return "; parts are read with the file that names them"
    return ""


def _cached_block(
    cls: type[Block], parameters: dict[str, Any], block_cache: BlockCache | None
) -> Block:
    """A block with these parameters, the one that was constructed before if there is one."""
    if block_cache is None:
        return cls(**parameters)
    # The values' printed form is the key, since lists and nested mappings cannot be hashed.
    key = (cls, repr(parameters))
    block = block_cache.get(key)
    if block is None:
        block = block_cache[key] = cls(**parameters)
    return block


def _parameter_values(
    values: Mapping[str, Node], cls: type[Block], own: Mapping[str, SignalType]
) -> dict[str, Any]:
    """The parameters as a block takes them, with the graph's own signal types looked up.

    Raises
    ------
    ParameterError : there is no such type.
    """
    plain = {key: item.plain() for key, item in values.items()}
    for key, value in plain.items():
        if own and cls.spec.params[key].kind == "signal" and isinstance(value, str):
            try:
                plain[key] = signal_type(value, own=own)
            except ValueError as error:
                text = misspelt("unknown-type", str(error), value, [*own, *TYPES])
                raise ParameterError([(key, text)]) from None
    return plain


def _take_variants(
    parameters: dict[str, Any], definition: _Definition, problems: Problems, modules: Modules
) -> bool:
    """Replace the names of settings that a Python file defines by their classes."""
    for key, param in definition.cls.spec.params.items():
        node, family = definition.node.get(key), param.setting
        if node is None or not node.is_map or node.get("module") is None:
            continue
        if family is None or not issubclass(family, Variant):
            continue
        address = f"{definition.address}.{key}"
        cls = own_variant(node, family, address, problems, modules)
        if cls is None and isinstance(modules, ModuleReader):
            del parameters[key]  # an editor reads no such classes: the default stands for it
        elif cls is None:
            return False
        else:
            rest = {name: value for name, value in parameters[key].items() if name != "module"}
            parameters[key] = {**rest, family.key: cls}
    return True


def _large_angles(definition: _Definition, values: Mapping[str, Node]) -> list[Note]:
    """Notes about large angles and turn rates, which are often meant as degrees."""
    notes = []
    for name, node in values.items():
        declared = definition.cls.spec.params.get(name)
        if declared is None or "frequency" in declared.doc:
            continue  # reported with the block; and that of an oscillation is often large
        for number, unit in maybe_degrees(node.plain(), declared.units):
            per = unit.removeprefix("rad")
            written = f"{number:g}deg{per}"
            text = f"{number:g} {unit} is {math.degrees(number):.5g} degrees{per}; "
            text += f"if degrees are intended, write {written}"
            fix = Replace(written, f"{number:g}", f"Write {written}")
            address = f"{definition.address}.{name}"
            notes.append(Note(text, "maybe-degrees", address, definition.full_name, fixes=[fix]))
    return notes
