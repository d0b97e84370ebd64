"""The problems for solvers in diffrax, traced and compiled by JAX in double precision."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from typing import Any

import diffrax
import jax
import jax.numpy as jnp
import numpy as np

from benchmarks.problems import START, Solved, edges, reaction, ticks

jax.config.update("jax_enable_x64", True)

SOLVERS = {"explicit": "Dopri5", "stiff": "Kvaerno5"}
NOTE = (
    "an event ends the solution, and the rest is the caller's (-); evaluations are six for each "
    "step, accepted or not, and the first; those of Kvaerno5's Newton iterations are not reported "
    "(-); it interpolates at the ticks, and is given the edges as `jump_ts`."
)


def rates(title: str) -> Callable[[Any, Any, Any], Any]:
    jumps = jnp.asarray(edges())
    of: dict[str, Callable[[Any, Any, Any], Any]] = {
        "smooth": lambda t, x, args: jnp.stack([x[1], -x[0]]),
        "edges": lambda t, x, args: jnp.sum(t >= jumps) % 2 - x,
        "stiff": lambda t, x, args: jnp.stack(reaction(t, x)),
    }
    return of[title]


@functools.cache
def runner(title: str, rtol: float) -> Callable[[Any], Any]:
    """Compiled once; the first call traces."""
    control: Any = diffrax.PIDController(rtol=rtol, atol=rtol / 1000)
    if title == "edges":
        control = diffrax.ClipStepSizeController(control, jump_ts=jnp.asarray(edges()))
    solver = diffrax.Kvaerno5() if title == "stiff" else diffrax.Dopri5()
    term, times = diffrax.ODETerm(rates(title)), ticks(title)

    def run(x: Any) -> Any:
        solution = diffrax.diffeqsolve(
            *(term, solver, 0.0, times[-1] + times[1], None, x),
            **{"saveat": diffrax.SaveAt(ts=times), "stepsize_controller": control},
        )
        return solution.ys, solution.stats["num_steps"]

    return jax.jit(run)


def solve(title: str, rtol: float) -> Solved:
    if title == "events":
        raise NotImplementedError
    run, start = runner(title, rtol), jnp.asarray(START[title])
    began = time.process_time()
    x, steps = jax.block_until_ready(run(start))
    took = time.process_time() - began
    return Solved(np.asarray(x[:, 0]), None if title == "stiff" else 6 * int(steps) + 1, took)
