"""The functions of NumPy, and the methods of arrays and generators, that are compiled.

In go the arguments of a call, by NumPy's names; out comes the value of the result. A function is
added in one place: its form here, as a function of (body, values...), and its name in ``FUNCTIONS``
or ``OF_ARRAYS``. Types, statements and refusals all follow from that form:

    def _square(body, x, /):                         np.square(a)    each: a[i] * a[i]
        x = x if isinstance(x.type, Array) else body.kept(x)
        return operator(body, ast.Mult(), [x, x])    np.square(a, out=b)     refused: no such name
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from inspect import signature

from runtime.codegen import arrays, creation, draws, scalars
from runtime.codegen.body import Body
from runtime.codegen.form import (
    Choice,
    Declare,
    Expr,
    Fail,
    If,
    Literal,
    Logic,
    Name,
    Operator,
    Set,
    product,
)
from runtime.codegen.types import (
    BOOL,
    C_NAMES,
    FLOAT,
    INT,
    Array,
    Draws,
    NotTypedError,
    Number,
    Tuple,
)
from runtime.codegen.values import (
    UNKNOWN,
    Value,
    array_type,
    axes_of,
    converted,
    group,
    none,
    number,
    parts_of,
    size_expr,
    sizes_of,
)

Given = Sequence[Value]
Options = Mapping[str, Value]


def applied(
    name: str, function: Callable[..., Value], body: Body, given: Given, options: Options
) -> Value:
    """Write a call of a function of Python or NumPy.

    Its form here has the parameters of the original that are compiled, by the same names, so that
    an argument is either used or refused: ``np.eye(3, k=1)`` is written, ``np.eye(3, order="F")``
    refused.
    """
    form = signature(function)
    for option in options:
        if option not in form.parameters:
            text = f"{name} with the keyword {option}= is not compiled; write the loop"
            raise NotTypedError(text)
    try:
        call = form.bind(body, *given, **options)
    except TypeError as error:
        reason = f"calls {name} in a form that is not compiled ({error}); write the loop"
        raise NotTypedError(reason) from None
    return function(*call.args, **call.kwargs)


# Elementwise functions of floats: NumPy's name, and that of C.
HYPERBOLIC = ("sinh", "cosh", "tanh")
LOGS = ("exp", "expm1", "exp2", "log", "log1p", "log2", "log10", "sqrt", "cbrt")
ROUNDING = ("floor", "ceil", "trunc", "rint", "fabs")
FLOATS = {
    **{name: name for name in ("sin", "cos", "tan", *HYPERBOLIC, *LOGS, *ROUNDING)},
    **{"arcsin": "asin", "arccos": "acos", "arctan": "atan", "arcsinh": "asinh"},
    **{"arccosh": "acosh", "arctanh": "atanh"},
}
FLOATS_TWO = {"arctan2": "atan2", "hypot": "hypot", "copysign": "copysign", "fmod": "fmod"}
# Those that give integers for integers, by a rule that changed between versions of NumPy.
OF_FLOATS = ("floor", "ceil", "trunc", "fmod")
OPERATORS: dict[str, ast.operator] = {
    **{"add": ast.Add(), "subtract": ast.Sub(), "multiply": ast.Mult(), "divide": ast.Div()},
    **{"power": ast.Pow(), "mod": ast.Mod(), "remainder": ast.Mod()},
}
TESTS = ("isnan", "isinf", "isfinite")


def lifted(
    body: Body, values: Given, function: Callable[..., Value], kind: Number | None = None
) -> Value:
    """A function of numbers, applied to numbers or to the elements of arrays.

    Parameters
    ----------
    kind : of the elements of the result; None for what the operands have in common.
    """
    if any(isinstance(value.type, Array) for value in values):
        return arrays.elementwise(body, values, function, kind or arrays.common(values))
    return function(*values)


def operator(body: Body, op: ast.operator, values: Given, unchecked: bool = False) -> Value:
    """A binary operator of numbers and arrays."""
    each = any(isinstance(v.type, Array) for v in values)
    if not each:
        return scalars.binary(body, op, values[0], values[1], unchecked)
    kind = FLOAT if isinstance(op, ast.Div) else arrays.common(values)
    return lifted(body, values, lambda a, b: scalars.binary(body, op, a, b, each=True), kind)


def compared(body: Body, op: ast.cmpop, values: Given) -> Value:
    """A comparison of numbers and arrays."""
    return lifted(body, values, partial(scalars.compared, body, op), BOOL)


def negated(body: Body, value: Value) -> Value:
    return lifted(body, [value], partial(scalars.negated, body))


def _c_function(name: str, *values: Value) -> Value:
    return scalars.call(name, *[scalars.as_float(v).expr for v in values])


def _of_floats(name: str, c_name: str, *values: Value) -> Value:
    """A function of NumPy that gives float64 for float64 and int64."""
    kinds = {v.type for v in values}
    if BOOL in kinds or (name in OF_FLOATS and kinds != {FLOAT}):
        raise NotTypedError(f"calls np.{name} of something else than floats; use float(...)")
    return _c_function(c_name, *values)


def _one(name: str, c_name: str, body: Body, x: Value, /) -> Value:
    return lifted(body, [x], partial(_of_floats, name, c_name), FLOAT)


def _two(name: str, c_name: str, body: Body, x1: Value, x2: Value, /) -> Value:
    return lifted(body, [x1, x2], partial(_of_floats, name, c_name), FLOAT)


def _operator(op: ast.operator, body: Body, x1: Value, x2: Value, /) -> Value:
    # Where the operator raises, NumPy's function gives infinity or NaN, of numbers as well.
    return operator(body, op, [x1, x2], unchecked=isinstance(op, ast.Div))


def _test(name: str, body: Body, x: Value, /) -> Value:
    of = lambda v: scalars.tested(name, scalars.as_float(v))  # noqa: E731
    return lifted(body, [x], of, BOOL)


def absolute(body: Body, x: Value, /) -> Value:
    """``abs`` and ``np.abs``."""
    return lifted(body, [x], partial(scalars.absolute, body))


def _extreme(name: str, body: Body, x1: Value, x2: Value, /) -> Value:
    kind = arrays.common([x1, x2])

    def of(a: Value, b: Value) -> Value:
        if kind != FLOAT:
            return scalars.extreme(body, name, [a, b])
        return _c_function({"min": "np_least", "max": "np_greatest"}[name], a, b)

    return lifted(body, [x1, x2], of, kind)


def _clip(body: Body, a: Value, a_min: Value, a_max: Value) -> Value:
    if any(isinstance(bound.type, Array) for bound in (a_min, a_max)):
        raise NotTypedError("clips by bounds that are arrays; use np.minimum and np.maximum")
    if arrays.common([a, a_min, a_max]) != FLOAT:
        return _extreme("min", body, _extreme("max", body, a, a_min), a_max)
    return lifted(body, [a, a_min, a_max], partial(_c_function, "np_clip"), FLOAT)


def _sign(body: Body, x: Value, /) -> Value:
    kind = arrays.common([x])
    if kind == INT and isinstance(x.type, Array):
        return lifted(body, [x], lambda a: scalars.call("int_sign", a.expr, kind=INT), INT)
    if kind != FLOAT:
        raise NotTypedError("takes np.sign of an int or a bool; use np.sign(float(x))")
    return _one("sign", "sign_of", body, x)


def _square(body: Body, x: Value, /) -> Value:
    x = x if isinstance(x.type, Array) else body.kept(x)
    return operator(body, ast.Mult(), [x, x])


def _where(body: Body, condition: Value, x: Value, y: Value, /) -> Value:
    kind = arrays.common([x, y])
    # Both are computed, also the one that is not taken: 1 // n fails for n = 0 in either case.
    x, y = (v if isinstance(v.type, Array) else body.kept(v) for v in (x, y))

    def of(test: Value, a: Value, b: Value) -> Value:
        a, b = converted(a, kind), converted(b, kind)
        return Value(kind, (Choice(scalars.truth(test).expr, a.expr, b.expr),))

    return lifted(body, [condition, x, y], of, kind)


# Reductions


def _sum(body: Body, a: Value) -> Value:
    value = body.stored(a)
    kind = arrays.common([value])
    if kind == FLOAT:
        flat = arrays.flat(body, value)
        return body.kept(scalars.call("sum_of", flat.expr, size_expr(flat, 0)), "sum")
    add = ast.Add()
    return arrays.reduced(body, value, number(0), lambda a, b: scalars.binary(body, add, a, b))


def _mean(body: Body, a: Value) -> Value:
    a = body.stored(a)
    total = converted(_sum(body, a), FLOAT)
    count = converted(size(a), FLOAT)
    return Value(FLOAT, (Operator("/", total.expr, count.expr),))


def size(value: Value) -> Value:
    """How many elements an array has."""
    count = product(sizes_of(value))
    if isinstance(count, Literal):
        return number(int(count.value))
    return Value(INT, (count,), low=0)


def _ends(name: str, body: Body, a: Value) -> Value:
    """``min`` and ``max`` of all elements: NaN if there is any, an error if there are none."""
    value = body.stored(a)
    start = first(body, value, f"zero-size array to reduction operation {name}")
    return arrays.reduced(body, value, start, partial(_extreme, name, body))


def first(body: Body, value: Value, message: str) -> Value:
    """An array's first element; an array without elements fails."""
    count = size_expr(arrays.flat(body, value), 0)
    if not isinstance(count, Literal) or count.value == 0:
        failure = body.fail("ValueError", message)
        body.act(If(Operator("==", count, Literal(0)), [Fail(failure)]))
    zeros = [Literal(0)] * axes_of(value)
    return Value(arrays.elements(value), (body.place(value, zeros),))


def _place_of(name: str, body: Body, a: Value) -> Value:
    """``argmin`` and ``argmax`` in the flat array: the first of equals, or the first NaN."""
    value = arrays.flat(body, body.stored(a))
    start = first(body, value, f"attempt to get {name} of an empty sequence")
    best, at = Name(body.fresh("best")), Name(body.fresh("at"))
    kind = arrays.elements(start)
    body.add(Declare(C_NAMES[kind.kind], best.name, start.expr, const=False))
    body.add(Declare("int64_t", at.name, Literal(0), const=False))
    with body.loops([size_expr(value, 0)]) as (index,):
        element = body.at(value, [index]).expr
        better: Expr = Operator("<" if name == "argmin" else ">", element, best)
        if kind == FLOAT:
            is_nan = (Operator("!=", element, element), Operator("==", best, best))
            better = Logic("||", (better, Logic("&&", is_nan)))
        body.add(If(better, [Set(best, element), Set(at, index)]))
    return Value(INT, (at,), low=0, high=size_expr(value, 0))


def tests_all(name: str, body: Body, a: Value) -> Value:
    value = body.stored(a)
    sign = "&&" if name == "all" else "||"
    join = lambda a, b: Value(BOOL, (Logic(sign, (a.expr, scalars.truth(b).expr)),))  # noqa: E731
    return arrays.reduced(body, value, number(name == "all"), join)


def _count(body: Body, a: Value) -> Value:
    add = ast.Add()
    count = lambda so_far, b: scalars.binary(body, add, so_far, scalars.truth(b))  # noqa: E731
    return arrays.reduced(body, body.stored(a), number(0), count)


def _dot(body: Body, a: Value, b: Value) -> Value:
    if not all(isinstance(v.type, Array) for v in (a, b)):
        return operator(body, ast.Mult(), [a, b])
    return matmul(body, a, b)


def _vdot(body: Body, a: Value, b: Value, /) -> Value:
    if any(axes_of(v) != 1 for v in (a, b)):
        raise NotTypedError("calls np.vdot of something else than vectors; write the loop")
    return matmul(body, a, b)


def matmul(body: Body, x1: Value, x2: Value, /) -> Value:
    """``@`` and ``np.matmul`` of arrays with one or two axes, summed in order."""
    a, b = body.stored(x1), body.stored(x2)
    if any(arrays.elements(v) != FLOAT or not array_type(v).dims for v in (a, b)):
        raise NotTypedError("multiplies something else than arrays of floats; write the loop")
    left, right = axes_of(a), axes_of(b)
    if left > 2 or right > 2:
        raise NotTypedError("multiplies arrays with more than two axes; write the loop")
    inner = size_expr(a, left - 1)
    body.same_size(inner, size_expr(b, 0), "ValueError", "shapes not aligned: {index} and {size}")
    outer = [(a, 0)] * (left == 2) + [(b, 1)] * (right == 2)
    dims = tuple(array_type(v).dims[k] for v, k in outer)
    sizes = [size_expr(v, k) for v, k in outer]
    made = body.new("float", sizes, dims) if outer else None
    with body.loops(sizes) as indices:
        total = Name(body.fresh("total"))
        body.add(Declare("double", total.name, Literal(0.0), const=False))
        with body.loops([inner]) as (k,):
            x = body.at(a, [*indices[: left - 1], k])
            y = body.at(b, [k, *indices[left - 1 :]])
            body.add(Set(total, scalars.binary(body, ast.Mult(), x, y).expr, "+="))
        if made is not None:
            body.act(Set(body.place(made, indices), total))
    return made or Value(FLOAT, (total,))


FUNCTIONS: dict[str, Callable[..., Value]] = {
    **{name: partial(_one, name, c_name) for name, c_name in FLOATS.items()},
    **{name: partial(_two, name, c_name) for name, c_name in FLOATS_TWO.items()},
    **{name: partial(_test, name) for name in TESTS},
    **{name: partial(_operator, op) for name, op in OPERATORS.items()},
    **{"abs": absolute, "absolute": absolute, "sign": _sign, "square": _square},
    **{"minimum": partial(_extreme, "min"), "maximum": partial(_extreme, "max")},
    **{"clip": _clip, "where": _where, "dot": _dot, "matmul": matmul, "vdot": _vdot},
    **{"sum": _sum, "mean": _mean, "min": partial(_ends, "min"), "max": partial(_ends, "max")},
    **{"amin": partial(_ends, "min"), "amax": partial(_ends, "max")},
    **{name: partial(_place_of, name) for name in ("argmin", "argmax")},
    **{name: partial(tests_all, name) for name in ("all", "any")},
    **{"count_nonzero": _count, "flatnonzero": arrays.nonzero},
    **{"zeros": partial(creation.filled, 0.0), "ones": partial(creation.filled, 1.0)},
    **{"empty": partial(creation.filled, None), "full": creation.full},
    **{"eye": creation.eye, "identity": creation.identity, "arange": creation.arange},
    **{"zeros_like": partial(creation.like, 0.0), "ones_like": partial(creation.like, 1.0)},
    "empty_like": partial(creation.like, None),
    **{"array": creation.as_array, "copy": creation.copy, "asarray": creation.unchanged},
    "ascontiguousarray": creation.contiguous,
}


def numpy(body: Body, name: str, given: Given, options: Options) -> Value:
    """A call of a function of NumPy."""
    function = FUNCTIONS.get(name)
    if function is None:
        raise NotTypedError(f"calls np.{name}, which is not compiled; write the loop")
    return applied(f"np.{name}", function, body, given, options)


def method(body: Body, value: Value, name: str, given: Given, options: Options) -> Value:
    """A call of a method of an array or a generator."""
    if isinstance(value.type, Draws):
        function = draws.DRAWS.get(name)
        if function is None:
            raise NotTypedError(f"draws with '{name}', which is not compiled")
        return applied(name, function, body, [value, *given], options)
    if not isinstance(value.type, Array):
        if isinstance(value.type, Number) and name == "item" and not given and not options:
            return value
        raise NotTypedError(f"calls a method '{name}' of a {value.type}")
    function = FUNCTIONS[name] if name in METHODS else OF_ARRAYS.get(name)
    if function is None:
        raise NotTypedError(f"calls the method '{name}' of an array, which is not compiled")
    return applied(f"the method '{name}'", function, body, [value, *given], options)


def item(body: Body, value: Value, *given: Value) -> Value:
    """``a.item()``, ``a.item(i)`` and ``a.item(i, j)``."""
    value = body.stored(value)
    if not given:
        count = size(value)
        if count.const != 1:
            message = "can only convert an array of size 1 to a Python scalar"
            body.same_size(count.expr, Literal(1), "ValueError", message)
        return Value(arrays.elements(value), (body.place(value, [Literal(0)] * axes_of(value)),))
    indices = parts_of(given[0]) if isinstance(given[0].type, Tuple) else list(given)
    if len(indices) == 1 and axes_of(value) != 1:
        value = arrays.flat(body, value)
    if len(indices) != axes_of(value):
        raise NotTypedError(f"takes an item by {len(indices)} indices")
    return arrays.subscript(body, value, indices)


def _fill(body: Body, a: Value, value: Value) -> Value:
    arrays.write(body, a, converted(scalars.as_number(value), arrays.elements(a)))
    return none()


def _transpose(body: Body, a: Value) -> Value:
    return arrays.transposed(body.stored(a))


def _astype(body: Body, a: Value, dtype: Value) -> Value:
    return creation.as_kind(body, a, creation.kind_of(dtype, FLOAT))


def _flatten(body: Body, a: Value) -> Value:
    return arrays.flat(body, arrays.copied(body, a))


def ravel(body: Body, a: Value) -> Value:
    """``a.ravel()``: a view, where the array is contiguous."""
    if not array_type(body.stored(a)).packed:
        raise NotTypedError("makes a view flat, which copies it or not; use .flatten()")
    return arrays.flat(body, a)


def _reshape(body: Body, a: Value, *shape: Value) -> Value:
    sizes = creation.shape_of(shape[0] if len(shape) == 1 else group(shape))
    if any(size.const is not UNKNOWN and size.const < 0 for size in sizes):
        raise NotTypedError("reshapes to a size of -1; write the size")
    flat = ravel(body, a)
    dims = tuple(None if size.const is UNKNOWN else int(size.const) for size in sizes)
    message = "cannot reshape an array of size {index} into {size}"
    total = product([size.expr for size in sizes])
    body.same_size(size_expr(flat, 0), total, "ValueError", message)
    held = [size.expr for size in sizes if size.const is UNKNOWN]
    return Value(replace(array_type(flat), dims=dims), (flat.expr, *held))


def _to_list(body: Body, a: Value) -> Value:
    """``a.tolist()`` as a tuple of what the elements are now."""
    a = body.stored(a)
    dims = array_type(a).dims
    if not dims:
        return item(body, a)
    if len(dims) > 1 or dims[0] is None:
        raise NotTypedError("makes a list of an array of unknown length; use the array")
    return group([body.kept(arrays.subscript(body, a, [number(i)])) for i in range(dims[0])])


METHODS = ("sum", "mean", "min", "max", "argmin", "argmax", "all", "any", "dot", "copy")
OF_ARRAYS: dict[str, Callable[..., Value]] = {
    **{"item": item, "fill": _fill, "transpose": _transpose, "astype": _astype},
    **{"flatten": _flatten, "ravel": ravel, "reshape": _reshape, "tolist": _to_list},
}
