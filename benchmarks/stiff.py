"""Stiff systems by rodas4 beside scipy's Radau:  python -m benchmarks --only stiff

Diffusion along a rod of n states, 11 ticks of 0.01 s, with the matrix of couplings given to either;
and van der Pol's oscillator with mu = 1000 over 2000 s.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import numpy as np
from scipy import sparse
from scipy.integrate import solve_ivp

import runtime
from benchmarks.tables import figure, table
from benchmarks.timing import take_turns

RTOL, ATOL = 1e-6, 1e-9
MU = 1000.0


def diffusion(n: int, engine: str) -> runtime.Graph:
    """x_i' = (n + 1)^2 (x_i-1 - 2 x_i + x_i+1), 0 beside both ends."""
    rates = [
        " + ".join(
            [f"{-2.0 * (n + 1) ** 2}*x{i}"]
            + [f"{(n + 1.0) ** 2}*x{j}" for j in (i - 1, i + 1) if 0 <= j < n]
        )
        for i in range(n)
    ]
    rod = {"type": "DynamicSystem", "states": [f"x{i}" for i in range(n)], "derivative": rates}
    rod["initial"] = begin(n).tolist()
    return _graph({"rod": rod}, engine, 0.01, 0.11, f"rod.out.{n // 2}")


def begin(n: int) -> np.ndarray:
    return np.sin(np.linspace(0.1, 3.0, n))


def van_der_pol(engine: str) -> runtime.Graph:
    """x'' = mu (1 - x^2) x' - x."""
    rates = ["v", f"{MU}*(1 - x**2)*v - x"]
    ring = {"type": "DynamicSystem", "states": ["x", "v"], "derivative": rates}
    return _graph({"ring": {**ring, "initial": [2.0, 0.0]}}, engine, 10.0, 2000.0, "ring.out.0")


def _graph(
    blocks: dict[str, object], engine: str, dt: float, until: float, watched: str
) -> runtime.Graph:
    run = {"dt": dt, "until": until, "solver": "rodas4", "engine": engine}
    run |= {"rtol": RTOL, "atol": ATOL}
    return runtime.load({"run": run, "blocks": blocks, "probes": {"x": watched}}).check()


def ours(graph: runtime.Graph) -> float:
    """CPU seconds of a run, compiling left out: one has run before."""
    began = time.process_time()
    graph.run()
    return time.process_time() - began


def radau_diffusion(n: int) -> float:
    pattern = sparse.diags([np.ones(n - 1), np.ones(n), np.ones(n - 1)], [-1, 0, 1])

    def slope(t: float, x: np.ndarray) -> np.ndarray:
        rate = -2.0 * x
        rate[1:] += x[:-1]
        rate[:-1] += x[1:]
        return (n + 1.0) ** 2 * rate

    given = {"jac_sparsity": pattern, "rtol": RTOL, "atol": ATOL}
    began = time.process_time()
    solve_ivp(slope, (0.0, 0.11), begin(n), method="Radau", **given)
    return time.process_time() - began


def radau_van_der_pol() -> float:
    def slope(t: float, x: np.ndarray) -> list[float]:
        return [x[1], MU * (1.0 - x[0] ** 2) * x[1] - x[0]]

    began = time.process_time()
    solve_ivp(slope, (0.0, 2000.0), [2.0, 0.0], method="Radau", rtol=RTOL, atol=ATOL)
    return time.process_time() - began


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md."""
    sizes = (20,) if quick else (50, 100, 300)
    rows = []
    makers: dict[str, tuple[Callable[[str], runtime.Graph], Callable[[], float]]] = {
        f"diffusion, {n} states": (partial(diffusion, n), partial(radau_diffusion, n))
        for n in sizes
    }
    makers["van der Pol, mu = 1000"] = (van_der_pol, radau_van_der_pol)
    for name, (make, radau) in makers.items():
        turns = {engine: partial(ours, make(engine)) for engine in ("compiled", "python")}
        taken = take_turns({**turns, "radau": radau}, rounds)
        cells = [figure(taken[key], 1e3, "ms") for key in ("compiled", "python", "radau")]
        rows.append([name, *cells])
    head = ["system", "rodas4, compiled", "rodas4, Python", "scipy's Radau"]
    text = f"CPU time of a run, relative tolerance {RTOL:g}; Radau knows which states are coupled."
    return f"\n## Stiff systems\n\n{text}\n\n{table(head, rows)}"
