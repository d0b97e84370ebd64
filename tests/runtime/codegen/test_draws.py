"""Draws in C are NumPy's, bit for bit, and leave the generator in the same state."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np
import pytest

from runtime.codegen import support
from runtime.compiler import NotCompilableError, bits_of
from runtime.toolchain import TranslationUnit, build
from tests.compilers import needs_compiler

KINDS = {
    "uniform": np.random.Generator.random,
    "normal": np.random.Generator.standard_normal,
    "exponential": np.random.Generator.standard_exponential,
}
FILLED = """
void many_{kind}(struct draws *random, double *out, int64_t n);
void many_{kind}(struct draws *random, double *out, int64_t n)
{{
    for (int64_t i = 0; i < n; i++) out[i] = draw_{kind}(random);
}}
"""


@pytest.fixture(scope="module", params=["wide", "narrow"])
def library(request: pytest.FixtureRequest) -> Any:
    """With a multiplication of 128 bits, and without, as on a microcontroller."""
    text = "".join(FILLED.format(kind=kind) for kind in KINDS)
    whole = support(text) + text
    if request.param == "narrow":
        whole = f"#undef __SIZEOF_INT128__\n{whole}"
    return build([TranslationUnit("draws", whole)]).functions


def compare(library: Any, kind: str, seed: int, count: int) -> None:
    ours, numpys = np.random.default_rng(seed), np.random.default_rng(seed)
    found = np.empty(count)
    filled = getattr(library, f"many_{kind}")
    filled.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_int64]
    filled(bits_of(ours, "rng").ctypes.data, found.ctypes.data, count)
    assert np.array_equal(found, KINDS[kind](numpys, count))
    assert ours.bit_generator.state == numpys.bit_generator.state


@needs_compiler
@pytest.mark.parametrize("kind", KINDS)
def test_draws_are_numpys(library: Any, kind: str) -> None:
    for seed in range(5):
        compare(library, kind, seed, 20_000)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("kind", KINDS)
def test_many_draws_are_numpys(library: Any, kind: str) -> None:
    """Of 3e7, about 2e5 come from below a curve, and 8e3 from a tail."""
    for seed in range(30):
        compare(library, kind, 100 + seed, 1_000_000)


def test_other_generators_are_called_from_python() -> None:
    with pytest.raises(NotCompilableError, match=r"rng draws from MT19937, not from PCG64"):
        bits_of(np.random.Generator(np.random.MT19937(1)), "rng")
