"""The ``run`` section of a graph: base step, length, seed, engine and solver.

In: a document. Out: a :class:`RunSection` with defaults for what is missing or wrong, so that the
rest of the graph can be checked as well::

    run: {dt: 0.001, until: 5, solver: dopri5, rtol: 1e-8}
    RunSection(dt=0.001, until=5.0, ..., solver=Solver("dopri5", rtol=1e-8))
"""

from __future__ import annotations

import math
import re
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

from blocks.core import misspelt
from runtime.document.node import Node
from runtime.document.scalars import parse_scalar
from runtime.document.sections import RUN_KEYS, RUN_OTHER_NAMES, check_keys, section
from runtime.document.time_units import SECOND, TIME_UNITS
from runtime.errors import Problems

DEFAULT_UNTIL = 10.0
MAX_TICKS = 10**12
ENGINES = ("auto", "python", "compiled", "checked")
STATE_CHOICES = ("small", "all", "none")
EVENT_CHOICES = ("located", "ticks")
DIRECTIONS = ("either", "rising", "falling")
LOOPS = ("error", "solve")
SOLVERS = ("euler", "heun", "rk4", "dopri5", "rodas4")
ADAPTIVE = ("dopri5", "rodas4")
STOP_DOCS = {
    "when": "a scalar signal",
    "above": "the level that ends the run when the signal rises above it",
    "below": "the level that ends the run when the signal falls below it",
    "crosses": "the level that ends the run when the signal passes it",
    "direction": "which way it crosses: rising, falling or either",
}
STOPS = ("above", "below", "crosses")
TOLERANCES = ("rtol", "atol", "max_step")
# Keys of the section that take one of a few words.
RUN_CHOICES = {
    **{"engine": ENGINES, "solver": SOLVERS, "states": STATE_CHOICES, "events": EVENT_CHOICES},
    "loops": LOOPS,
    "time_unit": tuple(TIME_UNITS),
}
DEFAULT_MEMORY = 1024**3
UNITS = {"": 1, "K": 1024, "M": 1024**2, "G": 1024**3}


@dataclass(frozen=True)
class Solver:
    """How continuous states are integrated between two ticks.

    The rest is for solvers that choose their own steps: the error of each is at most atol + rtol
    times the state, and none is longer than ``max_step`` (s; 0: as long as a tick).
    """

    name: str = "rk4"
    rtol: float = 1e-6
    atol: float = 1e-9
    max_step: float = 0.0

    @property
    def is_adaptive(self) -> bool:
        """Whether it chooses its own steps."""
        return self.name in ADAPTIVE

    def entries(self) -> dict[str, float | str]:
        """The entries of the section that differ from the defaults."""
        default = vars(Solver())
        return {
            "solver" if key == "name" else key: value
            for key, value in vars(self).items()
            if value != default[key]
        }


@dataclass(frozen=True)
class Stop:
    """What ends a run early: the signal ``when`` rises above a level, falls below it, or either."""

    when: str
    kind: str
    level: float
    direction: str
    node: Node = field(compare=False, repr=False)

    def entries(self) -> dict[str, float | str]:
        """The entry of the section."""
        entries: dict[str, float | str] = {"when": self.when, self.kind: self.level}
        is_told = self.kind == "crosses" and self.direction != DIRECTIONS[0]
        return entries | ({"direction": self.direction} if is_told else {})


@dataclass(frozen=True)
class RunSection:
    """The section ``run`` with defaults: times in ``time_unit``, memory in bytes.

    ``keep`` is the length of the last part of the recordings that is kept; None for all.
    """

    dt: float
    until: float
    seed: int
    engine: str
    memory: int = DEFAULT_MEMORY
    solver: Solver = Solver()
    stop: Stop | None = None
    states: str = STATE_CHOICES[0]
    time_unit: str = SECOND
    events: str = EVENT_CHOICES[0]
    loops: str = LOOPS[0]
    keep: float | None = None


def plain_entries(run: Any) -> dict[str, Any]:
    """The entries of plain values that are not the defaults, of a section or what has all of it.

    Made of the fields, so that a new key is not forgotten.
    """
    known = {each.name: each.default for each in fields(RunSection) if each.default is not MISSING}
    return {
        key: getattr(run, key)
        for key, default in known.items()
        if key not in ("solver", "stop") and getattr(run, key) != default
    }


def read_run(document: Node, problems: Problems) -> RunSection:
    """Read the section; wrong values are reported and replaced by defaults."""
    run = section(document, "run", "run", problems)
    check_keys(document.get("run") or Node({}), RUN_KEYS, "run", problems, "key", RUN_OTHER_NAMES)
    unit = _choice(run, "time_unit", tuple(TIME_UNITS), SECOND, problems)

    def number(name: str, default: float) -> float:
        node = run.get(name)
        if node is None:
            return default
        return seconds(node, f"run.{name}", problems) or default

    dt, until = number("dt", 0.001), number("until", DEFAULT_UNTIL)
    if not 1 <= until / dt <= MAX_TICKS:
        node = run.get("until") or run.get("dt")
        where = document.where if node is None else node.where
        message = f"{until:g} {unit} are {until / dt:.3g} ticks of dt = {dt:g} {unit}"
        message += "; expected one or more" if until < dt else f"; at most {MAX_TICKS:.0e} can run"
        problems.add(where, "run.until", message)
        # One tick: what follows needs a length, and the problem is reported.
        until = dt
    seed = read_seed(run.get("seed"), "run.seed", problems) or 0
    engine = _choice(run, "engine", ENGINES, ENGINES[0], problems)
    states = _choice(run, "states", STATE_CHOICES, STATE_CHOICES[0], problems)
    memory, solver, stop = _memory(run, problems), _solver(run, problems), _stop(run, problems)
    events = _choice(run, "events", EVENT_CHOICES, EVENT_CHOICES[0], problems)
    loops = _choice(run, "loops", LOOPS, LOOPS[0], problems)
    rest = (stop, states, unit, events, loops, _keep(run, unit, problems))
    return RunSection(dt, until, seed, engine, memory, solver, *rest)


def read_seed(node: Node | None, address: str, problems: Problems) -> int | None:
    """The seed of a run, a part or a block; None if there is none, or a wrong one."""
    if node is None:
        return None
    value = node.value
    if isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    message = f"expected a non-negative integer, got {node.describe()}"
    problems.add(node.where, address, message)
    return None


def _choice(
    run: dict[str, Node], key: str, choices: tuple[str, ...], default: str, problems: Problems
) -> str:
    node = run.get(key)
    value = default if node is None else node.value
    if node is not None and value not in choices:
        shown_value = repr(value) if isinstance(value, str) else node.describe()
        text, other = f"there is no {key} {shown_value}", f"; expected {', '.join(choices)}"
        message = misspelt("invalid-value", text, value, choices, other)
        problems.add(node.where, f"run.{key}", message)
        return default
    return str(value)


def _solver(run: dict[str, Node], problems: Problems) -> Solver:
    name = _choice(run, "solver", SOLVERS, Solver.name, problems)
    tolerances = {}
    for key in TOLERANCES:
        if key not in run:
            continue
        node = run[key]
        value = node.value
        # In Python true is an int.
        good = isinstance(value, (int, float)) and not isinstance(value, bool)
        if name not in ADAPTIVE:
            message = f"solver: {name} takes one step per tick; {key} is for dopri5 and rodas4"
            problems.add(node.key, f"run.{key}", message)
        elif not good or not 0.0 < value < math.inf:
            message = f"expected a number above 0, got {node.describe()}"
            problems.add(node.where, f"run.{key}", message)
        else:
            tolerances[key] = float(value)
    return Solver(name, **tolerances)


def _stop(run: dict[str, Node], problems: Problems) -> Stop | None:
    node = run.get("stop")
    if node is None or node.value is None:
        return None
    example = "as in {when: plant.contact, above: 0.5}"
    if not node.is_map:
        problems.add(node.where, "run.stop", f"expected {example[6:]}, got {node.describe()}")
        return None
    check_keys(node, tuple(STOP_DOCS), "run.stop", problems, "key")
    when, kinds = node.get("when"), [kind for kind in STOPS if node.get(kind) is not None]
    if when is None or not isinstance(when.value, str):
        where = node.where if when is None else when.where
        problems.add(where, "run.stop.when", f"expected the address of a number, {example}")
        return None
    # Two levels would need a rule for which of them ends the run.
    if len(kinds) != 1:
        message = f"expected one of {', '.join(STOPS)}, {example}"
        problems.add(node.where, "run.stop", message)
        return None
    level = node.get(kinds[0]) or Node(None)
    if not isinstance(level.value, (int, float)) or not abs(level.value) < math.inf:
        message = f"expected a number, got {level.describe()}"
        problems.add(level.where, f"run.stop.{kinds[0]}", message)
        return None
    known = {"above": "rising", "below": "falling"}
    direction, wanted = known.get(kinds[0], DIRECTIONS[0]), node.get("direction")
    if wanted is not None and kinds[0] in known:
        message = f"'{kinds[0]}' is one direction already; it is for 'crosses'"
        problems.add(wanted.where, "run.stop.direction", message)
    elif wanted is not None and wanted.value not in DIRECTIONS:
        message = f"expected {', '.join(DIRECTIONS)}, got {wanted.describe()}"
        problems.add(wanted.where, "run.stop.direction", message)
    elif wanted is not None:
        direction = wanted.value
    return Stop(when.value, kinds[0], float(level.value), direction, when)


def _keep(run: dict[str, Node], unit: str, problems: Problems) -> float | None:
    node = run.get("keep")
    if node is None or node.value is None:
        return None
    # As --checkpoint 60s has it; nothing is converted.
    try:
        value = parse_scalar(str(node.value).removesuffix(unit).strip())
    except ValueError:  # out of a float's range
        value = math.inf
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < math.inf:
        return float(value)
    message = f"expected a time above 0, as in 60 or 60{unit}: that of the recordings that is kept"
    problems.add(node.where, "run.keep", f"{message}; got {node.describe()}")
    return None


def _memory(run: dict[str, Node], problems: Problems) -> int:
    node = run.get("memory")
    if node is None:
        return DEFAULT_MEMORY
    match = re.fullmatch(r"([1-9][0-9]*)([KMG]?)", str(node.value))
    if match is None or isinstance(node.value, bool):
        message = "expected a size in bytes for recordings, such as 512M or 2G"
        problems.add(node.where, "run.memory", f"{message}, got {node.describe()}")
        return DEFAULT_MEMORY
    return int(match[1]) * UNITS[match[2]]


def seconds(node: Node, address: str, problems: Problems) -> float | None:
    """A positive number of seconds; None, and a problem, for anything else."""
    value = node.value
    if isinstance(value, (int, float)) and not isinstance(value, bool) and 0 < value < math.inf:
        return float(value)
    message = f"expected a number of seconds above 0, got {node.describe()}"
    problems.add(node.where, address, message)
    return None
