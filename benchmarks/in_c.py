"""The loops by hand in C (``by_hand.c``), compiled as the engine compiles its own.

In go the numbers of a diagram, out come the CPU seconds of its ticks and its poses::

    case_a(numbers, 20_000).seconds                 with expm1 and log1p of the C library
    case_a(numbers, 20_000, vector=True).seconds    with polynomials in vector instructions
"""

from __future__ import annotations

import ctypes
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import tracking as diagram
from benchmarks.agreement import Run
from benchmarks.by_hand import TAU_SYN, CaseA
from blocks.core import FloatArray
from runtime.toolchain import TranslationUnit, build

TEXT = Path(__file__).with_name("by_hand.c")


@cache
def _library(vector: bool) -> ctypes.CDLL:
    text = TEXT.read_text(encoding="utf-8")
    unit = TranslationUnit("loops by hand", f"#define VECTOR 1\n{text}" if vector else text)
    return build([unit]).functions


def _seconds(function: Callable[..., Any], *arguments: Any) -> float:
    """CPU seconds of a call with arrays and whole numbers."""
    given = [
        ctypes.c_void_p(each.ctypes.data) if isinstance(each, np.ndarray) else ctypes.c_int64(each)
        for each in arguments
    ]
    began = time.process_time()
    function(*given)
    return time.process_time() - began


def case_a(a: CaseA, ticks: int, vector: bool = False) -> Run:
    """Case A."""
    n, poses = a.bias.shape[1], np.empty((ticks, 3))
    numbers = np.array([*a.x0, a.dt, a.forward, *a.k.ravel(), *a.kappa, TAU_SYN])
    path, voltage = np.ascontiguousarray(a.path[:, :3]), a.voltage.copy()
    work, few = np.zeros(9 * n), np.zeros(n, dtype=np.int64)
    took = _seconds(
        _library(vector).case_a,
        *(numbers, a.every, path, len(path), a.window, n, a.encoders, a.bias, voltage),
        *(work, few, poses, ticks),
    )
    return Run(took, poses)


def tracking(steps: int, dt: float) -> Run:
    """The diagram without neurons."""
    poses = np.empty((steps, 3))
    numbers = np.array([*diagram.X0, dt, *np.ravel(diagram.gain(dt))])
    return Run(_seconds(_library(False).tracking, numbers, poses, steps), poses)


def gains(factors: FloatArray, ticks: int) -> Run:
    """A chain of Gains behind a constant of 1, recorded at each 100th tick."""
    recorded = np.empty(-(-ticks // 100))
    took = _seconds(_library(False).gains, factors, len(factors), recorded, ticks)
    return Run(took, recorded[:, None])
