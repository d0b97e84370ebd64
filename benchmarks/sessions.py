"""What it costs to open the loop:  python -m benchmarks --only sessions

Of case A after half a second of its run: a step of one tick, a read, and copies of the state,
beside the tick of a run that is not interrupted.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial

import runtime
from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, take_turns

GRAPH, BEGIN, TIMES = "line_actuator_failure", 500, 50


def seconds(call: Callable[[], object], times: int = TIMES) -> float:
    """CPU seconds of some calls."""
    began = time.process_time()
    for _ in range(times):
        call()
    return time.process_time() - began


def measured(engine: str, rounds: int) -> dict[str, Timing]:
    """What each operation takes, in turn."""
    session = runtime.load(GRAPH).session(engine=engine).step(BEGIN)
    state, kept = session._engine.state, session.snapshot()
    copy = state.snapshot()
    session.read("plant.pose")  # what reads is prepared once
    return take_turns(
        {
            "a tick of a run": lambda: seconds(partial(session.step, TIMES), 1),
            "a step of one tick": partial(seconds, session.step),
            "a read of one signal": partial(seconds, partial(session.read, "plant.pose")),
            "a copy of the run's state": partial(seconds, state.snapshot),
            "putting it back": partial(seconds, partial(state.restore, copy)),
            "snapshot() of the session": partial(seconds, session.snapshot),
            "restore(...)": partial(seconds, partial(session.restore, kept)),
            "branch()": lambda: seconds(session.branch, 1) * TIMES,
        },
        rounds,
        TIMES,
    )


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md about sessions."""
    timings = {
        engine: measured(engine, 1 if quick else rounds) for engine in ("python", "compiled")
    }
    rows = [
        [name, *(figure(of[name], 1e6, "µs") for of in timings.values())]
        for name in timings["python"]
    ]
    size = runtime.load(GRAPH).session().step()._engine.state.memory.nbytes
    copied = 1e6 * timings["compiled"]["a copy of the run's state"].median
    text = (
        f"\n## Sessions\n\n`{GRAPH}`, whose state is {size / 1000:.0f} kB, after {BEGIN} ticks; "
        "CPU time. Steps and reads are those of a [session](sessions.md); a snapshot of it has its "
        "recordings, too.\n\n"
    )
    wanted = [Goal("a copy of the run's state", copied, most=50.0, unit=" µs")]
    return text + table(["", "Python engine", "compiled engine"], rows) + goals(wanted)
