"""Text for the continuous part of a compiled plan."""

from __future__ import annotations

import ast
import inspect
from collections.abc import Callable, Iterator
from typing import Any

from blocks.core import parsed
from runtime.engine.continuous import UNROLLED, Slot
from runtime.engine.schedule import INDENT


def assigned(slots: list[Slot]) -> Iterator[str]:
    """Statements that write what a derivative returned into the row of the stage."""
    for number, slot in enumerate(slots):
        value = "rates" if len(slots) == 1 else f"rates[{number}]"
        if not slot.shape:
            yield f"slopes[stage, {slot.start}] = {value}"
        elif len(slot.shape) == 1 and slot.shape[0] <= UNROLLED:
            for i in range(slot.shape[0]):
                yield f"slopes[stage, {slot.start + i}] = {value}[{i}]"
        else:
            indices = [f"i{axis}" for axis in range(len(slot.shape))]
            flat = "0"
            for index, length in zip(indices, slot.shape, strict=True):
                flat = f"({flat}) * {length} + {index}" if flat != "0" else index
            for axis, (index, length) in enumerate(zip(indices, slot.shape, strict=True)):
                yield f"{INDENT * axis}for {index} in range({length}):"
            inner = f"slopes[stage, {slot.start} + {flat}] = {value}[{', '.join(indices)}]"
            yield INDENT * len(indices) + inner


def source_of(function: Callable[..., Any]) -> str:
    """A helper's text for the plan, without types and documentation."""
    node = parsed(inspect.getsource(function)).body[0]
    if not isinstance(node, ast.FunctionDef):
        raise TypeError(f"{function.__name__} is no plain function")
    node.body, node.returns = node.body[1:], None
    for argument in node.args.args:
        argument.annotation = None
    for name in ast.walk(node):
        if isinstance(name, ast.Name) and isinstance(
            function.__globals__.get(name.id), (int, float)
        ):
            name.id = repr(function.__globals__[name.id])
    text = ast.unparse(node).replace("math.isfinite", "isfinite")
    return f'@njit(cache=True, error_model="python")\n{text}\n\n'
