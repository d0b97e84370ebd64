"""A diagram's data as JSON in a run folder, from which reports draw it again.

Reports do not build the graph, which would import its modules; and they do not embed a drawing
from the folder, which could contain scripts.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from runtime.diagrams.picture import FATES, Box, Net, Part, Picture, picture_of
from runtime.network import Network

SCHEMA_VERSION = 1
MAX_BOXES, MAX_WIRES = 500, 5_000
MAX_TEXT = 20_000  # characters
TOO_LARGE = f"its graph has more than {MAX_BOXES} blocks or {MAX_WIRES} wires"


def stored_picture(network: Network) -> str | None:
    """A network's diagram as JSON; None if it is too large to be drawn in a report."""
    picture = picture_of(network)
    wires = sum(len(net.targets) for net in picture.nets)
    if len(picture.boxes) > MAX_BOXES or wires > MAX_WIRES:
        return None
    shown = {
        "schema_version": SCHEMA_VERSION,
        "title": picture.title,
        "boxes": [asdict(box) for box in picture.boxes.values()],
        "parts": [asdict(part) for part in picture.parts.values()],
        "nets": [asdict(net) for net in picture.nets],
    }
    return json.dumps(shown, indent=1) + "\n"


def read_picture(text: str) -> Picture:
    """Read a diagram from its JSON text.

    Raises
    ------
    ValueError : the text is damaged; the message gives the location.
    """
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ValueError(f"not valid JSON ({error})") from None
    shown = _mapping(found, "top level")
    if shown.get("schema_version") != SCHEMA_VERSION:
        raise ValueError(f"expected schema_version {SCHEMA_VERSION}")
    picture = Picture(_text(shown, "title"), {}, {}, [])
    for entry in _list(shown, "parts", MAX_BOXES):
        part = Part(_text(entry, "name"), _text(entry, "title"), _text(entry, "parent"))
        _check_name(picture, part.name, part.title, part.parent)
        picture.parts[part.name] = part
    for entry in _list(shown, "boxes", MAX_BOXES):
        box = _box(entry)
        _check_name(picture, box.name, box.title, box.part)
        picture.boxes[box.name] = box
    if not picture.boxes:
        raise ValueError("boxes: expected at least one block")
    seen: set[tuple[tuple[str, str], bool]] = set()
    for entry in _list(shown, "nets", MAX_WIRES):
        net = _net(entry, picture.boxes)
        if (net.source, net.is_ghost) in seen:
            raise ValueError(f"nets: {'.'.join(net.source)} is listed twice")
        seen.add((net.source, net.is_ghost))
        picture.nets.append(net)
    if sum(len(net.targets) for net in picture.nets) > MAX_WIRES:
        raise ValueError(f"nets: more than {MAX_WIRES} wires")
    return picture


def _box(entry: Mapping[str, Any]) -> Box:
    period, fate = entry.get("period"), _text(entry, "fate")
    if isinstance(period, bool) or not isinstance(period, (int, float)):
        raise ValueError("boxes: expected a period in s")
    if not 0.0 <= period < math.inf or (fate and fate not in FATES.values()):
        raise ValueError("boxes: expected a non-negative finite period and a known fate")
    return Box(
        name=_text(entry, "name"),
        title=_text(entry, "title"),
        type=_text(entry, "type"),
        period=float(period),
        part=_text(entry, "part"),
        fate=fate,
        about=_text(entry, "about"),
        inputs=_ports(entry, "inputs"),
        outputs=_ports(entry, "outputs"),
    )


def _net(entry: Mapping[str, Any], boxes: Mapping[str, Box]) -> Net:
    ends = [entry.get("source"), *_items(entry, "targets", MAX_WIRES)]
    pairs = []
    for end in ends:
        if not (isinstance(end, list) and len(end) == 2 and all(isinstance(x, str) for x in end)):
            raise ValueError("nets: expected [block, port]")
        pairs.append((end[0], end[1]))
    source, *targets = pairs
    if source[0] not in boxes or source[1] not in boxes[source[0]].outputs:
        raise ValueError("nets: unknown source")
    if not targets or len(set(targets)) < len(targets):
        raise ValueError("nets: expected one or more distinct targets")
    if any(name not in boxes or port not in boxes[name].inputs for name, port in targets):
        raise ValueError("nets: unknown target")
    if not isinstance(entry.get("is_ghost"), bool):
        raise ValueError("nets: expected is_ghost, true or false")
    needs = tuple(_ports(entry, "needs"))
    return Net(source, tuple(targets), _text(entry, "type"), entry["is_ghost"], needs)


def _check_name(picture: Picture, name: str, title: str, part: str) -> None:
    """Check a full name: it begins with the name of the part around it, which is listed before."""
    if part and part not in picture.parts:
        raise ValueError(f"'{name[:60]}' is in a part that is not listed before it")
    if not title or name != (f"{part}.{title}" if part else title):
        raise ValueError(f"expected the full name of '{title[:60]}', got '{name[:60]}'")
    if name in picture.boxes or name in picture.parts:
        raise ValueError(f"'{name[:60]}' is listed twice")


def _mapping(value: Any, address: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{address}: expected an object, got {type(value).__name__}")
    return value


def _items(entry: Mapping[str, Any], key: str, most: int) -> list[Any]:
    value = entry.get(key)
    if not isinstance(value, list) or len(value) > most:
        raise ValueError(f"{key}: expected a list of up to {most}")
    return value


def _list(entry: Mapping[str, Any], key: str, most: int) -> list[dict[str, Any]]:
    return [_mapping(item, key) for item in _items(entry, key, most)]


def _ports(entry: Mapping[str, Any], key: str) -> list[str]:
    found = _items(entry, key, MAX_WIRES)
    if not all(isinstance(item, str) for item in found) or len(set(found)) < len(found):
        raise ValueError(f"{key}: expected distinct names")
    return list(found)


def _text(entry: Mapping[str, Any], key: str) -> str:
    value = entry.get(key)
    if not isinstance(value, str) or len(value) > MAX_TEXT:
        raise ValueError(f"{key}: expected a string of up to {MAX_TEXT} characters")
    return value
