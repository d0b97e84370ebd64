"""The reference of the language of expressions, docs/expressions.md, from its tables of functions.

In: what :mod:`blocks.core` declares of functions and limits. Out: the page's text::

    expressions_page()      # written by python -m docs.describe
"""

from __future__ import annotations

import re

from blocks.core import (
    ARRAYS,
    CONSTANTS,
    CREATION,
    FUNCTIONS,
    MAX_DEPTH,
    MAX_LENGTH,
    MAX_WRITTEN,
    SCOPE,
)

PAGE = """# Expressions

<!-- Made by `python -m docs.describe`, with its tables from the code; do not edit. -->

One language, wherever a graph computes: `expression` of a `Function` and an
`AlgebraicConstraint`, the equations, events and outputs of `DynamicSystem` and `DiscreteSystem`,
`transition` and `observation` of an `ExtendedKalmanFilter`, the `function` of a
`Decoder`, computed `params`, and parameters that are arrays. An expression is arithmetic on
numbers, vectors and matrices; it cannot do anything but compute. Shapes are checked first,
and an error names the
item of the list and the column. Both engines and exported C compute the same bits.

```yaml
plant:
  type: DynamicSystem
  states: {p(3): m, v(3): m/s}                 # names of components, with units
  constants: {m: 1.2, D: [[0.3, 0, 0], [0, 0.3, 0], [0, 0, 0.5]]}
  let:                                         # computed once, in order
    speed: norm(v)
    drag: D @ v * speed
  derivative: [v, "(u[0:3] - drag)/m - [0, 0, $g]"]
  initial: zeros(6)
```

## Names

| name | stands for |
|---|---|
| `t` | the time, in the unit of `run.time_unit` |
| `u` | the components of all that is wired to `u`: `u[0]`, `u[3:6]`; a single one is also `u` |
| `names` | names of these components: `[x, v]`, `[p(3), v]`: p is a vector of three |
| `x` | the states of a system, which `states` may name; what a `Decoder`'s ensemble represents |
| `z` | the unknown of an `AlgebraicConstraint` |
| `constants` | numbers, vectors and matrices: `{k: 2.5, A: [[0, 1], [-1, 0]]}` |
| `let` | names of expressions, which may use earlier ones: `{c: cos(x), R: [[c, -s], [s, c]]}` |
| `$name` | a param, put into the text before it is read, negative numbers in parentheses |

A list of expressions is the vector of all their components: `derivative: [v, "a @ x"]`. YAML
reads text with `: `, `{`, `[` or a comma inside braces and brackets only in quotes.

## Operators

| written | means |
|---|---|
| `+ - * / // % **` | as Python's, component by component; a number goes with every component |
| `@` | product of vectors and matrices, each entry summed from left to right |
| `x[0]`, `x[-1]`, `x[3*i:3*i + 3]` | a component, the last one, a range |
| `a[0]`, `a[0, 1]`, `a[:, 1]`, `a.T` | a row, an entry, a column, the transpose of a matrix |
| `[a, b, c]` | a vector of numbers, a matrix of vectors as rows |
| `[x[j]**2 for j in range(3)]` | a list over an index |
| `sum(m[j]*x[j] for j in range(3) if j != i)` | a sum, or another function, over an index |
| `< <= > >= == !=`, `and or not` | 1 or 0; `a < b < c` is `a < b and b < c` |
| `a if condition else b` | a or b; only what is chosen is computed |

Indices are whole numbers that are known while the text is read: digits, names of `for`, `len(x)`,
and `+ - * // % **` of these. All other numbers are floats. Whole numbers alone are computed
exactly: `3**40 % 1000` is 801, and one that no float has is an error.
"""


def expressions_page() -> str:
    """The text of docs/expressions.md."""
    lines = [PAGE, "## Vectors and matrices\n", "| function | value |", "|---|---|"]
    lines += [f"| `{each.signature}` | {each.doc} |" for each in ARRAYS.values()]
    lines += [f"| `{form}` | {doc} |" for form, doc in CREATION.values()]
    lines += ["| `len(x)` | how many components, or rows; a whole number |"]
    lines += ["\n## Numbers\n", "Of vectors and matrices component by component.\n"]
    lines += ["| function | value |", "|---|---|"]
    for name, (target, count) in FUNCTIONS.items():
        arguments = {1: "x", 2: "y, x" if name == "atan2" else "x, y", 3: "x, low, high"}.get(
            count or 0, "x, y, ..."
        )
        lines.append(f"| `{name}({arguments})` | {_doc(target)} |")
    numbers = ", ".join(f"`{name}` = {value:.6g}" for name, value in CONSTANTS.items())
    lines += [f"\nConstants: {numbers}.", LIMITS]
    return "\n".join(lines)


LIMITS = f"""
Where a function has no value, as the root of a negative number, it is NaN, and the block, the
time and what to do are reported. A matrix that is singular where it is inverted is an error with
the block and the time.

## Arrays in parameters

A parameter that is an array may be an expression of numbers: `q: diag(1, 1, 0.1)`, `initial:
zeros(12)`, `indices: "[i for i in range(8) if i != 3]"`. Inside braces it needs quotes, because
of its commas.

## Limits

A text has at most {MAX_LENGTH} characters and {MAX_DEPTH} levels. With all that its indices run
over, all expressions of a parameter are at most {MAX_WRITTEN:,} operations; sizes and ranges are
counted before anything is made of them.
"""


# Those of Python's own module, whose texts differ between its versions.
MATH = {
    **{"atan": "inverse tangent", "tanh": "hyperbolic tangent", "asinh": "inverse hyperbolic sine"},
    **{"erf": "error function", "erfc": "1 - erf(x), without cancellation"},
    **{"degrees": "an angle in rad as degrees", "radians": "an angle in degrees as rad"},
    **{"atan2": "angle (rad) of the point with the coordinates y, x", "hypot": "sqrt(x**2 + y**2)"},
    **{"copysign": "x with the sign of y", "fabs": "absolute value"},
}


def _doc(target: str) -> str:
    """The first line of a function's documentation."""
    owner, _, name = target.rpartition(".")
    text = MATH[name] if owner else (SCOPE[name].__doc__ or "")
    first = re.sub(r":func:`real_(\w+)`", r"`\1`", text.partition("\n")[0]).replace("``", "`")
    return first.rstrip(".").replace("|", "\\|").removeprefix("The ")
