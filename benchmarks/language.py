"""What an editor waits for: a request after an edit, in the process of the language server."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from functools import partial
from itertools import count
from pathlib import Path

from benchmarks.tables import Goal, figure, goals, table
from benchmarks.timing import Timing, take_turns

CASE_C = Path(__file__).parent.parent / "graphs" / "wall_following.yaml"
BLOCKS = 2000
# What is asked, of which text, and the goal in ms.
GOALS = {
    "diagnostics, case C": 50.0,
    "completion of a wire, case C": 30.0,
    "hover, case C": None,
    f"diagnostics, {BLOCKS} blocks": 500.0,
    f"completion of a wire, {BLOCKS} blocks": None,
}
INTRO = f"""
## Language server

CPU time of one question after an edit that changed one number of the text, without the protocol.
It is CPU time since other programs ran at the same time, which makes it longer as well. The text
is parsed and checked again; blocks that did not change are used again. In an editor a completion
finds the text checked where diagnostics came first; here it does not, so that each figure
contains a check of the whole text. Case C is `graphs/wall_following.yaml`; the long text is a
chain of {BLOCKS} gains.

"""


def chain(blocks: int) -> str:
    """A graph of many gains, one after the other."""
    lines = ["graph: chain", "run: {dt: 0.001, until: 1.0}", "blocks:"]
    lines += ["  b0: {type: Constant, value: 1.0}"]
    lines += [f"  b{i}: {{type: Gain, gain: 0.5, dt: 0.01}}" for i in range(1, blocks)]
    lines += ["wires:", "  b1: {input: b0.value}"]
    lines += [f"  b{i}: {{input: b{i - 1}.out}}" for i in range(2, blocks)]
    return "\n".join([*lines, ""])


def section(rounds: int) -> str:
    from runtime.language import Model, Surroundings, complete, diagnose, hover

    surroundings = Surroundings()
    gc.collect()
    gc.freeze()  # as the server does
    numbers: Iterator[int] = count()

    def timed(text: str, ask: Callable[[Model], object]) -> float:
        edited = text.replace("gain: 0.5", f"gain: 0.{next(numbers)}5", 1)
        began = time.process_time()
        ask(Model(edited, CASE_C, surroundings))
        return time.process_time() - began

    case_c, long = CASE_C.read_text(encoding="utf-8"), chain(BLOCKS)
    wire, end = case_c.index("error.state"), long.index("b99.out")
    asked: tuple[tuple[str, Callable[[Model], object]], ...] = (
        (case_c, diagnose),
        (case_c, lambda model: complete(model, wire)),
        (case_c, lambda model: hover(model, wire)),
        (long, diagnose),
        (long, lambda model: complete(model, end)),
    )
    contestants = {
        name: partial(timed, *question) for name, question in zip(GOALS, asked, strict=True)
    }
    timings: dict[str, Timing] = take_turns(contestants, max(rounds, 7))
    rows = [[name, figure(timing, 1e3, "ms")] for name, timing in timings.items()]
    wanted = [
        Goal(f"{name} within {limit:g} ms", 1e3 * timings[name].median, most=limit, unit=" ms")
        for name, limit in GOALS.items()
        if limit is not None
    ]
    return INTRO + table(["question", "CPU time"], rows) + goals(wanted)


if __name__ == "__main__":
    print(section(7))
