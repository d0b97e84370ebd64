"""What goes in and out of a session between two ticks: signals that are read, inputs written.

In: an engine, addresses, and values. Out: floats and arrays; the engine's inputs set::

    signals = Signals(engine)
    signals.read("plant.pose.x", "error.lateral")      # (0.5, -0.1)
    signals.write("push", 2.0)                         # within the bounds of the graph's input
    signals.clear()                                    # a block has other parameters now
"""

from __future__ import annotations

import math
import sys
from typing import Any, NamedTuple

from blocks.core import FloatArray, hint
from runtime.engine import Engine, Reader
from runtime.errors import UsageError
from runtime.network import PortDeclaration
from runtime.plan import Signal, Source, StateArray
from runtime.runs import output_at


class _Slot(NamedTuple):
    """An input of the graph: its array, and the floats that it takes; none but of a scalar."""

    port: PortDeclaration
    array: FloatArray
    low: float = math.inf
    high: float = -math.inf


class Signals:
    """Reads and writes of one engine; what they need is prepared once."""

    def __init__(self, engine: Engine) -> None:
        self.engine = engine
        self._readers: dict[tuple[str, ...], Reader] = {}
        self._slots: dict[str, _Slot] = {}

    def clear(self) -> None:
        """Forget what reads: its text has the parameters of blocks."""
        self._readers.clear()

    def read(self, *addresses: str) -> Any:
        """As :meth:`Session.read`."""
        if addresses not in self._readers:
            if not addresses:
                raise UsageError("read: expected an address, as in read('plant.pose')")
            self._readers[addresses] = Reader(self.engine, [*map(self._source, addresses)])
        values = self._readers[addresses]()
        return values[0] if len(values) == 1 else values

    def _source(self, address: str) -> Source:
        """What an address names."""
        network = self.engine.network
        end = output_at(network, str(address))
        kind = network.types.get((end.block, end.port))
        if kind is not None:
            source = Source(Signal(end.block, end.port, kind), end.component)
            exists = not end.component or source.columns is not None
        else:
            shape = getattr(self.engine.state.blocks[end.block], end.port).shape
            source = Source(StateArray(end.block, end.port, shape), end.component)
            row = end.component
            exists = not row or (row.isdecimal() and bool(shape) and int(row) < shape[0])
        if not exists:
            raise UsageError(f"'{address}': there is no component '{end.component}'")
        return source

    def write(self, port: str, value: Any) -> Any:
        """Set an input of the graph; returns what was written, a float or an array.

        Raises
        ------
        UsageError : there is no such input, or the value is none of its type or out of bounds.
        """
        if port not in self._slots:
            self._slots[port] = self._slot(port)
        slot = self._slots[port]
        # The most frequent case, of a policy or a slider, takes a tenth of the time of the other.
        if not (type(value) is float and slot.low <= value <= slot.high):
            try:
                value = slot.port.value(value)
            except ValueError as error:
                raise UsageError(str(error)) from None
        slot.array[...] = value
        return value

    def _slot(self, port: str) -> _Slot:
        """Where an input is."""
        inputs = self.engine.network.inputs
        if port not in inputs:
            known = hint(port, inputs) or f"; its inputs are {', '.join(inputs)}"
            known = known if inputs else "; a graph's inputs are declared in its section 'inputs'"
            raise UsageError(f"the graph has no input '{port}'{known}")
        declared = inputs[port]
        array = self.engine.state.blocks[declared.end.block].value
        if array.ndim:
            return _Slot(declared, array)
        low, high = float(declared.low), float(declared.high)
        return _Slot(declared, array, max(low, -sys.float_info.max), min(high, sys.float_info.max))
