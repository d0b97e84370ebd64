"""Differential and difference equations, written as expressions."""

from __future__ import annotations

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    Expression,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    State,
    Vector,
    function_from,
    function_text,
    param,
    signed_distance,
)
from blocks.dynamics.equations import PARAMETERS, Equations, input_count
from blocks.dynamics.events import Happening, Happenings

SIGNS = {"rising": 1.0, "falling": -1.0, "either": 0.0}


class _System(Block, ABC):
    """States whose equations are expressions of them, of inputs and of the time."""

    inputs = Input(
        Scalar,
        variadic=True,
        spread="inputs",
        name="u",
        doc="any signals; their components in order are u[0], u[1], ...",
    )
    out = Output(Same("T"), doc="the states, or what output says")

    initial: FloatArray = param(shape=[(), (None,)], doc="the states at the start")
    states: tuple[str, ...] | None = param(None, doc="names of the states: [x, v]")
    constants: Mapping[str, float] | None = param(
        None, doc="names that the expressions use, with their values: {k: 2.5}"
    )
    results: tuple[str, ...] | None = param(
        None,
        name="output",
        doc="what out is, in states and inputs; default: the states",
    )
    kind: SignalType | None = param(
        None, name="signal", doc="the output's type; default Scalar, or Vector for several values"
    )

    @property
    @abstractmethod
    def changes(self) -> tuple[str, ...]:
        """One expression per state, for how it changes."""

    @property
    @abstractmethod
    def written(self) -> list[tuple[str, str]]:
        """All expressions, each with its parameter."""

    def problems(self) -> list[tuple[str, str]]:
        """What is wrong, apart from the expressions."""
        problems = []
        count = len(self.changes)
        if self.initial.size != count:
            message = f"expected {count} number(s), one per state, got {self.initial.size}"
            problems.append(("initial", message))
        problems += self.equations.problems()
        if self.resolved.symbol or self.resolved.shape != (
            () if self.width == 1 else (self.width,)
        ):
            problems.append(("signal", f"expected a type of {self.width} components"))
        return problems

    def validate(self) -> None:
        problems = self.problems()
        if problems:
            raise ParameterError(problems)
        self.equations.check(self.written)

    def validate_in(self, context: BlockContext) -> None:
        self.equations.check(self.written, input_count(context))

    @property
    def equations(self) -> Equations:
        return Equations(len(self.changes), self.states or (), self.constants or {})

    @property
    def width(self) -> int:
        return len(self.changes if self.results is None else self.results)

    @cached_property
    def resolved(self) -> SignalType:
        """The output's type."""
        kind = self.kind or (Scalar if self.width == 1 else Vector(self.width))
        return kind.sized(self.width) if kind.symbol else kind

    @property
    def variables(self) -> dict[str, SignalType]:
        return {"T": self.resolved}

    @property
    def indirect(self) -> tuple[str, ...]:
        # By the word u and not by the tree: this is asked before the inputs are known.
        named = any(re.search(r"\bu\b", text) for text in self.results or ())
        return () if named else ("u",)

    def start(self, state: BlockState) -> None:
        state.x[:] = self.initial
        state.n = len(self.changes)
        state.constants = self.equations.values
        form = self.resolved.form
        if self.results is None:
            own = [Expression("", f"x[{i}]", frozenset()) for i in range(state.n)]
            # A function in this case, too, so that `output` is one line and compiles the same way.
            state.results = function_from(function_text(own, PARAMETERS, form))
        else:
            state.results = self.function(state, "output", self.results, form)

    def function(
        self, state: BlockState, parameter: str, texts: tuple[str, ...], form: Any = "array"
    ) -> Any:
        """A function of (t, x, u, constants)."""
        count = len(state.context.terms["u"])
        return self.equations.function(parameter, texts, count, form)

    def output(self, state: BlockState, t: float, u: tuple[float, ...] = ()) -> Any:
        return state.results(t, state.x.tolist(), u, state.constants)


class DynamicSystem(_System):
    """Differential equations with any inputs: a plant, an oscillator, a reaction.

        u ─▶ [ DynamicSystem ] ─▶ out

    x' = derivative(x, u, t), x(0) = initial; out = x, or the expressions of ``output``. States are
    x[0], x[1], ..., or have the names that ``states`` gives. With ``when``, an event: where that
    condition becomes true, the states become the values of ``then``, as when a ball bounces;
    ``events`` lists several. The time is located between ticks; with ``run: {events: ticks}``, an
    event acts at each tick at which its condition holds. ``out`` depends on inputs directly only if
    an expression of ``output`` names u.
    """

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
        known = self.__dict__.keys() >= {"rates", "when", "then", "happenings"}
        return {"n": len(self.rates), "e": len(self.list_of_events)} if known else {}

    @property
    def changes(self) -> tuple[str, ...]:
        return self.rates

    @property
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
        for i, each in enumerate(self.list_of_events, -(self.when is not None)):
            if len(each.then) != len(self.rates):
                count = len(self.rates)
                message = f"expected {count} expression(s), one per state, got {len(each.then)}"
                problems.append(("then" if i < 0 else f"events.{i}.then", message))
        return problems

    @property
    def written(self) -> list[tuple[str, str]]:
        expressions = [("derivative", text) for text in self.rates]
        expressions += [("output", text) for text in self.results or ()]
        for i, each in enumerate(self.list_of_events, -(self.when is not None)):
            place = "" if i < 0 else f"events.{i}."
            expressions.append((f"{place}when", each.when))
            expressions += [(f"{place}then", text) for text in each.then]
        return expressions

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rates = self.function(state, "derivative", self.rates)
        events, count = self.list_of_events, len(state.context.terms["u"])
        state.events = len(events)
        state.directions = np.array([SIGNS[each.direction] for each in events])
        distances = [signed_distance(each.when) for each in events] or ["0"]
        try:
            state.distances = self.function(state, "when", tuple(distances))
        except ParameterError:  # what is written out is too long; the condition itself is not
            texts = [f"1 if {each.when} else -1" for each in events]
            state.distances = self.function(state, "when", tuple(texts))
        state.was[...] = math.nan
        # One function for all events, of which ``which`` is the number.
        after = []
        for i in range(state.n):
            texts = [
                self.equations.read("then", each.then[i], count).python for each in events
            ] or ["0.0"]
            choice = texts[-1]
            for k in range(len(texts) - 2, -1, -1):
                choice = f"({texts[k]}) if which < {k + 0.5} else ({choice})"
            after.append(Expression("", choice, frozenset()))
        state.jump = function_from(function_text(after, (*PARAMETERS, "which"), "array"))

    def crossings(self, context: BlockContext) -> list[str]:
        return [each.direction for each in self.list_of_events]

    def guards(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        distances: FloatArray = state.distances(t, state.x.tolist(), u, state.constants)
        return distances

    def event(self, state: BlockState, t: float, which: float, u: tuple[float, ...]) -> None:
        # All values before any is written: each expression sees the states before the event.
        after = state.jump(t, state.x.tolist(), u, state.constants, which)
        for i in range(state.n):
            state.x[i] = after[i]

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        for k in range(state.events):
            distances = state.distances(t, state.x.tolist(), u, state.constants)
            now = 1.0 if distances[k] > 0.0 else -1.0
            changes = now * state.was[k] < 0.0
            if (now > 0.0 and state.directions[k] > 0.0) or (
                changes and now * state.directions[k] >= 0.0
            ):
                self.event(state, t, float(k), u)
            state.was[k] = now

    def couplings(self, context: BlockContext) -> list[set[int]]:
        count = input_count(context)
        read = [self.equations.read("derivative", text, count) for text in self.rates]
        # Names of states and indices are x[0], x[1], ... in the Python text, sums are written out.
        return [set(map(int, re.findall(r"\bx\[(\d+)\]", each.python))) for each in read]

    def derivative(self, state: BlockState, t: float, u: tuple[float, ...]) -> FloatArray:
        rates: FloatArray = state.rates(t, state.x.tolist(), u, state.constants)
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

    def sizes(self) -> dict[str, int]:
        return {"n": len(self.following)} if "following" in self.__dict__ else {}

    @property
    def changes(self) -> tuple[str, ...]:
        return self.following

    @property
    def written(self) -> list[tuple[str, str]]:
        expressions = [("next", text) for text in self.following]
        return expressions + [("output", text) for text in self.results or ()]

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.following = self.function(state, "next", self.following)

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        after = state.following(t, state.x.tolist(), u, state.constants)
        for i in range(state.n):
            state.x[i] = after[i]
