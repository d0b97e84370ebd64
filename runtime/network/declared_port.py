"""A port of a graph: its type, unit, bounds and default, and the block that stands behind it.

What a session writes and reads, the spaces of an environment, the variables of an exported model
and sliders are made of it::

    network.inputs["push"].value(2)      # array(2.): within the bounds, of the type's shape
    network.inputs["push"].value(20)     # ValueError: 'push': expected at most 10 N, got 20
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from blocks.core import FloatArray, SignalType, show
from runtime.network.addresses import Endpoint


@dataclass(frozen=True, eq=False)
class PortDeclaration:
    """An input or output of a graph.

    type : its signal type. unit : of all its numbers, or of each, separated by commas; '' if it is
    not known.
    low, high : the smallest and largest value, arrays of the type's shape, infinite if none is
    declared.
    default : of an input, an array of that shape; None for an output.
    end : the output behind it. That of an input belongs to a block with the state ``value``, an
    array of the type's shape: what is written there is the signal from the next tick on.
    """

    name: str
    type: SignalType
    unit: str
    low: FloatArray
    high: FloatArray
    default: FloatArray | None
    doc: str
    end: Endpoint

    def value(self, written: Any) -> FloatArray:
        """What is to be written to the port: one number for all, or one for each component.

        Raises
        ------
        ValueError : it has another shape, is not finite or is out of bounds; the message names the
            port, what is expected and what was given.
        """
        try:
            array = np.asarray(written)
        except (TypeError, ValueError):
            array = np.empty((0, 0))
        # True is no number, although Python adds it as one.
        if array.dtype.kind not in "iuf" or array.shape not in ((), self.type.shape):
            expected = f"expected {self.type.numbers} for a {self.type}"
            raise ValueError(f"'{self.name}': {expected}, got {show(written)}")
        array = np.broadcast_to(array, self.type.shape).astype(np.float64)
        bad = np.isnan(array) | (np.isinf(array) & self.type.finite)
        if ((array >= self.low) & (array <= self.high) & ~bad).all():
            return array
        for relation, bound, is_out in (
            ("at least", self.low, array < self.low),
            ("at most", self.high, array > self.high),
            ("a finite number", None, bad),
        ):
            if is_out.any():
                at = tuple(np.argwhere(is_out)[0]) if array.ndim else ()
                name = self.name + "".join(f"[{i}]" for i in at)
                limit = "" if bound is None else f" {bound[at]:g}"
                expected = f"{relation}{limit} {self.unit}".rstrip()
                raise ValueError(f"'{name}': expected {expected}, got {array[at]:g}")
        return array
