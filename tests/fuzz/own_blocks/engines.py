"""Runs programs as blocks of one graph under every engine, and compares them block by block."""

from __future__ import annotations

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
from runtime.engine import Engine, Outcome
from runtime.engine.compiled import CheckedRunner, CompiledRunner
from runtime.engine.compiled.runner import template
from runtime.engine.engine import seed_of
from tests.fuzz.campaign import UnboundedError, bounded
from tests.fuzz.own_blocks.generator import Program

TICKS = 7
DT = 0.01
# Of quarters, so that sums of products of few of them are exact in any order.
X = (1.5, 0.5, -0.75, 2.25, 0.0, -3.0, 1.0)
V = (
    *((1.0, 2.0, -0.5, 0.25), (1.5, -1.0, 0.0, 3.0), (0.5, 2.5, -0.75, -2.0)),
    *((-0.0, 1.0, 1.0, 4.0), (3.0, -1.5, 0.25, 0.0), (-2.0, -0.25, -4.0, -1.0)),
    (0.75, 0.0, 2.0, -3.5),
)
STATES = ("r", "h", "g", "s")
ROUNDING = 1e-9
RUNNERS: dict[str, Any] = {"compiled": CompiledRunner, "checked": CheckedRunner}
HEAD = f'''"""Random blocks."""

import math

import numpy as np

from blocks import Block, FloatArray, Input, Output, Scalar, State, Vector, param

X = {X!r}
V = {V!r}
SCALE = 0.75
COUNT = 5
SETUP = {{}}


def cube(y):
    return y * y * y


def shifted(y, by=0.5):
    return y - by


def factorial(k):
    return 1 if k <= 1 else k * factorial(k - 1)


def fibonacci(k):
    a, b = 0, 1
    for _ in range(k):
        a, b = b, a + b
    return a


def first_of(a, b):
    return a if a[0] > b[0] else b


class Feed(Block):
    """Other numbers on every tick."""

    x = Output(Scalar)
    v = Output(Vector(4))

    def output(self, state, t):
        k = round(t / {DT})
        return X[k], np.array(V[k])


class Base(Block):
    """What random blocks have in common."""

    x = Input(Scalar)
    v = Input(Vector(4))

    a: float = param(0.75, doc="a number")
    n: int = param(3, doc="an integer")
    flag: bool = param(True, doc="a flag")
    mode: str = param("fast", choices=("fast", "slow"), doc="a text")
    p: FloatArray = param([2.0, -1.0, 0.5], shape=(3,), doc="an array")

    begin = State()
    h = State(4)
    g = State(2, 3)
    s = State()

    def start(self, state):
        state.begin, first = SETUP[type(self).__name__]
        state.h = first
        state.g = [[1.0, -0.5, 2.0], [3.0, 0.25, -1.0]]
        state.s = 0.5

    def mixed(self, first, second=2.0):
        return first * 2.0 - second * self.a

    def fed(self, y):
        z = y * 0.5
        return z + self.n

    def drawn(self, state):
        return state.rng.random()

    def changed(self, state):
        state.h[0] += 1.0
        return state.h[0]

    def swapped(self, state):
        state.h[0], state.h[1] = state.h[1], state.h[0]
        return state.h[1]

    def changed_all(self, state):
        state.h += 1.0
        return state.h * 0.5

    def doubled(self, values):
        return values * 2.0
'''
PORTS = {
    "update": "    out = Output(Scalar)\n    r = State(16)\n\n    def output(self, state, t):\n        return 0.0\n",
    "output": "    out = Output(Vector(16))\n",
}


def class_text(program: Program) -> str:
    """A program's class with what only its kind of method declares."""
    head, line, rest = program.text.partition('"""Random."""\n')
    return f"{head}{line}\n{PORTS[program.method]}{rest}"


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
        if self.what in ("outcome", "crash"):
            return f"{self.what} {raised(self.python)} {raised(self.other)}"
        return "value"

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
        self.program = runtime.load(document).check().prepared().program
        feed: Any = type(self.program.network.entries["feed"].made)
        self.setup: dict[str, Any] = feed.output.__globals__["SETUP"]
        self.notes: list[str] = []

    def engine(self, kind: str, active: Iterable[str]) -> Engine:
        """An engine; blocks that are not active do nothing."""
        there = set(active)
        for name, program in self.programs.items():
            self.setup[name] = (program.begin if name in there else 1e9, program.first)
        return Engine(self.program, 0, RUNNERS.get(kind), self.notes.append)

    def run(self, kind: str, active: Iterable[str]) -> tuple[Engine, Outcome]:
        """A run of these programs."""
        engine = self.engine(kind, active)
        with np.errstate(all="ignore"):
            return engine, engine.run(None)

    def refused(self) -> dict[str, str]:
        """The programs that are called from Python, with the reason."""
        engine = self.engine("python", ())
        engine.prepare()
        kernels = template(self.program, engine.states, self.notes.append).kernels
        return {name: why for name, why in kernels.refused.items() if name in self.programs}

    def compared(self, active: Sequence[str]) -> list[Difference]:
        """What other engines do differently from Python with these programs."""
        expected = self.run("python", active)
        found: dict[str, Difference] = {}
        for kind in RUNNERS:
            there = [name for name in active if name not in found]
            while True:
                other = self.run(kind, there)
                error, reference = other[1].error, expected[1].error
                if error is None or reference is not None or len(active) == 1:
                    break
                # It fails only here: the others are compared without it.
                if error.block not in there:
                    raise error
                program = self.programs[error.block]
                found[error.block] = Difference(program, kind, "outcome", "", str(error))
                there.remove(error.block)
            for name in there:
                a, b = (ended(name, *run) for run in (expected, other))
                difference = different(self.programs[name], kind, a, b)
                if difference is not None:
                    found[name] = difference
        return list(found.values())


def ended(name: str, engine: Engine, outcome: Outcome) -> Ended:
    """How the run of one block ended."""
    rows = {
        probe: outcome.arrays[probe][: outcome.ticks]
        for probe in (f"{name}_out", f"{name}_r")
        if probe in outcome.arrays
    }
    own = engine.states[name]
    states = {key: np.array(getattr(own, key)) for key in STATES if hasattr(own, key)}
    return Ended(rows, states, "" if outcome.error is None else str(outcome.error))


def different(program: Program, engine: str, a: Ended, b: Ended) -> Difference | None:
    """The first thing that differs."""
    if exception(a.failure) != exception(b.failure):
        return Difference(program, engine, "outcome", a.failure, b.failure)
    pairs = [(key, a.rows[key], b.rows[key]) for key in a.rows]
    if not a.failure:
        pairs += [(f"state {key}", a.states[key], b.states[key]) for key in a.states]
    for key, x, y in pairs:
        what = key.removeprefix(f"{program.name}_")
        if x.shape != y.shape:
            return Difference(program, engine, what, f"{x.shape}", f"{y.shape}")
        loose = (program.loose and not key.startswith("state")) or key == "state r"
        same = (x.view(np.int64) == y.view(np.int64)) | (np.isnan(x) & np.isnan(y))
        if loose and program.loose:
            same |= np.isclose(x, y, rtol=ROUNDING, atol=ROUNDING)
        if not same.all():
            at = tuple(int(i) for i in np.argwhere(~same)[0])
            return Difference(program, engine, f"{what}{list(at)}", repr(x[at]), repr(y[at]))
    return None


def raised(failure: str) -> str:
    """The kind of exception of a failure."""
    found = re.search(r"(\w+Error|not finite)", failure)
    return found[1] if found else ""


def exception(failure: str) -> str:
    """Block, tick and kind of exception of a failure."""
    return re.sub(r"(\): \w+).*", r"\1", failure, flags=re.DOTALL)


def module_text(programs: Sequence[Program]) -> str:
    """A module with the programs' classes."""
    made = []
    for program in programs:
        head, line, rest = program.text.partition('"""Random."""\n')
        made.append(f"{head}{line}\n{PORTS[program.method]}{rest}")
    return "\n\n".join([HEAD, *made])


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
    except Exception as error:
        return type(error).__name__
    return ""
