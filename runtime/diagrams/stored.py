"""A diagram's data as JSON in a run folder, from which reports draw it again.

In: a network, or the JSON text. Out: the JSON text, or a :class:`Picture` in which every name and
number was checked. Reports do not build the graph, which would import its modules; and they do not
embed a drawing from the folder, which could contain scripts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict
from typing import Any

from runtime.diagrams.picture import CONSTANT, FATES, MINUS, Box, Net, Part, Picture, picture_of
from runtime.document import SECOND, rate_text
from runtime.files import NUMBER, check_form, parse_json
from runtime.network import Network
from runtime.observation import Probe

SCHEMA_VERSION = 1
# A folder may come from anyone, and the time of a layout grows faster than its size.
MAX_BOXES, MAX_WIRES = 500, 5_000
MAX_LENGTH = 20_000  # of a string and of a list
TOO_LARGE = f"its graph has more than {MAX_BOXES} blocks or {MAX_WIRES} wires"
_PART = {"name": str, "title": str, "parent": str}
_BOX = {
    **{"name": str, "title": str, "type": str, "period": NUMBER, "part": str, "fate": str},
    **{"about": str, "inputs": [str], "outputs": [str]},
}
_NET = {"source": [str], "targets": [[str]], "type": str, "is_ghost": bool, "needs": [str]}
_PICTURE = {"title": str, "boxes": [_BOX], "parts": [_PART], "nets": [_NET]}


def stored_picture(network: Network, probes: Iterable[Probe] = ()) -> str | None:
    """A network's diagram as JSON; None if it is too large to be drawn in a report."""
    if len(network.entries) + len(network.removed_entries) > MAX_BOXES:
        return None
    picture = picture_of(network, probes)
    wires = sum(len(net.targets) for net in picture.nets)
    if wires > MAX_WIRES:
        return None
    data = {
        "schema_version": SCHEMA_VERSION,
        "title": picture.title,
        "boxes": [asdict(box) for box in picture.boxes.values()],
        "parts": [asdict(part) for part in picture.parts.values()],
        "nets": [asdict(net) for net in picture.nets],
    }
    return json.dumps(data, indent=1) + "\n"


def read_picture(text: str) -> Picture:
    """Read a diagram from its JSON text.

    Raises
    ------
    ValueError : the JSON is damaged; the message gives the location.
    """
    try:
        data = parse_json(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"not valid JSON ({error})") from None
    check_form(data, {"schema_version": int})
    if data["schema_version"] != SCHEMA_VERSION:
        raise ValueError(f"expected schema_version {SCHEMA_VERSION}")
    check_form(data, _PICTURE, longest=MAX_LENGTH)
    if max(len(data["boxes"]), len(data["parts"])) > MAX_BOXES:
        raise ValueError(f"more than {MAX_BOXES} blocks or parts")
    picture = Picture(data["title"], {}, {}, [])
    for entry in data["parts"]:
        part = Part(**_fields(entry, _PART))
        _check_name(picture, part.name, part.title, part.parent)
        picture.parts[part.name] = part
    for entry in data["boxes"]:
        box = _box(entry)
        _check_name(picture, box.name, box.title, box.part)
        picture.boxes[box.name] = box
    if not picture.boxes:
        raise ValueError("boxes: expected at least one block")
    sources: set[tuple[tuple[str, str], bool]] = set()
    for entry in data["nets"]:
        net = _net(entry, picture.boxes)
        if (net.source, net.is_ghost) in sources:
            raise ValueError(f"nets: {'.'.join(net.source)} is listed twice")
        sources.add((net.source, net.is_ghost))
        picture.nets.append(net)
    if sum(len(net.targets) for net in picture.nets) > MAX_WIRES:
        raise ValueError(f"nets: more than {MAX_WIRES} wires")
    return picture


def _fields(entry: Mapping[str, Any], form: Mapping[str, Any]) -> dict[str, Any]:
    return {key: entry[key] for key in form}


def _box(entry: Mapping[str, Any]) -> Box:
    entry = {"rate": _rate(entry), **entry}
    check_form(entry, {"rate": str}, longest=MAX_LENGTH)
    box = Box(**_fields(entry, {**_BOX, "rate": str}))
    if not 0.0 <= box.period < math.inf or (box.fate and box.fate not in FATES.values()):
        raise ValueError("boxes: expected a non-negative finite period and a known fate")
    signs = entry.get("signs", {})
    check_form(signs, dict)
    if not all(key in box.inputs and sign in ("+", MINUS) for key, sign in signs.items()):
        raise ValueError("boxes: expected a sign, + or −, for inputs only")
    box.signs = signs
    box.value = entry.get("value", "")
    check_form({"value": box.value}, {"value": str}, longest=MAX_LENGTH)
    box.open = entry.get("open", [])
    check_form(box.open, [str])
    box.probed = entry.get("probed", [])
    check_form(box.probed, [str])
    if not (set(box.open) <= set(box.inputs) and set(box.probed) <= set(box.outputs)):
        raise ValueError("boxes: expected open inputs among the inputs, probed among the outputs")
    for ports in (box.inputs, box.outputs):
        _check_distinct(ports, "inputs and outputs")
    return box


def _rate(entry: Mapping[str, Any]) -> str:
    """The rate of a box that was stored before boxes had a string for it."""
    return rate_text(entry["period"], SECOND) if entry["period"] > 0.0 else CONSTANT


def _net(entry: Mapping[str, Any], boxes: Mapping[str, Box]) -> Net:
    ends = [entry["source"], *entry["targets"]]
    if any(len(end) != 2 for end in ends):
        raise ValueError("nets: expected [block, port]")
    source, *targets = [(name, port) for name, port in ends]
    if source[0] not in boxes or source[1] not in boxes[source[0]].outputs:
        raise ValueError("nets: unknown source")
    _check_distinct(targets, "targets")
    if not targets:
        raise ValueError("nets: expected at least one target")
    if any(name not in boxes or port not in boxes[name].inputs for name, port in targets):
        raise ValueError("nets: unknown target")
    _check_distinct(entry["needs"], "needs")
    return Net(source, tuple(targets), entry["type"], entry["is_ghost"], tuple(entry["needs"]))


def _check_distinct(items: Collection[Any], key: str) -> None:
    if len(items) > MAX_WIRES or len(set(items)) < len(items):
        raise ValueError(f"{key}: expected up to {MAX_WIRES} distinct entries")


def _check_name(picture: Picture, name: str, title: str, part: str) -> None:
    """Check a full name: it begins with the name of the part around it, which is listed before."""
    if part and part not in picture.parts:
        raise ValueError(f"'{name[:60]}' is in a part that is not listed before it")
    if not title or name != (f"{part}.{title}" if part else title):
        raise ValueError(f"expected the full name of '{title[:60]}', got '{name[:60]}'")
    if name in picture.boxes or name in picture.parts:
        raise ValueError(f"'{name[:60]}' is listed twice")
