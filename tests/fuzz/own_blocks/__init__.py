"""Random own blocks, with what Python and NumPy can do, do the same under all engines."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from tests.fuzz.campaign import MANY_FAULTS, Record, cpu_seconds
from tests.fuzz.own_blocks.engines import Difference
from tests.fuzz.own_blocks.generator import Program, program
from tests.fuzz.own_blocks.shrinking import likeness, smallest
from tests.fuzz.own_blocks.workers import Worker

TITLE = "Own blocks under all engines"
WHAT = (
    "Random methods of own blocks in Python and NumPy: arithmetic of floats, integers, bools and "
    "arrays of these, calls with side effects, draws, comprehensions, views, masks, keywords, "
    "domain errors, NaN and infinity; memory in views of a state in lists, dicts and objects, in "
    "closures, globals, defaults and attributes of a class. Each runs for 7 ticks under the Python "
    "engine, the compiled engine without its own comparison with Python, and the checked engine "
    "with it, after a compilation with other globals; each engine also goes back two ticks, and, "
    "where memory is not shared by all runs, is copied, and the copy runs before the original."
)
HOLDS = (
    "Every output, recorded state and last state has the same bits (within 1e-9 where NumPy's own "
    "functions of arrays round otherwise), and a block that fails does so at the same tick with "
    "the same exception. So it is for a copy and its original. What does not compile is called "
    "from Python."
)
AT_ONCE = 60


def run(examples: int, seed: int) -> Record:
    """Try programs; the first ones are those that once differed."""
    started = cpu_seconds()
    outcomes: Counter[str] = Counter()
    faults: dict[str, Difference] = {}
    with Worker() as worker:
        for first in range(0, examples, AT_ONCE):
            numbers = range(first, min(first + AT_ONCE, examples))
            report = worker.report([program(seed, number) for number in numbers])
            outcomes.update(report.outcomes.values())
            for difference in report.differences:
                shown = shrunk(worker, difference)
                faults.setdefault(likeness(shown.program), shown)
                if len(faults) >= MANY_FAULTS:
                    break
            if len(faults) >= MANY_FAULTS:
                break
    failures = tuple(map(str, faults.values()))
    tried = sum(outcomes.values())
    return Record("own_blocks", tried, seed, dict(outcomes), failures, cpu_seconds() - started)


def shrunk(worker: Worker, difference: Difference) -> Difference:
    """The same difference of the smallest program."""
    latest = {difference.program.body: difference}

    def check(programs: Sequence[Program]) -> dict[str, str]:
        found = worker.report(programs).differences
        latest.update({each.program.body: each for each in found})
        return {each.program.name: each.kind for each in found}

    least = smallest(difference.program, difference.kind, check)
    return latest[least.body]
