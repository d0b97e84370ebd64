"""From names to a checked network: blocks constructed, wires resolved, types settled."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from blocks.core import (
    TYPES,
    Block,
    MissingPackageError,
    ParameterError,
    SignalType,
    beyond_a_turn,
    hint,
    signal_type,
)
from blocks.world import World
from runtime.document import MAX_TICKS, Node, meant, read_run, seconds, section
from runtime.errors import MissingExtraError, Problems
from runtime.network.addresses import Endpoint
from runtime.network.block_types import block_class, own_types
from runtime.network.inference import infer_types, report_open
from runtime.network.network import Entry, Network
from runtime.network.open_inputs import report_open_inputs
from runtime.network.removal import remove
from runtime.network.scope import Scope, expand
from runtime.network.shapes import MAX_BYTES, whole_shape
from runtime.network.units import check_units
from runtime.network.wiring import Wiring

BLOCK_KEYS = ("type", "module", "dt")
MAX_TITLE = 120


def build(
    document: Node,
    problems: Problems,
    classes: Mapping[str, type[Block]] | None = None,
    kinds: Mapping[str, SignalType] | None = None,
    modules: bool = True,
) -> tuple[Network, MissingExtraError | None]:
    """Build the network of a document that stands by itself (nothing to extend or inline).

    Parameters
    ----------
    problems : takes what is wrong; the network is sound only if there is nothing.
    classes, kinds : block types and signal types beside the library's, of graphs made in Python.
    modules : whether Python files that the graph names are imported.

    Returns
    -------
    tuple : the network, and the extra that one of its blocks needs and that is not installed.
    """
    scope, document = expand(document, problems)
    before = len(problems.found)
    network = _empty_network(document, scope, problems)
    network.document = document
    network.kinds.update(kinds or {})
    network.world = _world(document, problems)
    can_run = len(problems.found) == before
    _add_blocks(network, scope, classes or {}, problems, modules)
    wiring = Wiring(network, problems)
    wiring.resolve()
    remove(network, document, problems)
    infer_types(network, problems)
    if not problems.found:
        check_units(network, problems)
    report_open_inputs(network, wiring, problems)
    if not problems.found:
        report_open(network, problems)
    missing = _check_settings(network, problems) if can_run else None
    extra = None if missing is None else MissingExtraError(missing.feature, missing.extra)
    return network, extra


def _empty_network(document: Node, scope: Scope, problems: Problems) -> Network:
    run = read_run(document, problems)
    title = _title(document.get("graph"), problems)
    network = Network(title, run.dt, run.until, run.seed, scope)
    network.engine, network.memory = run.engine, run.memory
    return network


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
        problems.add(node.where, "world", f"expected lengths in m, too large ones here: {error}")
        return None
    except ParameterError as error:
        for address, text in error.problems:
            found = node
            for name in re.findall(r"\w+", address):
                inner = found.get(name) if found.is_map else None
                if found.is_list and name.isdigit() and int(name) < len(found.value):
                    inner = found.value[int(name)]
                found = found if inner is None else inner
            problems.add(found.where, f"world.{address}".rstrip("."), text)
        return None


def _title(node: Node | None, problems: Problems) -> str:
    if node is None or node.value is None:
        return "graph"
    good = isinstance(node.value, (str, int, float)) and not isinstance(node.value, bool)
    title = str(node.value)
    if not good or not title.isprintable() or len(title) > MAX_TITLE:
        message = (
            f"expected a title, one line of up to {MAX_TITLE} characters, got {node.describe()}"
        )
        problems.add(node.where, "graph", message)
        return "graph"
    return title


def _add_blocks(
    network: Network,
    top: Scope,
    classes: Mapping[str, type[Block]],
    problems: Problems,
    modules: bool,
) -> None:
    """Find every block's class, and with them the signal types that they bring; then make them."""
    found = []
    for scope in top.walk():
        for name, node in scope.blocks.items():
            address = scope.path("blocks", name)
            cls = block_class(node, address, classes, problems, modules)
            if cls is not None:
                found.append((scope, name, node, cls))
                _add_kinds(network, node, address, cls, problems)
    for item in found:
        _add_block(network, *item, problems)


def _add_kinds(
    network: Network, node: Node, address: str, cls: type[Block], problems: Problems
) -> None:
    """Note the signal types that a block's class and its module bring."""
    for kind in own_types(cls, node):
        if network.kinds.setdefault(kind.name, kind) != kind or kind.name in TYPES:
            message = (
                f"the signal type '{kind.name}' of this block differs from another of that name"
            )
            problems.add(node.key, address, message + " in the graph; rename one of them")


def _add_block(
    network: Network,
    scope: Scope,
    name: str,
    node: Node,
    cls: type[Block],
    problems: Problems,
) -> None:
    address = scope.path("blocks", name)
    values = {key: item for key, item in node.items() if key not in BLOCK_KEYS}
    known = cls.spec.params
    unknown = [key for key in values if key not in known]
    for key in unknown:
        suggestion = hint(key, known) or f"; it has {', '.join(known) or 'none'}"
        if key == "graph":
            suggestion = "; parts are read with the file that names them"
        problems.add(values[key].key, f"{address}.{key}", f"unknown parameter{suggestion}", True)
    block: Block | None = None
    try:
        made = cls(**_given(network, {k: item for k, item in values.items() if k in known}, cls))
        dict(made.variables), dict(made.sizes())
        block = made
        network.notes += _turned(cls, address, values)
    except ParameterError as error:
        misspelt = {meant(key, known) for key in unknown}
        for parameter, text in error.problems:
            if parameter in values or parameter not in misspelt:
                where = values[parameter].where if parameter in values else node.key
                problems.add(where, f"{address}.{parameter}", text)
    except (Exception, SystemExit) as error:  # noqa: BLE001 -- a user's block may raise anything
        problems.add(node.key, address, _failed(cls, error))
    full = scope.prefix + name
    every = _ticks(node.get("dt"), network.dt, address, problems)
    network.entries[full] = Entry(full, scope, node, cls, block, every)


def _given(network: Network, values: Mapping[str, Node], cls: type[Block]) -> dict[str, Any]:
    """The parameters as a block takes them, with the graph's own signal types looked up.

    Raises
    ------
    ParameterError : there is no such type.
    """
    plain = {key: item.plain() for key, item in values.items()}
    for key, value in plain.items():
        if network.kinds and cls.spec.params[key].kind == "signal" and isinstance(value, str):
            try:
                plain[key] = signal_type(value, own=network.kinds)
            except ValueError as error:
                near = hint(value, [*network.kinds, *TYPES])
                raise ParameterError([(key, f"{error}{near}")]) from None
    return plain


def _turned(cls: type[Block], address: str, values: Mapping[str, Node]) -> list[str]:
    """Angles of more than a turn, which are most often degrees."""
    notes = []
    for name, node in values.items():
        if name not in cls.spec.params:
            continue  # reported with the block
        for number in beyond_a_turn(node.plain(), cls.spec.params[name].units):
            message = f"{number:g} rad is {math.degrees(number):.5g} degrees"
            notes.append(f"{address}.{name}: {message}; if degrees are meant, write {number:g}deg")
    return notes


def _failed(cls: type[Block], error: BaseException) -> str:
    return f"{cls.__name__} failed: {type(error).__name__}: {error}"


def _ticks(node: Node | None, base: float, address: str, problems: Problems) -> int:
    """How many base ticks lie between two ticks of a block."""
    value = None if node is None else seconds(node, f"{address}.dt", problems)
    if node is None or value is None:
        return 1
    ratio = value / base
    whole = round(ratio) if ratio < MAX_TICKS else 0
    if whole < 1 or abs(ratio - whole) > 1e-6:
        near = max(1, whole) * base
        message = (
            f"{value:g} s is no whole multiple of run.dt = {base:g} s; the nearest is {near:g}"
        )
        problems.add(node.where, f"{address}.dt", message)
        return 1
    return whole


def _misshapen(network: Network, name: str) -> str:
    """Which of a block's arrays cannot be made, and why; '' if all can."""
    spec = network.entries[name].cls.spec
    for key in (*spec.states, *spec.outputs):
        shape = whole_shape(network, Endpoint(name, key)) or ()
        size = 8 * math.prod(shape)
        if any(n < 0 for n in shape):
            return f"state '{key}' has a negative length"
        if size > MAX_BYTES:
            return f"'{key}' would take {min(size, 10**300) / 1024**3:.4g} GiB; make it smaller"
    return ""


def _check_settings(network: Network, problems: Problems) -> MissingPackageError | None:
    """Let each block check its surroundings, once all its ports have types.

    Returns what one of them lacks to run, which is no fault of the graph.
    """
    missing: MissingPackageError | None = None
    for name, entry in network.entries.items():
        if entry.block is None or not network.is_typed(name):
            continue
        try:
            context = network.context(name)
            message = _misshapen(network, name)
            if message:
                problems.add(entry.node.key, entry.address, message)
                continue
            entry.block.validate_in(context)
        except ParameterError as error:
            for parameter, text in error.problems:
                item = entry.node.get(parameter)
                where = item.where if item is not None else entry.node.key
                problems.add(where, f"{entry.address}.{parameter}", text)
        except MissingPackageError as error:
            missing = error
        except (Exception, SystemExit) as error:  # noqa: BLE001 -- a user's block may raise anything
            problems.add(entry.node.key, entry.address, _failed(entry.cls, error))
    return missing
