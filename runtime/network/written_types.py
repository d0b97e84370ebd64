"""Signal types of a graph's own, written in its section ``types``.

In: the section. Out: record types by name, which blocks, parts and wires may name::

    types: {Body: {x: m, v: m/s}}    ->    SignalType("Body", "record", ("x", "v"), ("m", "m/s"))
"""

from __future__ import annotations

from blocks.core import TYPES, Names, SettingError, SignalType
from runtime.document import Node, section
from runtime.errors import Problems


def written_types(document: Node, problems: Problems) -> dict[str, SignalType]:
    """The types of the section ``types``, by name."""
    types = {}
    for name, node in section(document, "types", "types", problems).items():
        address = f"types.{name}"
        if not (name.isidentifier() and name.isascii()) or name in TYPES:
            what = "is a type of the library" if name in TYPES else "is not a name for a type"
            problems.add(node.key, address, f"'{name}' {what}; choose another name")
            continue
        try:
            rows = Names.read(node.plain()).rows if node.is_map else ()
        except (SettingError, ValueError) as error:
            problems.add(node.where, address, str(error) or "expected units as texts")
            continue
        if not rows:
            message = "expected components with their units, as in {x: m, v: m/s}, got "
            problems.add(node.where, address, message + node.describe())
            continue
        names, units = zip(*rows, strict=True)
        types[name] = SignalType(name, "record", names, units)
    return types
