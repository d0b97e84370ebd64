"""The sections of a graph: what each contains, and how it is read.

In: a document and a section's name. Out: its entries, with a problem for each key that does not
exist and a suggestion::

    check_keys(node, RUN_KEYS, "run", problems, "key")
    # line.yaml:2:6: run.duration: unknown key, did you mean 'until'?
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from blocks.core import misspelt, similar
from runtime.document.node import Node
from runtime.errors import Problems

SECTIONS = {
    "graph": "the title",
    "run": "dt, until, seed, engine and memory",
    "params": "values for $names",
    "types": "signal types: names and units of components",
    "defaults": "values that blocks take where they give none, by key or by type",
    "world": "walls and obstacles",
    "inputs": "signals that come from outside",
    "outputs": "signals that are for others, by name",
    "blocks": "the boxes",
    "wires": "consumer: {input: producer.output}",
    "probes": "what is recorded",
    "plots": "plots of probes",
    "metrics": "numbers from probes",
    "without": "blocks to leave out, with their wires",
    "bypass": "blocks to bypass",
    "from": "a run with whose final states this one begins",
    "initial": "blocks or states, each with a run that it begins from",
}
WRITTEN_ORDER = (
    "graph",
    "run",
    "params",
    "types",
    "defaults",
    "inputs",
    "outputs",
    "blocks",
    "wires",
    "without",
    "bypass",
    "from",
    "initial",
    "probes",
    "plots",
    "metrics",
)
PART_SECTIONS = (
    "params",
    "inputs",
    "outputs",
    "blocks",
    "wires",
    "graph",
    "part",
    "repeat",
    "share",
    "defaults",
    "seed",
)
# Sections whose entries may name files, beside ``blocks``: those with a kind of a user's own.
FILE_SECTIONS = ("plots", "metrics")
# Entries of a block that name a file, relative to the file that they are written in.
FILE_KEYS = ("module", "file")
EXAMPLES = {
    "run": "dt: 0.001",
    "params": "v_r: 1.0",
    "types": "Body: {x: m, v: m/s}",
    "defaults": "dt: 0.01",
    "world": "circles: [[0.3, -1.5, 0.5]]",
    "blocks": "total: {type: Sum}",
    "wires": "lqr: {error: error.state}",
    "probes": "pose: plant.pose",
    "plots": "path: {kind: trajectory, of: plant.pose}",
    "metrics": "miss: {kind: rms, of: error.lateral}",
    "initial": "snn.weights: runs/my/latest",
    "inputs": "push: {type: Scalar, default: 0.0}",
    "outputs": "command: join.out",
}
MAX_TITLE = 120
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_-]{0,99}")
# Parameters of numpy.savez, which stores the probes by name.
_RESERVED = ("file", "allow_pickle")


def rename_files(plain: dict[str, Any], new_name: Callable[[str, str], str]) -> dict[str, Any]:
    """A document in which the files that its entries name have other names.

    ``renamed`` gives the new name for a key of :data:`FILE_KEYS` and the old one.
    """
    result = dict(plain)
    for key in ("blocks", *FILE_SECTIONS):
        if isinstance(plain.get(key), dict):
            result[key] = {
                name: _rename_files_of(entry, new_name) if isinstance(entry, dict) else entry
                for name, entry in plain[key].items()
            }
    return result


def _rename_files_of(entry: dict[str, Any], new_name: Callable[[str, str], str]) -> dict[str, Any]:
    """An entry, the settings and the inner blocks of a block included."""
    if isinstance(entry.get("blocks"), dict):
        inner = {"blocks": entry["blocks"]}
        entry = {**entry, **rename_files(inner, new_name)}
    result = dict(entry)
    for key, value in entry.items():
        if key in FILE_KEYS and isinstance(value, str):
            result[key] = new_name(key, value)
        # A setting of a block, such as a neuron model of a user's file.
        elif isinstance(value, dict) and isinstance(value.get("module"), str):
            result[key] = {**value, "module": new_name("module", value["module"])}
    return result


def in_order(plain: dict[str, Any]) -> dict[str, Any]:
    """A graph's plain values with the sections in the order in which they are written."""
    result = {key: plain[key] for key in WRITTEN_ORDER if key in plain}
    return {**result, **{key: value for key, value in plain.items() if key not in result}}


def expected_form(name: str) -> str:
    """What a section should contain, for messages."""
    return f"expected entries such as '{EXAMPLES[name]}'"


def is_part(entry: Node) -> bool:
    """Whether an entry of ``blocks`` is a part."""
    return entry.get("part") is not None or entry.get("blocks") is not None


def check_keys(
    node: Node,
    known: Iterable[str],
    address: str,
    problems: Problems,
    noun: str,
    also: Mapping[str, str] | None = None,
) -> None:
    """Report unknown entries of a mapping; ``also`` has other tools' names of known ones."""
    for name, item in node.items():
        if name not in known:
            other = f"; expected {', '.join(known)}"
            place = f"{address}.{name or repr(name)}".lstrip(".")
            message = misspelt("unknown-key", f"unknown {noun}", name, known, other, also)
            problems.add(item.key, place, message)


def section(
    document: Node, name: str, address: str, problems: Problems, unread: set[str] | None = None
) -> dict[str, Node]:
    """The entries of a section; reports one that is not a mapping, and adds it to ``unread``."""
    node = document.get(name)
    if node is None or node.value is None:
        return {}
    if not node.is_map:
        problems.add(node.where, address, f"{expected_form(name)}, got {node.describe()}")
        if unread is not None:
            unread.add(name)
        return {}
    return dict(node.items())


def strings(
    node: Node | None, address: str, what: str, problems: Problems
) -> list[tuple[Node, str]]:
    """The nodes of a string or a list of strings, each with its address."""
    if node is None:
        return []
    items = node.value if node.is_list else [node]
    pairs = []
    for i, item in enumerate(items):
        place = f"{address}[{i}]" if node.is_list else address
        if isinstance(item.value, str):
            pairs.append((item, place))
        else:
            problems.add(item.where, place, f"expected {what}, got {item.describe()}")
    return pairs


def misspelt_keys(node: Node, known: Iterable[str]) -> set[str]:
    """Known keys that are missing because they are misspelt."""
    names = {name for name, _ in node.items()}
    # 'block:' is reported as unknown; without this, 'blocks' would be reported as missing as well.
    return {similar(name, known) for name in names.difference(known)} - names


def name_problem(name: str, is_probe: bool) -> str:
    """Why a probe, plot or metric cannot have this name; '' if it can."""
    if not _NAME.fullmatch(name):
        return f"'{name[:40]}' is not a valid name; use up to 100 letters, digits, _ and -"
    if is_probe and name in _RESERVED:
        return f"'{name}' is reserved in the file of a run's probes; use another name"
    return ""


def read_title(document: Node, problems: Problems) -> str:
    """The title of a graph; "graph" if it has none, or a wrong one."""
    node = document.get("graph")
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
