"""The functions of NumPy, and the methods of arrays and generators, that are compiled."""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

from runtime.codegen import arrays, creation, draws, scalars
from runtime.codegen.body import Body
from runtime.codegen.types import BOOL, FLOAT, INT, Array, Draws, NotTypedError, Number, Tuple
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    converted,
    group,
    known,
    number,
    parts_of,
    product_text,
    size_of,
    size_text,
)

Given = Sequence[Value]
Call = Callable[[Body, Given, Mapping[str, Value]], Value]

# Elementwise functions of floats: NumPy's name, and that of C.
FLOATS = {
    name: name
    for name in [
        "sin",
        "cos",
        "tan",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "expm1",
        "exp2",
        "log",
        "log1p",
        "log2",
        "log10",
        "sqrt",
        "cbrt",
        "floor",
        "ceil",
        "trunc",
        "rint",
        "fabs",
    ]
} | {
    **{"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh"},
    **{"arccosh": "acosh", "arctanh": "atanh"},
}
FLOATS_TWO = {"arctan2": "atan2", "hypot": "hypot", "copysign": "copysign", "fmod": "fmod"}
OPERATORS: dict[str, ast.operator] = {
    **{"add": ast.Add(), "subtract": ast.Sub(), "multiply": ast.Mult(), "divide": ast.Div()},
    **{"power": ast.Pow(), "mod": ast.Mod(), "remainder": ast.Mod()},
}
TESTS = ("isnan", "isinf", "isfinite")


def lifted(body: Body, values: Given, function: Callable[..., Value], kind: Number) -> Value:
    """A function of numbers, applied to numbers or to the elements of arrays."""
    if any(isinstance(value.type, Array) for value in values):
        return arrays.elementwise(body, values, function, kind)
    return converted(function(*values), kind)


def operator(body: Body, op: ast.operator, values: Given) -> Value:
    """A binary operator of numbers and arrays."""
    each = any(isinstance(v.type, Array) for v in values)
    if not each:
        return scalars.binary(body, op, values[0], values[1])
    kind = FLOAT if isinstance(op, ast.Div) else arrays.common(values)
    if kind == BOOL and type(op) not in scalars.BITS:
        kind = INT
    return lifted(body, values, lambda a, b: scalars.binary(body, op, a, b, each=True), kind)


def compared(body: Body, op: ast.cmpop, values: Given) -> Value:
    """A comparison of numbers and arrays."""
    return lifted(body, values, partial(scalars.compared, op), BOOL)


def negated(body: Body, value: Value) -> Value:
    kind = INT if arrays.common([value]) == BOOL else arrays.common([value])
    return lifted(body, [value], scalars.negated, kind)


def _c_function(name: str, *values: Value) -> Value:
    return scalars.call(name, *[scalars.as_float(v).text for v in values])


def _test(name: str, value: Value) -> Value:
    return scalars.call(name, scalars.as_float(value).text, kind=BOOL)


def _absolute(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    return lifted(body, given, scalars.absolute, arrays.common(given))


def _extreme(name: str, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    kind = arrays.common(given)

    def of(a: Value, b: Value) -> Value:
        if kind != FLOAT:
            return scalars.extreme(body, name, [a, b])
        function = {"min": "np_least", "max": "np_greatest"}[name]
        return _c_function(function, a, b)

    return lifted(body, given, of, kind)


def _clip(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    value, low, high = given
    return _extreme("min", body, [_extreme("max", body, [value, low], {}), high], {})


def _sign(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    return lifted(body, given, lambda v: _c_function("sign_of", v), FLOAT)


def _square(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    return operator(body, ast.Mult(), [given[0], given[0]])


def _where(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    kind = arrays.common(given[1:])

    def of(test: Value, a: Value, b: Value) -> Value:
        a, b = converted(a, kind), converted(b, kind)
        text = f"({scalars.truth(test).within(3)} ? {a.text} : {b.text})"
        return Value(kind, (text,))

    return lifted(body, given, of, kind)


def _nan_to_num(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    raise NotTypedError("calls np.nan_to_num, which is not compiled; test with math.isfinite")


# Reductions


def whole_array(given: Given, options: Mapping[str, Value], name: str) -> Value:
    """The one array of a reduction over all elements."""
    if len(given) != 1 or options:
        raise NotTypedError(f"reduces along an axis with {name}; write the loop")
    return given[0]


def _sum(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    value = whole_array(given, options, "sum")
    kind = arrays.common([value])
    if kind == FLOAT:
        flat = arrays.flat(body, body.stored(value))
        text = f"sum_of({flat.text}, {size_text(flat, 0)})"
        return body.kept(Value(FLOAT, (text,)), "sum")
    add = ast.Add()
    return arrays.reduced(body, value, number(0), lambda a, b: scalars.binary(body, add, a, b))


def _mean(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    total = converted(_sum(body, given, options), FLOAT)
    size = converted(_size(given[0]), FLOAT)
    return Value(FLOAT, (f"{total.within(2)} / {size.within(3)}",), 2)


def _size(value: Value) -> Value:
    sizes = [size_of(value, k) for k in range(len(array_type(value).dims))]
    if all(size.const is not UNKNOWN for size in sizes):
        found = 1
        for size in sizes:
            found *= int(size.const)
        return number(found)
    return Value(INT, (" * ".join(f"({size.text})" for size in sizes),), 2, low=0)


def _ends(name: str, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    """``min`` and ``max`` of all elements: NaN if there is any, an error if there are none."""
    value = body.stored(whole_array(given, options, name))
    first = _first(body, value, f"zero-size array to reduction operation {name}")
    return arrays.reduced(body, value, first, lambda a, b: _extreme(name, body, [a, b], {}))


def _first(body: Body, value: Value, message: str) -> Value:
    """An array's first element; an array without elements fails."""
    flat = size_text(arrays.flat(body, value), 0)
    if not flat.isdigit() or int(flat) == 0:
        failure = body.fail("ValueError", message)
        body.act(f"if ({flat} == 0) fail(ctx, {failure});")
    zeros = ["0"] * len(array_type(value).dims)
    return Value(arrays.elements(value), (body.place(value, zeros),))


def _place_of(name: str, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    """``argmin`` and ``argmax`` in the flat array: the first of equals, or the first NaN."""
    value = arrays.flat(body, body.stored(whole_array(given, options, name)))
    first = _first(body, value, f"attempt to get {name} of an empty sequence")
    best, at = body.fresh("best"), body.fresh("at")
    c_type = {"bool": "bool", "int": "int64_t", "float": "double"}[first.type.kind]  # type: ignore[union-attr]
    body.put(f"{c_type} {best} = {first.text};")
    body.put(f"int64_t {at} = 0;")
    (index,) = arrays.loops(body, [size_text(value, 0)])
    element = body.at(value, [index]).text
    sign = "<" if name == "argmin" else ">"
    nan = f" || ({element} != {element} && {best} == {best})" if first.type == FLOAT else ""
    body.put(f"if ({element} {sign} {best}{nan}) {{")
    body.put(f"    {best} = {element};")
    body.put(f"    {at} = {index};")
    body.put("}")
    arrays.close(body, 1)
    return Value(INT, (at,), low=0, high=size_text(value, 0))


def _tests_all(name: str, body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    value = whole_array(given, options, name)
    sign = "&&" if name == "all" else "||"
    join = lambda a, b: Value(BOOL, (f"{a.text} {sign} ({scalars.truth(b).text})",), 0)  # noqa: E731
    return arrays.reduced(body, value, number(name == "all"), join)


def _count(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    add = ast.Add()
    return arrays.reduced(
        body, given[0], number(0), lambda a, b: scalars.binary(body, add, a, scalars.truth(b))
    )


def dot(body: Body, given: Given, options: Mapping[str, Value]) -> Value:
    """``np.dot`` and ``@`` of arrays with one or two axes, summed in order."""
    a, b = (body.stored(value) for value in given)
    if not all(isinstance(v.type, Array) for v in (a, b)):
        return operator(body, ast.Mult(), [a, b])
    left, right = len(array_type(a).dims), len(array_type(b).dims)
    if left > 2 or right > 2:
        raise NotTypedError("multiplies arrays with more than two axes; write the loop")
    inner = (size_text(a, left - 1), size_text(b, 0))
    if inner[0] != inner[1]:
        failure = body.fail("ValueError", "shapes not aligned: {index} and {size}")
        body.act(f"same_size(ctx, {inner[0]}, {inner[1]}, {failure});")
    outer = [(a, 0)] * (left == 2) + [(b, 1)] * (right == 2)
    dims = tuple(array_type(v).dims[k] for v, k in outer)
    sizes = [size_text(v, k) for v, k in outer]
    made = body.new("float", sizes, dims) if outer else None
    indices = arrays.loops(body, sizes)
    total = body.fresh("total")
    body.put(f"double {total} = 0.0;")
    (k,) = arrays.loops(body, [inner[0]])
    x = body.at(a, [*indices[: left - 1], k])
    y = body.at(b, [k, *indices[left - 1 :]])
    body.put(f"{total} += {scalars.binary(body, ast.Mult(), x, y).text};")
    arrays.close(body, 1)
    if made is not None:
        body.act(f"{body.place(made, indices)} = {total};")
    arrays.close(body, len(indices))
    return made or Value(FLOAT, (total,))


FUNCTIONS: dict[str, Call] = {
    **{
        n: lambda b, g, o, c=c: lifted(b, g, partial(_c_function, c), FLOAT)  # type: ignore[misc]
        for n, c in {**FLOATS, **FLOATS_TWO}.items()
    },
    **{n: lambda b, g, o, n=n: lifted(b, g, partial(_test, n), BOOL) for n in TESTS},  # type: ignore[misc]
    **{n: lambda b, g, o, op=op: operator(b, op, g) for n, op in OPERATORS.items()},  # type: ignore[misc]
    **{"abs": _absolute, "absolute": _absolute, "sign": _sign, "square": _square},
    **{"minimum": partial(_extreme, "min"), "maximum": partial(_extreme, "max")},
    **{"clip": _clip, "where": _where, "dot": dot, "matmul": dot, "vdot": dot},
    **{"sum": _sum, "mean": _mean, "min": partial(_ends, "min"), "max": partial(_ends, "max")},
    **{"amin": partial(_ends, "min"), "amax": partial(_ends, "max")},
    **{n: partial(_place_of, n) for n in ("argmin", "argmax")},
    **{n: partial(_tests_all, n) for n in ("all", "any")},
    **{
        "count_nonzero": _count,
        "zeros": partial(creation.filled, 0.0),
        "ones": partial(creation.filled, 1.0),
    },
    **{
        "empty": partial(creation.filled, None),
        "full": creation.full,
        "eye": creation.eye,
        "identity": creation.eye,
    },
    **{"zeros_like": partial(creation.like, 0.0), "ones_like": partial(creation.like, 1.0)},
    **{
        "empty_like": partial(creation.like, None),
        "arange": creation.arange,
        "array": creation.as_array,
    },
    **{
        "asarray": creation.unchanged,
        "ascontiguousarray": creation.unchanged,
        "copy": creation.as_array,
    },
}


def numpy(body: Body, name: str, given: Given, options: Mapping[str, Value]) -> Value:
    """A call of a function of NumPy."""
    function = FUNCTIONS.get(name)
    if function is None:
        raise NotTypedError(f"calls np.{name}, which is not compiled; write the loop")
    for option in options:
        if option != "dtype":
            text = f"np.{name} with the keyword {option}= is not compiled; write the loop"
            raise NotTypedError(text)
    return function(body, given, options)


METHODS = ("sum", "mean", "min", "max", "argmin", "argmax", "all", "any", "dot", "copy")


def method(
    body: Body, value: Value, name: str, given: Given, options: Mapping[str, Value]
) -> Value:
    """A call of a method of an array or a generator."""
    if isinstance(value.type, Draws):
        return draws.drawn(body, value, name, given)
    if not isinstance(value.type, Array):
        if isinstance(value.type, Number) and name == "item" and not given:
            return value
        raise NotTypedError(f"calls a method '{name}' of a {value.type}")
    if name in METHODS:
        return numpy(body, name, [value, *given], options)
    if name in ("ravel", "flatten", "reshape") and not options:
        if name == "flatten":
            return arrays.flat(body, arrays.copied(body, value))
        return arrays.flat(body, value) if name == "ravel" else _reshaped(body, value, given)
    if name == "item":
        return _item(body, value, given)
    if name == "fill" and len(given) == 1:
        arrays.write(body, value, given[0])
        return Value(known(None).type)
    if name == "transpose" and not given:
        return arrays.transposed(body.stored(value))
    if name == "astype" and len(given) == 1:
        kind = creation.kind_of(given, {}, 0, FLOAT)
        if kind == FLOAT or arrays.elements(value) == kind:
            return body.stored(lifted(body, [value], lambda v: v, kind))
    raise NotTypedError(f"calls the method '{name}' of an array, which is not compiled")


def _item(body: Body, value: Value, given: Given) -> Value:
    value = body.stored(value)
    if len(given) == 1 and len(array_type(value).dims) != 1:
        value = arrays.flat(body, value)
    if not given:
        return _first(body, value, "can only convert an array of size 1 to a Python scalar")
    indices = parts_of(given[0]) if isinstance(given[0].type, Tuple) else list(given)
    return arrays.subscript(body, value, indices)


def _reshaped(body: Body, value: Value, given: Given) -> Value:
    sizes = creation.shape_of(given[0] if len(given) == 1 else group(given))
    if any(size.const is not UNKNOWN and size.const < 0 for size in sizes):
        raise NotTypedError("reshapes to a size of -1; write the size")
    flat = arrays.flat(body, value)
    dims = tuple(None if size.const is UNKNOWN else int(size.const) for size in sizes)
    total = product_text([size.text for size in sizes])
    if size_text(flat, 0) != total:
        failure = body.fail("ValueError", "cannot reshape an array of size {index} into {size}")
        body.act(f"same_size(ctx, {size_text(flat, 0)}, {total}, {failure});")
    kind = array_type(flat)
    held = [size.text for size in sizes if size.const is UNKNOWN]
    return Value(replace(kind, dims=dims), (flat.text, *held))
