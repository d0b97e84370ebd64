"""expm1 and log1p as polynomials: their largest error, and the same bits in compiled code."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable

import numpy as np
import pytest

from blocks.core import FloatArray, polynomials
from runtime.codegen import Array, Entry, Writer
from runtime.compiler import translate_functions
from runtime.engine.compiled.memory import Context
from runtime.toolchain import TranslationUnit, build
from tests.compilers import needs_compiler

Function = Callable[[FloatArray], FloatArray]
# Where they are used, around each change of k, and all the way to the ends.
RANGES = {
    "expm1": [(-0.05, 0.0), (-0.6, 1.2), (-45.0, 45.0), (-1e-9, 1e-9), (40.0, 709.7)],
    "log1p": [(-0.05, 0.0), (-0.6, 1.2), (-1.0, 10.0), (-1e-9, 1e-9), (1.0, 1e6)],
}
SPECIAL = [0.0, -0.0, math.inf, -math.inf, math.nan, -1.0, -2.0, 709.78, 710.0, 1e-310, -5e-324]
SPECIAL += [1e308, -40.0, -1e300, 1e-17, 0.34, -0.34, 0.29, -0.29, 2.0**53, np.nextafter(-1.0, 0.0)]


def arguments(name: str, count: int, seed: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    drawn = [rng.uniform(low, high, count // 6) for low, high in RANGES[name]]
    powers = 10.0 ** rng.uniform(-300.0, 2.8 if name == "expm1" else 300.0, count // 6)
    return np.concatenate([*drawn, powers])


def error(name: str, x: FloatArray) -> float:
    """The largest error in units in the last place, against 64 bits of mantissa."""
    if np.finfo(np.longdouble).nmant < 63:
        pytest.skip("a long double has no more bits than a double")
    function: Function = getattr(polynomials, name)
    right = getattr(np, name)(x.astype(np.longdouble))
    unit = np.spacing(np.abs(right.astype(float))).astype(np.longdouble)
    return float((np.abs(function(x).astype(np.longdouble) - right) / unit).max())


@pytest.mark.parametrize("name", RANGES)
def test_no_error_is_above_one_unit_in_the_last_place(name: str) -> None:
    assert error(name, arguments(name, 60_000, 1)) < 0.9


@pytest.mark.slow
@pytest.mark.parametrize("name", RANGES)
def test_no_error_is_above_one_unit_in_the_last_place_of_1e7(name: str) -> None:
    worst = max(error(name, arguments(name, 1_000_000, seed)) for seed in range(10))
    assert worst < 0.9


@pytest.mark.parametrize("name", RANGES)
def test_the_long_double_of_the_tests_is_right(name: str) -> None:
    """The series in whole numbers of 2^-2000, against numbers of 2^-1100."""
    x = arguments(name, 60, 2)
    x = x[np.abs(x) < 0.5]
    found = getattr(np, name)(x.astype(np.longdouble))
    for number, value in zip(x.tolist(), found, strict=True):
        top, bottom = number.as_integer_ratio()
        exact, term = 0, 1 << 2000
        for n in range(1, 200):
            term = term * top // bottom
            if name == "expm1":
                term //= n
                exact += term
            else:
                exact += term // n if n % 2 else -(term // n)
        whole = int(value * np.longdouble(2.0) ** 1100)
        assert abs((whole << 900) - exact) <= abs(exact) >> 62


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", RANGES)
def test_ends_and_signs_are_those_of_the_c_library(name: str) -> None:
    found = getattr(polynomials, name)(np.array(SPECIAL))
    for x, value in zip(SPECIAL, found.tolist(), strict=True):
        try:
            wanted = getattr(math, name)(x)
        except OverflowError:
            wanted = math.inf
        except ValueError:
            wanted = -math.inf if x == -1.0 else math.nan
        np.testing.assert_array_max_ulp(value, wanted, 1)
        assert math.isnan(value) or math.copysign(1.0, value) == math.copysign(1.0, wanted)


def all_in_c(name: str) -> Function:
    """The function of blocks.core.polynomials, compiled for arrays."""
    of = getattr(polynomials, f"{name}_of")
    entry = Entry(f"test_{name}", f"{name}_of", [("x", Array("float", (None,)))])
    unit = Writer(translate_functions([of])).unit([entry], "")
    c_function = getattr(build([TranslationUnit(name, unit.text)]).functions, f"test_{name}")

    def run(x: FloatArray) -> FloatArray:
        made, context = x.copy(), Context()
        at = [ctypes.c_void_p(context.address), None, ctypes.c_void_p(made.ctypes.data)]
        c_function(*at, ctypes.c_int64(len(made)))
        return made

    return run


@needs_compiler
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("name", RANGES)
def test_compiled_bits_are_those_of_numpy(name: str) -> None:
    function: Function = getattr(polynomials, name)
    compiled = all_in_c(name)
    given = np.concatenate([arguments(name, 60_000, 3), SPECIAL])
    small = given[np.abs(given) < 0.29]
    for x in (given, small, small[:3], small[:0]):
        np.testing.assert_array_equal(compiled(x).view(np.int64), function(x).view(np.int64))


def test_any_order_is_a_range() -> None:
    assert list(polynomials.any_order(3)) == [0, 1, 2]
