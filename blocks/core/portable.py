"""Functions of arrays whose bits do not depend on the processor; denormal numbers flushed.

Arrays go in, arrays of the same shape come out. NumPy takes these functions from different
libraries with and without AVX-512; whatever enters a simulation or a metric uses this module, and
:mod:`blocks.core.matrices` for linear algebra, instead::

    share = -portable.expm1(-dt / tau)
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from blocks.core.kernels import kernel_of
from blocks.core.signals import FloatArray

# Below this, what decays counts as zero. Far above the smallest normal number, 2.2e-308, so that
# squares are normal, too, after the decay of a few more ticks; and far below what can be seen.
TINY = 1e-140
SELDOM = 128  # ticks


def share_of(tau: float, dt: float) -> float:
    """1 - exp(-dt / tau): what a first-order lag takes over from its input in a step of dt."""
    # Not 1.0 - math.exp(...), which for a short step loses the digits of the difference.
    return -math.expm1(-dt / tau)


def flush_due(t: float, dt: float) -> bool:
    """Whether states are flushed at t (s), a multiple of dt: on the first and each 128th tick.

    By the time alone, so that the bits do not depend on how a run is divided.
    """
    return int(t / dt + 0.5) % SELDOM == 0


def flush(x: FloatArray) -> None:
    """Set what has decayed below 1e-140 to zero, in place.

    Where nothing arrives, a filter's state is multiplied by the same factor on each tick. It would
    become a denormal number, with which a processor takes about a hundred times as long, and stay
    one: in a lowpass, rounding can bring it to a halt above zero. A processor's mode that flushes
    denormals to zero would hold for blocks from elsewhere as well, and not on every target. States
    of systems that a user gives, which may grow again from such a number, are left alone.
    """
    x[np.abs(x) < TINY] = 0.0


@kernel_of(flush)
def _flush_kernel(x: FloatArray) -> None:
    cells = x.ravel()
    for i in range(len(cells)):
        cells[i] = 0.0 if abs(cells[i]) < TINY else cells[i]


def sin(x: FloatArray) -> FloatArray:
    return _each(math.sin, x)


def cos(x: FloatArray) -> FloatArray:
    return _each(math.cos, x)


def exp(x: FloatArray) -> FloatArray:
    return _each(math.exp, x)


def log(x: FloatArray) -> FloatArray:
    return _each(math.log, x)


def tanh(x: FloatArray) -> FloatArray:
    return _each(math.tanh, x)


def atanh(x: FloatArray) -> FloatArray:
    return _each(math.atanh, x)


def __getattr__(name: str) -> Any:
    """``expm1`` and ``log1p``: SciPy's, as fast as NumPy's and the same on all processors."""
    if name not in ("expm1", "log1p"):
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    found = _scipy_functions()
    globals().update(expm1=found.expm1, log1p=found.log1p)
    return globals()[name]


def _scipy_functions() -> Any:
    """The extension module of SciPy that has ``expm1`` and ``log1p``; else all of scipy.special.

    ``import scipy.special`` loads 137 modules, numpy.testing and unittest among them, and takes
    0.2 s and more of the first tick; the extension alone takes 1 ms. Its place in the package is
    not SciPy's public interface, so that whatever is not as expected ends in the public one.
    """
    import importlib.machinery
    import importlib.util

    name = "_special_ufuncs"
    try:
        package = importlib.util.find_spec("scipy")
        places = (package.submodule_search_locations if package else None) or ()
        folders = [f"{place}/special" for place in places]
        spec = importlib.machinery.PathFinder.find_spec(f"scipy.special.{name}", folders)
        if spec is not None and spec.loader is not None:
            found = importlib.util.module_from_spec(spec)
            spec.loader.exec_module(found)
            if isinstance(getattr(found, "expm1", None), np.ufunc) and hasattr(found, "log1p"):
                return found
    except ImportError:
        pass
    from scipy import special

    return special


def arctan2(y: FloatArray, x: FloatArray) -> FloatArray:
    """The angle (rad) of each point of which y and x, of one shape, are given."""
    angles = map(math.atan2, y.ravel().tolist(), x.ravel().tolist())
    return np.fromiter(angles, np.float64, y.size).reshape(y.shape)


def directions(angles: FloatArray) -> FloatArray:
    """Unit vectors (n, 2) at angles (n,) in rad."""
    units = np.empty((len(angles), 2))
    units[:, 0], units[:, 1] = cos(angles), sin(angles)
    return units


def _each(function: Callable[[float], float], x: FloatArray) -> FloatArray:
    """A function of the C library, element by element."""
    return np.fromiter(map(function, x.ravel().tolist()), np.float64, x.size).reshape(x.shape)
