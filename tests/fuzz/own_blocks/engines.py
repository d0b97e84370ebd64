"""Runs programs as blocks of one graph under every engine, and compares them block by block."""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np

import runtime
from blocks.core import BlockState
from runtime.engine import Engine, Outcome, adopt, carried
from runtime.engine.compiled import CheckedRunner, CompiledRunner
from runtime.engine.compiled.runner import template
from runtime.engine.state import seed_of
from tests.fuzz.campaign import UnboundedError, bounded
from tests.fuzz.own_blocks import base
from tests.fuzz.own_blocks.base import DT, V, X
from tests.fuzz.own_blocks.generator import Program

TICKS = len(X)
HALF = TICKS // 2
STATES = ("r", "h", "g", "s")
ROUNDING = 1e-9
RUNNERS: dict[str, Any] = {"compiled": CompiledRunner, "checked": CheckedRunner}
OTHERS = {"SCALE": 0.125, "COUNT": 4}
BLOCK = re.compile(r"'(P\w+)'")


class Bare(Engine):
    """The compiled engine without its comparison with Python, so that faults are not mended."""

    def prepare(self) -> Any:
        made = super().prepare()
        if self.exact is not None:
            self.exact.comparison = None
        return made


@dataclass(frozen=True)
class Difference:
    """What another engine does differently with a program.

    what : where, in a word or two.
    """

    program: Program
    engine: str
    what: str
    python: str
    other: str

    @property
    def kind(self) -> str:
        """What differs, without its place and values."""
        if "[" in self.what:
            return "value"
        return f"{self.what} {raised(self.python)} {raised(self.other)}"

    def __str__(self) -> str:
        return (
            f"{self.program!r}{self.what}:\n    python: {self.python}\n"
            f"    {self.engine}: {self.other}"
        )


@dataclass(frozen=True)
class Ended:
    """How one block's run ended: what it recorded, its last states, and its failure."""

    rows: dict[str, np.ndarray[Any, Any]]
    states: dict[str, np.ndarray[Any, Any]]
    failure: str


class Batch:
    """Programs as blocks of one graph, which does not connect them."""

    def __init__(self, programs: Sequence[Program], folder: Path) -> None:
        self.programs = {program.name: program for program in programs}
        file = folder / "own.py"
        file.write_text(module_text(programs), encoding="utf-8")
        names, module = list(self.programs), {"module": str(file)}
        updates = [name for name in names if self.programs[name].method == "update"]
        document: dict[str, Any] = {
            "graph": "random",
            "run": {"dt": DT, "until": TICKS * DT},
            "blocks": {"feed": {"type": "Feed", **module}}
            | {name: {"type": name, **module} for name in names},
            "wires": {name: {"x": "feed.x", "v": "feed.v"} for name in names},
            "probes": {f"{name}_out": f"{name}.out" for name in names}
            | {f"{name}_r": f"{name}.r" for name in updates},
        }
        graph = runtime.load(document).check()
        self.program = graph.prepared().program
        self.growing = graph.prepared(growing=True).program
        feed: Any = type(self.program.network.entries["feed"].block)
        self.scope: dict[str, Any] = feed.output.__globals__
        self.setup: dict[str, Any] = self.scope["SETUP"]
        self.notes: list[str] = []

    def engine(self, kind: str, active: Iterable[str]) -> Engine:
        """An engine; blocks that are not active do nothing."""
        self.set_up(active)
        engine = Bare if kind == "compiled" else Engine
        return engine(self.program, 0, RUNNERS.get(kind), self.notes.append)

    def run(self, kind: str, active: Iterable[str]) -> tuple[Engine, Outcome]:
        """A run of these programs."""
        engine = self.engine(kind, active)
        with np.errstate(all="ignore"):
            return engine, engine.run(None)

    def branched(self, active: Sequence[str]) -> list[Difference]:
        """What a run that goes back, its branch, or it afterwards does differently from Python."""
        is_shared = any(self.programs[name].is_shared for name in active)
        expected = self.run("python", active)
        found: dict[str, Difference] = {}
        for kind, runner in (("python", None), *RUNNERS.items()):
            self.set_up(active)
            engines = {"original": Engine(self.growing, 0, runner, self.notes.append)}
            if not is_shared:
                engines["branch"] = Engine(self.growing, 0, runner, self.notes.append)
            with np.errstate(all="ignore"):
                for engine in engines.values():
                    engine.prepare()
                one = engines["original"]
                one.advance(HALF)
                saved = one.state.snapshot()
                one.runner.run(HALF, HALF + 2, one.state.held)
                one.state.restore(saved)
                if not is_shared:
                    adopt(engines["branch"], carried(one))
                for engine in reversed(engines.values()):
                    engine.advance(TICKS)
            for what, engine in engines.items():
                for name in active:
                    ends = ended(name, *expected), ended(name, engine, engine.finish())
                    difference = different(self.programs[name], f"{what}, {kind}", *ends)
                    if difference is not None:
                        found.setdefault(name, difference)
        return list(found.values())

    def set_up(self, active: Iterable[str]) -> None:
        """Let these programs do something from the next start on."""
        there = set(active)
        for name, program in self.programs.items():
            self.setup[name] = (program.begin if name in there else 1e9, program.first)

    def refused(self) -> dict[str, str]:
        """The programs that are called from Python, with the reason.

        Globals have other values meanwhile, which compiled code must not keep.
        """
        before = {key: self.scope[key] for key in OTHERS}
        self.scope |= OTHERS
        try:
            return self._refused()
        finally:
            self.scope |= before

    def _refused(self) -> dict[str, str]:
        engine = self.engine("python", ())
        engine.prepare()
        kernels = template(self.program, engine.state.blocks, self.notes.append).kernels
        return {name: why for name, why in kernels.refused.items() if name in self.programs}

    def compared(self, active: Sequence[str]) -> list[Difference]:
        """What other engines do differently from Python with these programs."""
        expected = self.run("python", active)
        found: dict[str, Difference] = {}
        for kind in RUNNERS:
            there = list(active)
            while there:
                other = self.run(kind, there)
                for name in there:
                    a, b = (ended(name, *run) for run in (expected, other))
                    difference = different(self.programs[name], kind, a, b)
                    if difference is not None:
                        found.setdefault(name, difference)
                # Where one leaves the compiled engine, the others are compared again without it.
                left = self.leaving(kind, other[1], found)
                if not left & set(there) or len(active) == 1:
                    break
                there = [name for name in there if name not in left]
        return list(found.values())

    def leaving(self, kind: str, outcome: Outcome, found: dict[str, Difference]) -> set[str]:
        """The programs that ended the run, or its part under the compiled engine."""
        error = outcome.error
        if error is not None and error.block not in self.programs:
            raise error
        names = set() if error is None else {error.block}
        for text in outcome.notes:
            name = (BLOCK.findall(text) or [""])[0]
            names.add(name)
            if "Python does not do" not in text and name in self.programs:
                found.setdefault(name, Difference(self.programs[name], kind, "note", "", text))
        return names


def ended(name: str, engine: Engine, outcome: Outcome) -> Ended:
    """How the run of one block ended."""
    rows = {
        probe: outcome.arrays[probe][: outcome.ticks]
        for probe in (f"{name}_out", f"{name}_r")
        if probe in outcome.arrays
    }
    own = engine.state.blocks[name]
    states = {key: np.array(getattr(own, key)) for key in STATES if hasattr(own, key)}
    error = outcome.error
    return Ended(rows, states, str(error) if error is not None and error.block == name else "")


def different(program: Program, engine: str, a: Ended, b: Ended) -> Difference | None:
    """The first thing that differs."""
    if placed(a.failure) != placed(b.failure):
        return Difference(program, engine, "outcome", a.failure, b.failure)
    pairs = [(key, a.rows[key], b.rows[key]) for key in a.rows]
    pairs += [(f"state {key}", a.states[key], b.states[key]) for key in a.states]
    for key, x, y in pairs:
        what = key.removeprefix(f"{program.name}_")
        if x.shape != y.shape:
            return None  # another block ended the run: this one is compared without that
        same = (x.view(np.int64) == y.view(np.int64)) | (np.isnan(x) & np.isnan(y))
        if program.loose:
            same |= np.isclose(x, y, rtol=ROUNDING, atol=ROUNDING)
        if not same.all():
            at = tuple(int(i) for i in np.argwhere(~same)[0])
            return Difference(program, engine, f"{what}{list(at)}", repr(x[at]), repr(y[at]))
    return None


def placed(failure: str) -> str:
    """A failure without the line of an unassigned variable, on which Python itself is not firm.

    Once it has specialized ``j %= 1; a[3] = b`` (after some calls), storing j and loading b are one
    instruction, and Python 3.11 reports the line of the first statement.
    """
    return re.sub(r":\d+\)$", ")", failure) if "UnboundLocalError" in failure else failure


def raised(failure: str) -> str:
    """The kind of exception of a failure."""
    found = re.search(r"(\w+Error|not finite)", failure)
    return found[1] if found else ""


def module_text(programs: Sequence[Program]) -> str:
    """A module with the programs' classes."""
    return "\n\n".join([inspect.getsource(base), *(program.text for program in programs)])


def tried(programs: Sequence[Program]) -> dict[str, str]:
    """Call the methods of programs in Python; returns how each ended, '' if without a failure."""
    module = sys.modules["random_blocks"] = ModuleType("random_blocks")
    scope = vars(module)
    exec(compile(module_text(programs), "random_blocks", "exec"), scope)
    return {program.name: _tried(program, scope) for program in programs}


def _tried(program: Program, scope: dict[str, Any]) -> str:
    scope["SETUP"][program.name] = (program.begin, program.first)
    made = scope[program.name]()
    shapes = {key: declared.shape for key, declared in made.spec.states.items()}
    arrays = {key: np.zeros(shape) for key, shape in shapes.items()}
    state = BlockState(SimpleNamespace(dt=DT), seed_of(0, program.name), arrays)  # type: ignore[arg-type]
    made.start(state)
    try:
        with np.errstate(all="ignore"), bounded(1.0):
            for k in range(TICKS):
                v = np.array(V[k])
                v.setflags(write=False)
                found = getattr(made, program.method)(state, k * DT, X[k], v)
                if found is not None and not np.isfinite(found).all():
                    return "not finite"
    except UnboundedError:
        return "endless"
    except Exception as error:  # noqa: BLE001
        return type(error).__name__
    return ""
