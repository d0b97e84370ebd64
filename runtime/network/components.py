"""Components of signals, by name, number or range: ``pose.theta``, ``out.1``, ``out[0:2]``.

In: a signal type and an address. Out: the type, the columns or the names of the component::

    component_type(Pose, Endpoint("plant", "pose", "theta"))      # Scalar
    columns(Vector(6), "2:4")                                     # slice(2, 4)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from blocks.core import Scalar, SignalType, Vector
from runtime.network.addresses import Endpoint, bounds, is_range

Port = tuple[str, str]


def component_type(kind: SignalType, end: Endpoint) -> SignalType | None:
    """The type at the end of an address; None where the component does not exist.

    A range of a vector is one of its kind, and a range of a record a vector; its length is open
    as long as that of the signal is.
    """
    if not end.component:
        return kind
    if is_range(end.component):
        return _range_type(kind, end.component)
    # Not '01', nor digits of other scripts: one component has one name.
    if end.component.isdigit() and end.component != str(_number(end.component)):
        return None
    return Scalar if kind.column(end.component) is not None else None


def _range_type(kind: SignalType, component: str) -> SignalType | None:
    if kind.form == "scalar" or (kind.form == "array" and kind.components):
        return None
    # The length is open as yet; the range is checked once it is known.
    if kind.symbol:
        return kind
    indices = columns(kind, component)
    if not isinstance(indices, slice):
        return None
    length = indices.stop - indices.start
    if kind.form == "record":
        return Vector(length)
    return replace(kind.sized(length), rows=kind.rows[indices])


def columns(kind: SignalType, component: str) -> int | slice | None:
    """The index, or the indices, of a component; None where it does not exist."""
    if not is_range(component):
        return kind.column(component)
    ends = bounds(component)
    if ends is None or len(kind.shape) != 1:
        return None
    start, last = ends
    stop = kind.shape[0] if last is None else last
    return slice(start, stop) if start < stop <= kind.shape[0] else None


def first_column(kind: SignalType, component: str) -> int:
    """The index of a component of a signal, or of the first number of a range."""
    index = columns(kind, component) if component else 0
    return index.start if isinstance(index, slice) else int(index or 0)


def component_names(kind: SignalType, end: Endpoint) -> list[str]:
    """The components at an address, one by one, as in an address; [''] for a number."""
    if kind.form == "scalar" or (end.component and not is_range(end.component)):
        return [end.component]
    names = list(kind.names)
    index = columns(kind, end.component) if end.component else slice(None)
    return names[index] if isinstance(index, slice) else []


def _number(text: str) -> int | None:
    return int(text) if text.isascii() else None


def unknown_component(kind: SignalType, end: Endpoint) -> str:
    """What is wrong with a component that a signal does not have."""
    if kind.form == "scalar":
        has = "it is a scalar"
    elif kind.form == "record":
        has = f"its components: {', '.join(kind.components)}"
    elif kind.components:
        has = "only records and vectors have components"
    else:
        last = kind.length - 1 if isinstance(kind.length, int) else "its length"
        has = f"its components: {', '.join(kind.names) if kind.rows else f'0 to {last}'}"
        if is_range(end.component):
            has += "; a range ends before its second number, as in [0:2]"
    return f"{kind} '{end.block}.{end.port}' has no component '{end.component}'; {has}"


def pass_misses(
    types: dict[Port, SignalType], reading: Sequence[tuple[Port, Sequence[Port]]]
) -> None:
    """Let what is computed of a signal with misses be infinite, as the largest range of a scan.

    types : of outputs, changed in place.
    reading : a source, and the outputs that are computed of it.
    """
    passed = bool(reading) and not all(kind.finite for kind in types.values())
    while passed:
        passed = False
        for source, outputs in reading:
            for port in outputs if source in types and not types[source].finite else ():
                if port in types and types[port].finite:
                    types[port] = replace(types[port], finite=False)
                    passed = True
