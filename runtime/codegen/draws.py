"""Random numbers: NumPy's own functions, so that the numbers are the same."""

from __future__ import annotations

import ast
from collections.abc import Sequence
from typing import Any

from runtime.codegen import arrays, creation, scalars
from runtime.codegen.body import Body
from runtime.codegen.types import FLOAT, NotTypedError
from runtime.codegen.values import Value, array_type, size_text


def drawn(body: Body, generator: Value, name: str, given: Sequence[Value]) -> Value:
    """A draw, or an array of draws, with NumPy's arithmetic."""
    functions: dict[str, tuple[str, int]] = {
        **{"random": ("uniform", 0), "standard_normal": ("normal", 0)},
        **{"standard_exponential": ("exponential", 0), "exponential": ("exponential", 1)},
        **{"uniform": ("uniform", 2), "normal": ("normal", 2)},
    }
    if name not in functions:
        raise NotTypedError(f"draws with '{name}', which is not compiled")
    function, wanted = functions[name]
    if len(given) < wanted:
        raise NotTypedError(f"draws with '{name}' without its {wanted} numbers")
    parameters = [body.kept(scalars.as_float(value)) for value in given[:wanted]]
    size = given[wanted] if len(given) > wanted else None
    if size is None:
        return body.kept(_one_draw(body, generator, function, name, parameters), "drawn")
    made = creation.new_array(body, creation.shape_of(size), FLOAT)
    axes = range(len(array_type(made).dims))
    indices = arrays.loops(body, [size_text(made, k) for k in axes])
    one = _one_draw(body, generator, function, name, parameters)
    body.act(f"{body.place(made, indices)} = {one.text};")
    arrays.close(body, len(indices))
    return made


def _one_draw(
    body: Body, generator: Value, function: str, name: str, parameters: Sequence[Value]
) -> Value:
    body.effects += 1
    draw = Value(FLOAT, (f"{generator.text}->{function}({generator.text}->bits)",))
    times: Any = ast.Mult()
    if name == "uniform":
        low, high = parameters
        width = scalars.binary(body, ast.Sub(), high, low)
        return scalars.binary(body, ast.Add(), low, scalars.binary(body, times, width, draw))
    if name == "normal":
        mean, sigma = parameters
        return scalars.binary(body, ast.Add(), mean, scalars.binary(body, times, sigma, draw))
    if name == "exponential":
        return scalars.binary(body, times, parameters[0], draw)
    return draw
