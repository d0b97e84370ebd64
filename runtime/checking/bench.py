"""A test bench that runs one block tick by tick and records what each of its methods does."""

from __future__ import annotations

import functools
import inspect
import types
from collections import deque
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import numpy as np

from blocks.core import Block, BlockContext, BlockState, Evaluation, FloatArray, SignalType
from runtime.errors import NotCopiedError, raised_text
from runtime.memory import Record, SharedPlaces

OUTSIDE = "draw random numbers from state.rng, and keep what changes in a State of the class"


class CheckError(Exception):
    """A block breaks a rule; the message names the class, the method and a suggested fix."""


@dataclass
class Bench:
    """Runs a block tick by tick, as an engine would, and checks what each call does."""

    block: Block
    context: BlockContext
    ticks: int
    open_inputs: bool = False
    attributes: dict[str, Any] = field(default_factory=dict)

    def run(
        self, seed: int, stream: int = 0, careful: bool = False, resumed: bool = False
    ) -> Iterator[dict[str, Any]]:
        """Snapshots of the outputs and the declared states of each tick.

        ``stream`` selects the random inputs; ``careful`` calls each output several times to detect
        side effects; ``resumed`` continues each tick with a new state that received the declared
        arrays and the generator of the old one, as from a checkpoint.
        """
        spec, block = self.block.spec, self.block
        draw = np.random.default_rng(stream)
        self.attributes = attributes(block)
        state = self.started(seed)
        started = {name: getattr(state, name).copy() for name in spec.states}
        constant: dict[str, Any] = {}
        for k in range(self.ticks):
            t = k * self.context.dt
            values = self._inputs(draw)
            for evaluation in spec.evaluations:
                if careful:
                    self._try(evaluation, state, started, t, values)
                out = self._split(evaluation, self._call(evaluation, state, t, values))
                values.update(zip(evaluation.outputs, out, strict=True))
            seen = {f"output '{port}'": snapshot(values[port]) for port in spec.outputs}
            for port, declared in spec.outputs.items():
                item = f"output '{port}'"
                if declared.constant and constant.setdefault(port, seen[item]) != seen[item]:
                    self._fail("", f"{item} is declared constant but changes")
            states = {f"state '{name}'": snapshot(getattr(state, name)) for name in spec.states}
            yield {**seen, **states}
            if spec.update is not None:
                self._update(spec.update, state, t, values)
            if spec.derivative is not None:
                self._integrate(spec.derivative, state, t, values)
            if resumed:
                state = self._resumed(state, seed)

    def started(self, seed: int = 0) -> BlockState:
        """A state after ``start``."""
        state = self._state(seed)
        self._guard("start", functools.partial(self.block.start, state))
        return state

    def not_copied(self) -> str:
        """What the block keeps beside its declared states and cannot be copied; '' if all can."""
        state = self.started()
        outer = {id(each): each for each in (self.block, state, state.context, state.context.world)}
        record = Record(outer, np.zeros(0))
        places = SharedPlaces(frozenset((type(self.block).__module__.partition(".")[0],)))
        try:
            for name, value in vars(state).items():
                if name not in ("context", "published"):
                    record.add(value, f"state.{name}")
            for place in places.of(type(self.block)):
                record.add(place.value, place.label, shared=True)
        except NotCopiedError as error:
            return str(error)
        return ""

    def _resumed(self, old: BlockState, seed: int) -> BlockState:
        state = self.started(seed)
        for name in self.block.spec.states:
            getattr(state, name)[...] = getattr(old, name)
        state.rng.bit_generator.state = old.rng.bit_generator.state
        return state

    def _state(self, seed: int) -> BlockState:
        """The state as an engine makes it: zeros in the declared shapes."""
        context, spec = self.context, self.block.spec
        lengths = {**context.lengths, **self.block.sizes_in(context)}
        for name, port in spec.ports.items():
            if isinstance(port.type, SignalType) and port.type.symbol:
                lengths[port.type.symbol] = context.types[name].shape[0]
        arrays = {
            name: np.zeros(
                (
                    *(n if isinstance(n, int) else lengths[n] for n in declared.shape),
                    *(context.types[declared.like].shape if declared.like else ()),
                )
            )
            for name, declared in spec.states.items()
        }
        if self.open_inputs:
            context = self.open_context
        state = BlockState(context, np.random.SeedSequence(seed), arrays)
        _ = state.rng  # created on first use, which must not count as a change
        return state

    @property
    def open_context(self) -> BlockContext:
        """The context in which no signal is wired to inputs of any number of signals."""
        none = {name: (False,) * len(flags) for name, flags in self.context.terms.items()}
        return replace(self.context, terms=none)

    def _inputs(self, draw: np.random.Generator) -> dict[str, Any]:
        values: dict[str, Any] = {}
        for name, port in self.block.spec.inputs.items():
            kind, flags = self.context.types[name], self.context.terms.get(name, ())
            if self.open_inputs and port.optional:
                values[name] = (
                    () if port.variadic or port.default is None else kind.filled(port.default)
                )
            elif port.variadic:
                values[name] = tuple(random_value(kind, draw, self.context.dt) for _ in flags)
            else:
                values[name] = random_value(kind, draw, self.context.dt)
        return values

    def _try(
        self,
        evaluation: Evaluation,
        state: BlockState,
        started: Mapping[str, FloatArray],
        t: float,
        values: dict[str, Any],
    ) -> None:
        """Call an output more often than a run does, and check for side effects."""
        method, states = evaluation.method, self.block.spec.states
        cached = [name for name, declared in states.items() if declared.cached]
        before, given = contents(state), contents(values)
        out = self._call(evaluation, state, t, values)
        for port, value in zip(evaluation.outputs, self._split(evaluation, out), strict=True):
            self._check_form(method, port, value, state)
        for name in changed(before, contents(state)):
            if name == "rng":
                self._fail(method, "draws from state.rng; draw in start and update, into a State")
            if name not in cached:
                suggestion = "only update writes into the state (a State with cached=True excepted)"
                self._fail(method, f"changes state '{name}'; {suggestion}")
        self._check_given(method, given, values)
        first = snapshot(out)
        if first != snapshot(self._call(evaluation, state, t, values)):
            message = "returns different values when called again with the same state and inputs"
            self._fail(method, f"{message}; {OUTSIDE}")
        kept = {name: getattr(state, name).copy() for name in cached}
        for source in (started, kept):
            for name in cached:
                getattr(state, name)[...] = source[name]
            if first != snapshot(self._call(evaluation, state, t, values)):
                message = (
                    f"its result depends on the content of a cached state ({', '.join(cached)})"
                )
                self._fail(method, message)

    def _update(
        self, update: Evaluation, state: BlockState, t: float, values: dict[str, Any]
    ) -> None:
        given = contents(values)
        if self._call(update, state, t, values) is not None:
            self._fail("update", "returns a value, which is not used; write into the state")
        self._check_given("update", given, values)

    def _integrate(
        self, derivative: Evaluation, state: BlockState, t: float, values: dict[str, Any]
    ) -> None:
        """One step of Euler's method; ``derivative`` is called twice to detect side effects."""
        names = self.block.spec.continuous
        before, given = contents(state), contents(values)
        first, again = (self._call(derivative, state, t, values) for _ in range(2))
        for name in changed(before, contents(state)):
            self._fail(
                "derivative", f"changes '{name}' of the state; it returns the rate of change"
            )
        self._check_given("derivative", given, values)
        if snapshot(first) != snapshot(again):
            message = "returns different values when called again with the same state and inputs"
            self._fail("derivative", f"{message}; {OUTSIDE}")
        rates = (first,) if len(names) == 1 else first
        if not isinstance(rates, tuple) or len(rates) != len(names):
            message = f"must return a tuple, one value per continuous state ({', '.join(names)})"
            self._fail("derivative", f"{message}, got {brief(first)}")
        for name, rate in zip(names, rates, strict=True):
            message = misfit(getattr(state, name).shape, rate)
            if message:
                self._fail("derivative", f"state '{name}': {message}")
            getattr(state, name)[...] += self.context.dt * np.asarray(rate, dtype=np.float64)
        if self.block.spec.projects:
            self._guard("project", functools.partial(self.block.project, state))  # type: ignore[attr-defined]

    def _call(
        self, evaluation: Evaluation, state: BlockState, t: float, values: dict[str, Any]
    ) -> Any:
        method = getattr(self.block, evaluation.method)
        arguments = [values[port] for port in evaluation.needs]
        return self._guard(evaluation.method, functools.partial(method, state, t, *arguments))

    def _guard(self, method: str, call: Callable[[], Any]) -> Any:
        """Call, and check that the block itself does not change."""
        try:
            result = call()
        except BaseException as error:
            where = f"{type(self.block).__name__}.{method}"
            raise CheckError(f"{where}: {raised_text(error, with_place=False)}") from error
        now = attributes(self.block)
        for name in changed(self.attributes, now):
            lazy = inspect.getattr_static(type(self.block), name, None)
            if name in self.attributes or not isinstance(lazy, functools.cached_property):
                message = f"changes the block's attribute '{name}'"
                self._fail(method, f"{message}; a block is immutable; keep what changes in a State")
        self.attributes = now
        return result

    def _split(self, evaluation: Evaluation, out: Any) -> tuple[Any, ...]:
        ports = evaluation.outputs
        if len(ports) == 1:
            return (out,)
        if not isinstance(out, tuple) or len(out) != len(ports):
            message = f"must return a tuple of its {len(ports)} outputs ({', '.join(ports)})"
            self._fail(evaluation.method, f"{message}, got {brief(out)}")
        return out

    def _check_form(self, method: str, port: str, value: Any, state: BlockState) -> None:
        kind = self.context.types[port]
        if not kind.holds(value):
            self._fail(method, f"output '{port}' must be {kind.held_as}, got {brief(value)}")
        for name in self.block.spec.states:
            if isinstance(value, np.ndarray) and np.shares_memory(value, getattr(state, name)):
                message = f"output '{port}' shares the memory of state '{name}'"
                self._fail(method, f"{message}, which update overwrites; return a copy")

    def _check_given(
        self, method: str, given: Mapping[str, Any], values: Mapping[str, Any]
    ) -> None:
        for name in changed(given, contents(values)):
            self._fail(method, f"changes its argument '{name}' in place; copy it first")

    def _fail(self, method: str, message: str) -> NoReturn:
        where = type(self.block).__name__ + (f".{method}" if method else "")
        raise CheckError(f"{where}: {message}")


def misfit(shape: tuple[int, ...], rate: Any) -> str:
    """Why a value is not the rate of change of a state of a shape; '' if it is."""
    expected = f"an array of shape {shape}" if shape else "a float"
    expected += f" or a tuple of {shape[0]} floats" if len(shape) == 1 else ""
    try:
        numbers = np.asarray(rate)
    except ValueError:
        return f"expected {expected}, got {brief(rate)}"
    if numbers.dtype.kind not in "fiu" or numbers.shape != shape:
        return f"expected {expected}, got {brief(rate)}"
    return "" if np.isfinite(numbers).all() else f"its rate of change is not finite: {brief(rate)}"


def contents(values: Any) -> dict[str, Any]:
    """Snapshots of the values of a mapping or of an object's attributes, by name."""
    held = values if isinstance(values, dict) else vars(values)
    return {name: snapshot(value) for name, value in held.items()}


def changed(before: Mapping[str, Any], after: Mapping[str, Any]) -> list[str]:
    """Names whose value is new or different."""
    return [name for name, value in after.items() if name not in before or before[name] != value]


def attributes(block: Block) -> dict[str, Any]:
    """Snapshots of everything a block could store data in: its attributes and its class's."""
    containers = (list, dict, set, deque, bytearray, np.ndarray)
    classes = type(block).__mro__[: type(block).__mro__.index(Block)]
    shared = {
        name: value
        for cls in reversed(classes)
        for name, value in vars(cls).items()
        if isinstance(value, containers) and not name.startswith("__")
    }
    return contents({**shared, **vars(block)})


def brief(value: Any) -> str:
    """A value and its type, shortened."""
    if isinstance(value, np.ndarray):
        return f"an array of {value.dtype} of shape {value.shape}"
    text = repr(value)
    return f"{text if len(text) < 60 else text[:57] + '...'} ({type(value).__name__})"


def random_value(kind: SignalType, draw: np.random.Generator, dt: float) -> Any:
    """A random value of a signal type, in the form in which a wire carries it."""
    if kind.name == "Path":
        kappa = draw.standard_normal()
        theta = draw.uniform(-np.pi, np.pi) + 0.1 * kappa * np.arange(kind.shape[0])
        steps = 0.1 * np.column_stack((np.cos(theta), np.sin(theta)))
        return np.column_stack((np.cumsum(steps, axis=0), theta, np.full(len(theta), kappa)))
    if kind.name == "Spikes":
        return draw.integers(0, 2, kind.shape) / dt
    if kind.name == "Scan":
        return draw.uniform(0.1, 5.0, kind.shape)
    return kind.pack(draw.standard_normal(kind.shape))


_BY_IDENTITY = (
    type,
    types.ModuleType,
    types.FunctionType,
    types.BuiltinFunctionType,
    types.MethodType,
    functools.partial,
)
_LEAVES = {float, int, bool, str, bytes, complex, type(None)}  # whose repr tells all bits


def snapshot(value: Any, seen: frozenset[int] = frozenset()) -> Hashable:
    """A record that is equal exactly when two values hold the same bits in the same structure.

    Arrays, numbers, containers and generators are recorded by content, other objects by their
    attributes; functions, classes and modules by identity. NaN equals NaN.
    """
    cls = type(value)
    if cls in _LEAVES:  # most of all calls, with 0.0 unlike -0.0, and 1 unlike True
        return cls, repr(value)
    if id(value) in seen:
        return "a cycle"
    kind = cls.__name__
    if isinstance(value, np.ndarray):
        return kind, value.dtype.str, value.shape, value.tobytes()
    if cls in (list, tuple) and {*map(type, value)} <= _LEAVES:
        return kind, repr(value)
    inside = seen | {id(value)}
    if isinstance(value, float):
        return kind, value.hex()
    if isinstance(value, (int, complex, str, bytes)):
        return kind, value
    if isinstance(value, bytearray):
        return kind, bytes(value)
    if isinstance(value, np.generic):
        return kind, value.tobytes()
    if isinstance(value, _BY_IDENTITY):
        return kind, id(value)
    if isinstance(value, np.random.Generator):
        return kind, snapshot(value.bit_generator.state, inside)
    if isinstance(value, np.random.RandomState):
        return kind, snapshot(value.get_state(legacy=False), inside)
    if isinstance(value, np.random.SeedSequence):
        return kind, snapshot(value.state, inside)
    if isinstance(value, Mapping):
        return kind, tuple((repr(key), snapshot(item, inside)) for key, item in value.items())
    if isinstance(value, (list, tuple, deque)):
        return kind, tuple(snapshot(item, inside) for item in value)
    if isinstance(value, (set, frozenset)):
        return kind, tuple(sorted(repr(item) for item in value))
    if hasattr(value, "__dict__"):
        return kind, snapshot(vars(value), inside)
    return kind, repr(value)
