"""Differential and difference equations, written as expressions."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from functools import cached_property
from typing import Any, ClassVar

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
    value_type,
    width_of,
    wrong_size,
)


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
            elif name == "when" and got != 1:
                problems.append((name, f"expected a condition, got {got} components"))
            elif name == next(iter(written)) and got != n:
                problems.append(("initial", f"expected {got} number(s), one per state, got {n}"))
            elif name not in ("output", "when") and got != n:
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
        return value_type(self.kind, self._width, rows)

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
    x[0], x[1], ..., or have the names that ``states`` gives. With ``when``, an event: at each tick
    at which that condition holds, the states become the values of ``then``, as when a ball bounces.
    Events are not located between ticks: one acts up to a step late, so ``run.dt`` is its accuracy.
    ``out`` depends on inputs directly only if an expression of ``output`` names u.
    """

    rates: tuple[str, ...] = param(
        name="derivative", doc="the rate of change of each state: ['v', '-k*x + u[0]']"
    )
    when: str | None = param(None, doc="condition of an event: 'x < 0 and v < 0'")
    then: tuple[str, ...] | None = param(
        None, doc="the states after an event, one expression per state"
    )

    x = State("n", name="x", continuous=True, doc="the states")

    def problems(self) -> list[tuple[str, str]]:
        problems = super().problems()
        if (self.when is None) != (self.then is None):
            missing = "then" if self.then is None else "when"
            problems.append((missing, "missing; an event has 'when' and 'then'"))
        return problems

    @property
    def written(self) -> dict[str, tuple[str, ...]]:
        when = (self.when,) if self.when is not None else None
        written = {"derivative": self.rates, "output": self.results, "when": when}
        return {name: texts for name, texts in {**written, "then": self.then}.items() if texts}

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.rates = self.compiled(state, "derivative", self.rates)
        state.has_event = self.when is not None
        state.condition = self.compiled(state, "when", (self.when or "0",), "scalar")
        state.jump = self.compiled(state, "then", self.then or ("0",) * state.n)

    def update(self, state: BlockState, t: float, u: tuple[float, ...]) -> None:
        if state.has_event and self.happens(state, t, u):
            # All values before any is written: each expression sees the states before the event.
            after = state.jump(t, tuple(state.x.tolist()), u, state.constants)
            for i in range(state.n):
                state.x[i] = after[i]

    def happens(self, state: BlockState, t: float, u: tuple[float, ...]) -> bool:
        """Whether the event's condition holds."""
        return bool(state.condition(t, tuple(state.x.tolist()), u, state.constants) != 0.0)

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
