"""Ports of a graph as one space: numbers in order, or one entry for each port.

In: the inputs or outputs of a network. Out: a space with their bounds, and what joins and splits
its elements::

    ports = Ports(network.outputs, is_dict=False)      # position: Scalar, pose: Pose
    ports.space                                        # Box, of 4 numbers
    ports.join([0.5, array([1., 2., 3.])])             # array([0.5, 1., 2., 3.])
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium import spaces

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.network import PortDeclaration


class Ports:
    """The inputs or outputs of a graph as a space of Gymnasium.

    space : a Box of all numbers, ports in the order of the graph; or a Dict of a Box for each port.
    """

    def __init__(self, ports: Mapping[str, PortDeclaration], is_dict: bool) -> None:
        self.is_dict, self.names = is_dict, list(ports)
        # Policies expect at least one axis: a Scalar has the shape (1,).
        self._shapes = [port.type.shape or (1,) for port in ports.values()]
        self._types = [port.type.shape for port in ports.values()]
        stops = np.cumsum([math.prod(shape) for shape in self._shapes]).tolist()
        starts = [0, *stops[:-1]]
        self._places: list[Any] = [
            slice(start, stop) if shape else start
            for start, stop, shape in zip(starts, stops, self._types, strict=True)
        ]
        self.size = stops[-1]
        lows, highs = ([getattr(p, end) for p in ports.values()] for end in ("low", "high"))
        self.space = spaces.Box(_row(lows), _row(highs), dtype=np.float64)
        if is_dict:
            boxes = {
                name: spaces.Box(low.reshape(shape), high.reshape(shape), dtype=np.float64)
                for name, shape, low, high in zip(
                    self.names, self._shapes, lows, highs, strict=True
                )
            }
            self.space = spaces.Dict(boxes)

    def join(self, values: Sequence[Any]) -> Any:
        """An element of the space: from a float or an array for each port, in order."""
        if self.is_dict:
            arrays = (np.reshape(v, s) for v, s in zip(values, self._shapes, strict=True))
            return dict(zip(self.names, arrays, strict=True))
        if not any(self._types):
            return np.array(values)
        row = np.empty(self.size)
        for place, value in zip(self._places, values, strict=True):
            row[place] = value if type(value) is float else value.ravel()
        return row

    def split(self, element: Any) -> list[tuple[str, float | FloatArray]]:
        """Each port with its value: a float, or an array of the shape of its type.

        Raises
        ------
        UsageError : the element has another form than those of the space.
        """
        if self.is_dict:
            return self._split_dict(element)
        row = _numbers(element)
        if row.shape != (self.size,):
            expected = f"expected an action of shape ({self.size},): {', '.join(self.names)}"
            raise UsageError(f"{expected}; got shape {row.shape}")
        return [
            (name, row[place].reshape(shape) if shape else float(row[place]))
            for name, place, shape in zip(self.names, self._places, self._types, strict=True)
        ]

    def _split_dict(self, element: Any) -> list[tuple[str, float | FloatArray]]:
        if not isinstance(element, Mapping) or element.keys() != set(self.names):
            expected = f"expected an action with {', '.join(self.names)}"
            raise UsageError(f"{expected}, got {element!r}")
        found: list[tuple[str, float | FloatArray]] = []
        for name, shape, held in zip(self.names, self._types, self._shapes, strict=True):
            array = _numbers(element[name])
            if array.shape != held:
                raise UsageError(f"'{name}': expected an action of shape {held}, got {array.shape}")
            found.append((name, array.reshape(shape) if shape else float(array[0])))
        return found


def _row(arrays: Sequence[FloatArray]) -> FloatArray:
    return np.concatenate([np.ravel(array) for array in arrays])


def _numbers(written: Any) -> FloatArray:
    try:
        return np.asarray(written, dtype=np.float64)
    except (TypeError, ValueError):
        raise UsageError(f"expected an action of numbers, got {written!r}") from None
