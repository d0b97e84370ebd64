"""A process that runs programs: what crashes or does not end takes nothing else with it."""

from __future__ import annotations

import multiprocessing
import resource
import tempfile
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from tests.fuzz.campaign import cpu_seconds
from tests.fuzz.own_blocks.engines import Batch, Difference, tried
from tests.fuzz.own_blocks.generator import Program

# Programs in one graph. Those that fail under Python run one by one, in smaller graphs.
TOGETHER, FAILING = 40, 10
LIMIT = 120  # CPU seconds for one graph
GRAPHS = 200  # until a process is replaced, since each graph loads a library


@dataclass
class Report:
    """What came out of some programs, by name.

    outcomes : a few words for each. reasons : why it is called from Python. unsure : whose process
    ended.
    """

    outcomes: dict[str, str] = field(default_factory=dict)
    reasons: dict[str, str] = field(default_factory=dict)
    differences: list[Difference] = field(default_factory=list)

    def add(self, other: Report) -> None:
        self.outcomes |= other.outcomes
        self.reasons |= other.reasons
        self.differences += other.differences


def examined(programs: Sequence[Program], ways: dict[str, str]) -> Report:
    """Compare the engines on programs of one kind: all that fail under Python, or none."""
    with tempfile.TemporaryDirectory(prefix="spikeblocks-fuzz-") as folder:
        batch = Batch(programs, Path(folder))
        reasons = batch.refused()
        alone = any(ways.values())
        groups = [[p.name] for p in programs] if alone else [[p.name for p in programs]]
        differences = [each for group in groups for each in batch.compared(group)]
        differences += [] if alone or differences else batch.branched(groups[0])
    differing = {each.program.name for each in differences}
    outcomes = {}
    for program in programs:
        how = "called from Python" if program.name in reasons else "compiled"
        ended = "different" if program.name in differing else "fails" if alone else "equal"
        outcomes[program.name] = f"{ended}, {how}"
    return Report(outcomes, reasons, differences)


def _serve(connection: Connection) -> None:
    warnings.simplefilter("ignore")
    while True:
        try:
            programs, ways = connection.recv()
        except EOFError:
            return
        used = int(cpu_seconds())
        resource.setrlimit(resource.RLIMIT_CPU, (used + LIMIT, resource.RLIM_INFINITY))
        try:
            connection.send(examined(programs, ways))
        except Exception as error:  # noqa: BLE001
            connection.send(f"{type(error).__name__}: {error}")


class Worker:
    """Sends programs to a process, which is replaced when it ends."""

    def __init__(self) -> None:
        self.process: multiprocessing.process.BaseProcess | None = None
        self.graphs = 0

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *error: object) -> None:
        self.stop()

    def start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self.connection, other = context.Pipe()
        self.process = context.Process(target=_serve, args=(other,), daemon=True)
        self.process.start()
        other.close()
        self.graphs = 0

    def stop(self) -> None:
        if self.process is not None:
            self.connection.close()
            self.process.join()
        self.process = None

    def report(self, programs: Sequence[Program]) -> Report:
        """What comes out of programs."""
        warnings.simplefilter("ignore")
        ways = tried(programs)
        whole = Report({name: "endless" for name, way in ways.items() if way == "endless"})
        steady = [p for p in programs if not ways[p.name]]
        failing = [p for p in programs if ways[p.name] not in ("", "endless")]
        shared = [each for each in steady if each.is_shared]
        apart = [each for each in steady if not each.is_shared]
        for group, size in ((apart, TOGETHER), (shared, TOGETHER), (failing, FAILING)):
            for first in range(0, len(group), size):
                whole.add(self.sent(group[first : first + size], ways))
        return whole

    def sent(self, programs: Sequence[Program], ways: dict[str, str]) -> Report:
        """The report of the process; of each half of the programs if it cannot give one."""
        if self.process is None or self.graphs >= GRAPHS:
            self.stop()
            self.start()
        self.graphs += 1
        try:
            self.connection.send((programs, {p.name: ways[p.name] for p in programs}))
            answer = self.connection.recv()
        except (EOFError, OSError):
            self.stop()
            answer = "the process ended"
        if isinstance(answer, Report):
            return answer
        if len(programs) == 1:
            (program,) = programs
            outcome = Report({program.name: "different, crashed"})
            outcome.differences.append(Difference(program, "compiled", "crash", "", answer))
            return outcome
        half = len(programs) // 2
        whole = self.sent(programs[:half], ways)
        whole.add(self.sent(programs[half:], ways))
        return whole
