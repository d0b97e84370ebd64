"""States with which a run begins: those that earlier runs ended with.

In: the entries ``from`` and ``initial``, and the folders of runs that they name. Out: arrays by
block and state, each of the shape that the block declares::

    from: runs/line/latest                        all blocks of the same names and shapes
    initial: {snn.weights: runs/trained/latest}   this state alone, after `from`
    initial: {plant.x: [0.1, 0]}                  numbers
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from blocks.core import FloatArray, GraphInput, StoredArray, misspelt
from blocks.messages import Note
from runtime.document import Node
from runtime.errors import Problems
from runtime.network.addresses import Endpoint
from runtime.network.contexts import whole_shape
from runtime.network.network import Network
from runtime.streaming import DAMAGED, open_arrays

STATES = "states.npz"
ANEW = (
    "the run begins with states of another one, at t = 0: time and noise begin again, so with "
    "noise it differs from a longer run"
)
Initial = dict[str, dict[str, FloatArray]]


def read_initial(network: Network, problems: Problems) -> tuple[Initial, list[Note]]:
    """The states by block and name that ``from`` and ``initial`` take from runs, and notes.

    ``from`` gives its states to all blocks of the same name whose states have the same shapes,
    ``initial`` to the blocks or states that it names.
    """
    initial: Initial = {}
    notes: list[Note] = []
    files: dict[str, dict[str, FloatArray] | None] = {}
    whole, entries = (network.document.get(key) for key in ("from", "initial"))
    runs = [whole] if whole is not None else []
    runs += [each for _, each in entries.items()] if entries is not None and entries.is_map else []
    if any(isinstance(node.value, str) and node.value for node in runs):
        notes.append(Note(ANEW, "starts-anew"))
    if whole is not None and whole.value is not None:
        arrays = _states(whole, "from", files, problems)
        if arrays is not None:
            notes += _take_all(network, arrays, initial, whole, problems)
    if entries is None or entries.value is None:
        return initial, notes
    if not entries.is_map:
        message = f"expected entries such as 'snn.weights: RUN', got {entries.describe()}"
        problems.add(entries.where, "initial", message)
        return initial, notes
    for address, node in entries.items():
        if isinstance(node.value, (int, float, list, StoredArray)):
            _take_numbers(network, address, node, initial, problems)
            continue
        arrays = _states(node, f"initial.{address}", files, problems)
        if arrays is not None:
            _take(network, address, arrays, initial, node, problems)
    return initial, notes


def _states(
    node: Node, address: str, files: dict[str, dict[str, FloatArray] | None], problems: Problems
) -> dict[str, FloatArray] | None:
    """The states that a run folder holds, each file read once."""
    if not isinstance(node.value, str):
        problems.add(node.where, address, f"expected a run folder, got {node.describe()}")
        return None
    if node.value in files:
        return files[node.value]
    folder = Path(node.value)
    folder = folder.parent if folder.name == "manifest.json" else folder
    arrays: dict[str, FloatArray] | None = None
    try:
        arrays = dict(open_arrays(folder / STATES))
    except FileNotFoundError:
        message = f"'{node.value}' has no {STATES}"
        if not folder.is_dir():
            message = f"no such run: '{node.value}'; paths are relative to the graph's own file"
        elif (folder / "manifest.json").is_file():
            message += (
                ": the run was made by an older version or with run.states: none; run it again"
            )
        problems.add(node.where, address, message)
    except DAMAGED as error:
        reason = getattr(error, "strerror", None) or error
        problems.add(
            node.where, address, f"'{folder / STATES}' is damaged: {reason}; run that graph again"
        )
    # None as well, so that a run that cannot be read is reported once.
    files[node.value] = arrays
    return arrays


def _take_all(
    network: Network,
    arrays: Mapping[str, FloatArray],
    initial: Initial,
    node: Node,
    problems: Problems,
) -> list[Note]:
    """Whatever fits; returns a note on the blocks that differ."""
    fit, differing = set(), set()
    for name, array in arrays.items():
        block, _, state = name.rpartition(".")
        entry = network.entries.get(block)
        if entry is not None and entry.cls is GraphInput:
            continue  # what was written to an input is not the graph's memory
        if _misfit(network, block, state, array):
            differing.add(block)
        else:
            fit.add(block)
            initial.setdefault(block, {})[state] = array
    # A block takes all of its states or none: with half of them it would begin in a state in which
    # it never was.
    for block in differing:
        initial.pop(block, None)
    if not fit - differing:
        problems.add(
            node.where, "from", f"no block has the name and the states of one in '{node.value}'"
        )
    unfit = sorted(block for block in differing if block in network.entries)
    text = f"{', '.join(unfit)} differ from the run's and start anew"
    return [Note(text, "starts-anew", "from")] if unfit else []


def _take(
    network: Network,
    address: str,
    arrays: Mapping[str, FloatArray],
    initial: Initial,
    node: Node,
    problems: Problems,
) -> None:
    """The states that an entry of ``initial`` names: one, or all of a block."""
    place = f"initial.{address}"
    if address in network.entries:
        states = {n: a for n, a in arrays.items() if n.rpartition(".")[0] == address}
    else:
        states = {address: arrays[address]} if address in arrays else {}
    if not states:
        known = [*arrays, *(name.rpartition(".")[0] for name in arrays)]
        text, other = "the run has no state of that name", ", ".join(sorted(arrays)) or "none"
        unknown = misspelt("unknown-name", text, address, known, f"; it has {other}")
        problems.add(node.key, place, unknown)
    for name, array in states.items():
        block, _, state = name.rpartition(".")
        message = _misfit(network, block, state, array)
        if message:
            problems.add(node.key, place, message)
        else:
            initial.setdefault(block, {})[state] = array


def _take_numbers(
    network: Network, address: str, node: Node, initial: Initial, problems: Problems
) -> None:
    """The numbers that an entry of ``initial`` gives; one number stands for all of a state."""
    block, _, state = address.rpartition(".")
    try:
        array = np.asarray(node.plain(), dtype=np.float64)
    except (TypeError, ValueError):
        problems.add(node.where, f"initial.{address}", f"expected numbers, got {node.describe()}")
        return
    entry = network.entries.get(block)
    shape = None
    if entry is not None and state in entry.cls.spec.states:
        shape = whole_shape(network, Endpoint(block, state))
    if not array.ndim and shape is not None:
        array = np.full(shape, float(array))
    message = _misfit(network, block, state, array, "what is given")
    if message:
        problems.add(node.key, f"initial.{address}", message)
    else:
        initial.setdefault(block, {})[state] = array


def _misfit(
    network: Network, block: str, state: str, array: FloatArray, given: str = "that of the run"
) -> str:
    """Why an array is no state of a block; '' if it is one."""
    entry = network.entries.get(block)
    if entry is None:
        text = f"there is no block '{block}'"
        return misspelt("unknown-name", text, block, network.entries)
    if state not in entry.cls.spec.states:
        text = f"'{block}' has no state '{state}'"
        return misspelt("unknown-name", text, state, entry.cls.spec.states)
    shape = whole_shape(network, Endpoint(block, state))
    if shape is not None and shape != array.shape:
        return f"state '{state}' of '{block}' has the shape {shape}, {given} {array.shape}"
    return ""
