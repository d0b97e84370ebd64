"""A kernel replaces only the method it was written for: subclasses under both engines."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks import Block
from blocks.core.kernels import MARK, kernel_for, kernel_of
from runtime.compiler.fields import NotCompilableError
from tests.runtime.engine.test_compiled_blocks import CASES, Case, Run, TextRun, check_equal

# Methods that describe a block before a run and are not called in a tick.
DESCRIBING = {"validate", "validate_in", "sizes"}
TICKS = 6


def halved(value: Any) -> Any:
    """A result with every float in it halved."""
    if isinstance(value, tuple):
        return tuple(halved(part) for part in value)
    if isinstance(value, float) or (isinstance(value, np.ndarray) and value.dtype.kind == "f"):
        return 0.5 * value
    return value


def changed(cls: type[Block], name: str) -> type[Block]:
    """A subclass whose method of this name returns half of its result."""
    original = inspect.getattr_static(cls, name)

    @functools.wraps(original)
    def method(self: Block, *arguments: Any) -> Any:
        result = original(self, *arguments)
        state = arguments[0] if arguments else None
        if result is None and isinstance(state, blocks.BlockState):
            for declared in self.spec.states:
                getattr(state, declared)[...] *= 0.5
        return halved(result)

    del method.__dict__["__wrapped__"]
    method.__signature__ = inspect.signature(original)  # type: ignore[attr-defined]
    return type(cls.__name__, (cls,), {"__doc__": cls.__doc__, name: method})


def methods(cls: type[Block]) -> Iterator[str]:
    """All methods of a built-in block that its ticks call, except kernels."""
    for name in dir(cls):
        value = inspect.getattr_static(cls, name)
        works = inspect.isfunction(value) and not name.startswith("__") and name not in DESCRIBING
        own = name == "start" or name not in vars(Block)
        if works and own and not hasattr(value, MARK):
            yield name


OVERRIDES = [(name, method) for name in CASES for method in methods(type(CASES[name][0].block))]


def overridden() -> Iterator[Any]:
    """Each override of the first two cases of a block, of the second in the slow run."""
    for name, method in OVERRIDES:
        for i, case in enumerate(CASES[name][:2]):
            marks = [pytest.mark.slow] if i else []
            yield pytest.param(case, method, id=f"{name}-{method}", marks=marks)


@pytest.mark.parametrize(("case", "method"), list(overridden()))
def test_a_subclass_that_overrides_a_method_is_the_same_under_both_engines(
    case: Case, method: str
) -> None:
    cls = changed(type(case.block), method)
    other = replace(case, block=cls(**case.block.parameters()))
    with suppress(NotCompilableError):  # called from Python, which is the other engine
        check_equal(other, TextRun, 0, TICKS)


def trace(case: Case) -> list[Any]:
    run, draw = Run(case, 0), np.random.default_rng(0)
    found = []
    for k in range(TICKS):
        inputs = run.bench._inputs(draw)
        inputs.update({name: make(draw) for name, make in case.inputs.items()})
        found.append({key: np.array(v) for key, v in run.tick(k * case.dt, inputs).items()})
    return found


@pytest.mark.parametrize(
    ("name", "method"),
    # A Decoder whose weights are given, as in its case, does not solve for them.
    [
        (n, m)
        for n, m in OVERRIDES
        if m in ("update", "_draw", "_respond", "solve") and (n, m) != ("Decoder", "solve")
    ],
)
def test_these_overrides_change_the_numbers(name: str, method: str) -> None:
    """Otherwise the test above would compare nothing."""
    case = CASES[name][0]
    cls = changed(type(case.block), method)
    a, b = trace(case), trace(replace(case, block=cls(**case.block.parameters())))
    assert any(not np.array_equal(x[k], y[k]) for x, y in zip(a, b, strict=True) for k in x)


class OwnRule(blocks.AdaptiveBias):  # type: ignore[misc]  # own rules on final blocks are common
    """Learns from the error's sign."""

    def update(self, state, t, error, learn):
        for i in range(len(error)):
            state.bias[i] -= 0.01 * learn * np.sign(error[i])


class OwnDraw(blocks.PoseNoise):
    """Noise that is the same in all components."""

    def _draw(self, state):
        drawn = state.rng.standard_normal()
        for i in range(3):
            state.noise[i] = self.sigma_position * drawn


class OwnStart(blocks.ActuatorLag):
    """A lag that is half as fast."""

    def start(self, state):
        super().start(state)
        state.share *= 0.5


def test_own_methods_run_under_the_compiled_engine_and_compile() -> None:
    graph = runtime.Graph("own", dt=0.01, until=1.0, seed=3)
    graph = graph.add("command", blocks.Constant(value=[0.4, 0.3], signal="Twist"))
    graph = graph.add("lag", OwnStart(tau=0.1)).connect("command.value", "lag.command")
    graph = graph.add("plant", blocks.DifferentialDrive()).connect("lag.actual", "plant.command")
    graph = graph.add("noise", OwnDraw()).connect("plant.pose", "noise.pose")
    graph = graph.add("rule", OwnRule())
    graph = graph.connect("noise.measured.y", "rule.input").connect(
        "noise.measured.y", "rule.error"
    )
    graph = graph.probe("rule.output").probe("noise.measured").probe("lag.actual")
    found = graph.run(engine="compiled")
    expected = graph.run(engine="python")
    for name, recorded in expected.probes.items():
        np.testing.assert_allclose(found.probes[name].values, recorded.values, 1e-12, 1e-12)
    # The rule changes only by steps of 0.01; the lag ends at half its exponent.
    np.testing.assert_allclose(
        np.abs(np.diff(found["rule.output"].ravel())), 0.01, rtol=1e-9, atol=0.0
    )
    share = 0.5 * -np.expm1(-0.01 / 0.1)
    left = 0.4 * (1.0 - (1.0 - share) ** 99)
    assert found["lag.actual"][-1, 0] == pytest.approx(left, rel=1e-9)


class Base:
    """Methods with kernels, and helpers that one or both of them use."""

    FACTOR = 2.0

    def start(self, state):
        state.table = self._table()

    def _table(self):
        return [1.0]

    def shared(self):
        return 1.0

    def spelled(self):
        return 2.0

    def update(self, state, t, x):
        state.m[0] = self.shared() * self.spelled() * x

    @kernel_of(update)
    def _update_kernel(self, state, t, x):
        state.m[0] = self.shared() * 2.0 * x

    def output(self, state, t):
        return self.FACTOR * state.m[0]

    @kernel_of(output)
    def _output_kernel(self, state, t):
        return self.FACTOR * state.table[0]


KEPT = ("m", "table", "dt")
BOUND: list[tuple[dict[str, Any], bool, bool]] = [
    ({}, True, True),
    ({"shared": lambda self: 5.0}, True, True),
    ({"FACTOR": 7.0}, True, True),
    ({"spelled": lambda self: 5.0}, False, True),
    ({"start": lambda self, state: None}, True, False),
    ({"_table": lambda self: [3.0]}, True, False),
    ({"_update_kernel": lambda self, state, t, x: None}, False, True),
]


@pytest.mark.parametrize(("members", "update", "output"), BOUND)
def test_a_kernel_is_used_while_the_methods_it_replaces_are_unchanged(
    members: dict[str, Any], update: bool, output: bool
) -> None:
    cls: Any = type("Derived", (Base,), members)
    if "_update_kernel" in members:
        # The subclass replaced only the kernel's name; the method is unchanged.
        assert kernel_for(cls, cls.update, KEPT) is Base._update_kernel
        return
    assert (kernel_for(cls, cls.update, KEPT) is not None) is update
    assert (kernel_for(cls, cls.output, KEPT) is not None) is output


def test_an_own_method_has_no_kernel_until_it_declares_one() -> None:
    class Own(Base):
        def update(self, state, t, x):
            state.m[0] = x

    class Declared(Own):
        @kernel_of(Own.update)
        def _fast(self, state, t, x):
            state.m[0] = x

    update: Callable[..., Any] = Own.update
    assert kernel_for(Own, update, KEPT) is None
    assert kernel_for(Declared, update, KEPT) is Declared._fast


def test_a_kernel_has_the_parameters_of_its_method() -> None:
    def update(self, state, t, error, learn):
        pass

    with pytest.raises(TypeError, match=r"same parameters \(self, state, t, error, learn\)"):

        @kernel_of(update)
        def kernel(self, state, t, learn, error):
            pass


class FailsInUpdate(blocks.ActuatorLag):
    """Divides by the time left of 40 ms."""

    def update(self, state, t, command):
        state.reached[0] = 1.0 / (round(100.0 * t) - 4)


class FailsInOutput(blocks.ActuatorLag):
    """Returns a logarithm that is undefined from 50 ms on."""

    def output(self, state, t):
        return np.nan if t > 0.045 else 1.0, 0.0


class FailsInHelper(blocks.PoseNoise):
    """Raises at its third draw."""

    def _draw(self, state):
        state.noise[0] += 1.0
        if state.noise[0] > 2.5:
            raise ValueError("no more noise")


FAILURES = [
    (FailsInUpdate(tau=0.1), "command", "Twist", [0.4, 0.3], 4),
    (FailsInOutput(tau=0.1), "command", "Twist", [0.4, 0.3], 5),
    (FailsInHelper(), "pose", "Pose", [0.0, 0.0, 0.0], 1),
]


@pytest.mark.parametrize(("block", "port", "kind", "value", "tick"), FAILURES)
def test_failures_of_subclasses_have_the_same_location(
    block: Block, port: str, kind: str, value: list[float], tick: int
) -> None:
    graph = runtime.Graph("fails", dt=0.01, until=0.2)
    graph = graph.add("source", blocks.Constant(value=value, signal=kind)).add("bad", block)
    graph = graph.connect("source.value", f"bad.{port}").probe(
        "out", f"bad.{next(iter(block.spec.outputs))}"
    )
    kept = []
    for engine in ("python", "compiled"):
        with pytest.raises(runtime.SimulationError) as caught:
            graph.run(engine=engine)
        assert (caught.value.block, caught.value.tick) == ("bad", tick)
        assert str(caught.value).startswith(f"block 'bad' at tick {tick} (t = 0.0{tick} s): ")
        kept.append(caught.value.result["out"])
    np.testing.assert_array_equal(kept[0], kept[1])
