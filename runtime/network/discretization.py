"""Continuous blocks of a graph replaced by their forms in discrete time.

In: a checked network, its document, a method and a step. Out: the document with other entries for
blocks that offer such a form (``Block.discretized``), and notes that say so::

    pid: {type: PID, kp: 2}   ->   pid: {type: DiscretePID, kp: 2, n: 100, method: tustin, dt: 0.01}
"""

from __future__ import annotations

from collections.abc import Collection

from blocks.core import ParameterError, hint
from runtime.document import Node, set_entry
from runtime.errors import UsageError
from runtime.network.network import Network

METHODS = ("tustin", "zoh", "matched")


def discretize(
    network: Network,
    document: Node,
    method: str,
    step: float,
    names: Collection[str] = (),
    origin: str = "",
) -> tuple[Node, list[str]]:
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
        notes.append(f"'{name}' is now a {made['type']} with dt = {step:g} ({method})")
    if not done:
        raise UsageError(f"{place}no block has a form in discrete time")
    return document, notes
