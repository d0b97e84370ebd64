"""Differential and difference equations, written as expressions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from blocks.core import (
    BlockContext,
    BlockState,
    Equations,
    Expressions,
    FloatArray,
    Names,
    Output,
    ParameterError,
    Same,
    SignalType,
    State,
    function_from,
    function_text,
    items,
    param,
    signed_distance,
    value_type,
    width_of,
    wrong_size,
)
from blocks.dynamics.events import Happening, Happenings

SIGNS = {"rising": 1.0, "falling": -1.0, "either": 0.0}


class _System(Equations, ABC):
    """States whose equations are expressions of them, of inputs and of the time."""

    out = Output(Same("T"), doc="the states, or what output says")

    initial: FloatArray = param(shape=[(), (None,)], doc="the states at the start")
    states: Names | None = param(
        None, doc="names of the states: [x, v], or with units: {x: m, v: m/s}"
    )
    results: tuple[str, ...] | None = param(
        None,
        name="output",
        doc="what out is, in states and inputs; default: the states",
    )
    kind: SignalType | None = param(
        None,
        name="signal",
        doc="the output's type, or names and units of its components: {x: m, f: N}",
    )
    arguments: ClassVar[tuple[str, ...]] = ("t", "x", "u", "c")

    @property
    @abstractmethod
    def written(self) -> dict[str, tuple[str, ...]]:
        """The expressions by parameter, those first that say how the states change."""

    def own_names(self) -> dict[str, Any]:
        parts = [f"x[{i}]" for i in range(self.initial.size)]
        return {"x": parts, **(self.states.of(parts) if self.states else {})}

    def sizes(self) -> dict[str, int]:
        return {"n": self.initial.size} if "initial" in self.__dict__ else {}

    def problems(self) -> list[tuple[str, str]]:
        """What is wrong, apart from the expressions."""
        problems = []
        if self.states is not None and self.states.size != self.initial.size:
            got = f"{self.initial.size} name(s), one per state, got {self.states.size}"
            problems.append(("states", f"expected {got}"))
        return problems or self.name_problems({}, self.states or ())

    def validate(self) -> None:
        problems = self.problems()
        if not problems:
            self._check(None)
            if self.results is None and width_of(self.resolved) != self.initial.size:
                problems = [("signal", f"expected a type of {self.initial.size} components")]
        if problems:
            raise ParameterError(problems)

    def validate_in(self, context: BlockContext) -> None:
        self._check(self.input_count(context))

    def _check(self, count: int | None) -> None:
        """Check all expressions with so many components in u; None as far as they are known."""
        n, written = self.initial.size, self.written
        problems = []
        for name, got in self.sizes_of(written, count).items():
            if name == "output" and got != width_of(self.resolved):
                problems.append(("signal", f"expected a type of {got} components"))
            elif name.endswith("when") and got != 1:
                problems.append((name, f"expected a condition, got {got} components"))
            elif name == next(iter(written)) and got != n:
                problems.append(("initial", f"expected {got} number(s), one per state, got {n}"))
            elif not name.endswith(("output", "when")) and got != n:
                problems.append((name, wrong_size(written[name], n, got, "state")))
        if problems:
            raise ParameterError(problems)

    @cached_property
    def _width(self) -> int:
        if self.results is None:
            return self.initial.size
        return self.width("output", self.results)

    @property
    def resolved(self) -> SignalType:
        """The output's type."""
        rows = self.states.rows if self.states and self.results is None else ()
        return value_type(self.kind, self._width, self.results or (), rows)

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    @property
    def indirect(self) -> tuple[str, ...]:
        # By words and not by the tree: this is asked before the inputs are known.
        return () if self.uses_inputs(self.results or ()) else ("u",)

    def start(self, state: BlockState) -> None:
        state.x[:] = self.initial
        state.n = self.initial.size
        state.constants = self.constant_values
        form = self.resolved.form
        if self.results is None:
            # A function in this case, too, so that `output` is one line and compiles the same way.
            own = Expressions((), tuple(f"x[{i}]" for i in range(state.n)), ((state.n,),))
            state.results = function_from(function_text(own, self.arguments, form))
        else:
            state.results = self.compiled(state, "output", self.results, form)

    def compiled(
        self, state: BlockState, parameter: str, texts: Sequence[str], form: Any = "array"
    ) -> Any:
        """A function of (t, x, u, constants)."""
        return self.function(parameter, texts, len(state.context.terms["u"]), form)

    def output(self, state: BlockState, t: float, u: tuple[float, ...] = ()) -> Any:
        return state.results(t, tuple(state.x.tolist()), u, state.constants)


class DynamicSystem(_System):
    """Differential equations with any inputs: a plant, an oscillator, a reaction.

        u ─▶ [ DynamicSystem ] ─▶ out

    x' = derivative(x, u, t), x(0) = initial; out = x, or the expressions of ``output``. States are
    x[0], x[1], ..., or have the names that ``states`` gives. With ``when``, an event: where that
    condition becomes true, the states become the values of ``then``, as when a ball bounces;
    ``events`` lists several. The time is located between ticks; with ``run: {events: ticks}``, an
    event acts at each tick at which its condition holds. ``out`` depends on inputs directly only if
    an expression of ``output`` names u.

    A ball that bounces ever faster ends the run with an error. One that rests below 1 cm/s:
    ``states: [h, v, up]``, ``initial: [1, 0, 1]``, ``derivative: [v, -9.81*up, 0]``,
    ``when: h < 0 and v < 0``, ``then: [0, -0.5*v if v < -0.01 else 0, 1 if v < -0.01 else 0]``.
    """

    notes_conditions = True

    rates: tuple[str, ...] = param(
        name="derivative", doc="the rate of change of each state: ['v', '-k*x + u[0]']"
    )
    when: str | None = param(None, doc="condition of an event: 'x < 0 and v < 0'")
    then: tuple[str, ...] | None = param(
        None, doc="the states after an event, one expression per state"
    )
    happenings: Happenings | None = param(
        None,
        name="events",
        doc="several events: [{when: x < 0, then: [0, -v]}, ...]; each acts as its condition "
        "becomes true, or with 'direction: falling' false, or 'either'",
    )

    x = State("n", name="x", continuous=True, doc="the states")
    was = State("e", name="was", doc="1 where an event's condition held on the last tick, else -1")

    def sizes(self) -> dict[str, int]:
        known = self.__dict__.keys() >= {"initial", "when", "then", "happenings"}
        return {**super().sizes(), **({"e": len(self.list_of_events)} if known else {})}

    @cached_property
    def list_of_events(self) -> tuple[Happening, ...]:
        """All events, in order."""
        first = () if self.when is None else (Happening(self.when, self.then or ()),)
        return (*first, *(() if self.happenings is None else self.happenings.items))

    def problems(self) -> list[tuple[str, str]]:
        problems = super().problems()
        if (self.when is None) != (self.then is None):
            missing = "then" if self.then is None else "when"
            problems.append((missing, "missing; an event has 'when' and 'then'"))
        return problems

    @property
    def written(self) -> dict[str, tuple[str, ...]]:
        written = {"derivative": self.rates, "output": self.results or ()}
        for i, each in enumerate(self.list_of_events, -(self.when is not None)):
            place = "" if i < 0 else f"events.{i}."
            written |= {f"{place}when": (each.when,), f"{place}then": each.then}
        return {name: texts for name, texts in written.items() if texts}

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rates = self.compiled(state, "derivative", self.rates)
        events = self.list_of_events
        state.events = len(events)
        state.directions = np.array([SIGNS[each.direction] for each in events])
        state.was[...] = math.nan
        try:
            texts = [signed_distance(each.when) for each in events] or ["0"]
            state.distances = self.compiled(state, "when", texts)
        except ParameterError:  # what is written out is too long; the condition itself is not
            texts = [f"1 if {each.when} else -1" for each in events]
            state.distances = self.compiled(state, "when", texts)
        # One function for all events, of which ``which`` is the number.
        after = [text for each in events for text in items("then", each.then)]
        count = len(state.context.terms["u"])
        read = self.read(after or [("then", "0")] * state.n, count)
        values = read.values[-state.n :]
        for k in range(len(events) - 2, -1, -1):
            own = read.values[k * state.n : (k + 1) * state.n]
            pairs = zip(own, values, strict=True)
            values = tuple(f"({text}) if which < {k + 0.5} else ({rest})" for text, rest in pairs)
        read = Expressions(read.lines, values, ((state.n,),))
        state.jump = function_from(function_text(read, (*self.arguments, "which"), "array"))

    def crossings(self, context: BlockContext) -> list[str]:
        return [each.direction for each in self.list_of_events]

    def guards(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        distances: FloatArray = state.distances(t, tuple(state.x.tolist()), u, state.constants)
        return distances

    def event(self, state: BlockState, t: float, which: float, u: tuple[float, ...]) -> None:
        # All values before any is written: each expression sees the states before the event.
        after = state.jump(t, tuple(state.x.tolist()), u, state.constants, which)
        for i in range(state.n):
            state.x[i] = after[i]

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        for k in range(state.events):
            distances = state.distances(t, tuple(state.x.tolist()), u, state.constants)
            now = 1.0 if distances[k] > 0.0 else -1.0
            changes = now * state.was[k] < 0.0
            if (now > 0.0 and state.directions[k] > 0.0) or (
                changes and now * state.directions[k] >= 0.0
            ):
                self.event(state, t, float(k), u)
            state.was[k] = now

    @property
    def state_names(self) -> dict[str, tuple[str, ...]]:
        return {"x": tuple(name for name, _ in self.states.rows)} if self.states else {}

    def couplings(self, context: BlockContext) -> list[set[int]]:
        read = self.read(items("derivative", self.rates), self.input_count(context))
        return read.couplings("x", self.initial.size)

    def derivative(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        rates: FloatArray = state.rates(t, tuple(state.x.tolist()), u, state.constants)
        return rates


class DiscreteSystem(_System):
    """Difference equations with any inputs: logic with memory, a counter, a filter, a map.

        u ─▶ [ DiscreteSystem ] ─▶ out

    x(t_k+1) = next(x, u, t_k), x(0) = initial; out(t_k) = x(t_k), or the expressions of ``output``.
    States are x[0], x[1], ..., or have the names that ``states`` gives; all are updated at once.
    ``out`` depends on inputs directly only if an expression of ``output`` names u.
    """

    following: tuple[str, ...] = param(
        name="next", doc="each state one step later: ['x + u[0]', '0.5*v if x > 1 else v']"
    )

    x = State("n", name="x", doc="the states")

    @property
    def written(self) -> dict[str, tuple[str, ...]]:
        return {"next": self.following} | ({"output": self.results} if self.results else {})

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.following = self.compiled(state, "next", self.following)

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        after = state.following(t, tuple(state.x.tolist()), u, state.constants)
        for i in range(state.n):
            state.x[i] = after[i]
