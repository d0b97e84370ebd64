"""Expressions of the plan's Python text about values: open inputs, and tests for NaN and infinity.

In go types, out come texts: ``absent(Scalar, 0.0)`` is ``0.0``, and ``finite_test({"a": Scalar})``
is ``isfinite(a)``.
"""

from __future__ import annotations

import math

from blocks.core import SignalType


def absent(kind: SignalType, number: float) -> str:
    """The expression of an open input's value; an array is created anew on each tick.

    Otherwise a block that writes into an input would change what it reads on the next tick.
    """
    text = repr(number) if math.isfinite(number) else f"float({str(number)!r})"
    if kind.form == "array":
        return f"full({kind.shape!r}, {text})"
    return text if kind.form == "scalar" else f"({f'{text}, ' * len(kind.components)})"


def finite_test(signals: dict[str, SignalType]) -> str:
    """An expression that is true while signals hold only valid numbers.

    It is fast, and false as well where the sum or the square of large numbers is infinite: what it
    calls wrong is looked at again. ``np.dot`` would warn of these squares.
    """
    finite: list[str] = []
    others: list[str] = []
    for variable, kind in signals.items():
        numbers = finite if kind.finite else others
        if kind.form == "scalar":
            numbers.append(variable)
        elif kind.form == "record":
            numbers += [f"{variable}[{i}]" for i in range(len(kind.components))]
        else:
            numbers.append(f"vdot({variable}, {variable})")
    tests = [f"isfinite({' + '.join(finite)})"] if finite else []
    return " and ".join(tests + [f"not isnan({term})" for term in others])
