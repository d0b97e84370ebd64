"""Declarations: what a class body says is read, and what contradicts itself is refused."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

import blocks
from blocks import (
    Block,
    DeclarationError,
    FloatArray,
    Input,
    Output,
    Pose,
    Same,
    Scalar,
    State,
    Twist,
    Vector,
    param,
)
from blocks.core.declarations import Evaluation

if TYPE_CHECKING:
    from decimal import Decimal as Unseen


def test_what_a_class_declares() -> None:
    class Plant(Block):
        command = Input(Twist, doc="what to do")
        gust = Input(Scalar, default=0.5)
        terms = Input(Scalar, variadic=True)
        pose = Output(Pose)
        speed = Output(Scalar, name="v")
        heading = Output(Scalar)
        mass: float = param(2.0, unit="kg", doc="mass")
        n: int = param(3, name="count", doc="how many")
        table: FloatArray | None = param(None, doc="table")
        memory = State("count", 2, doc="kept")

        def output_pose(self, state: Any, t: float) -> Any: ...

        def output(self, state: Any, t: float, gust: float, command: Any) -> Any: ...

        def update(self, state: Any, t: float, terms: Any, v: float) -> None: ...

    spec = Plant.spec
    assert list(spec.inputs) == ["command", "gust", "terms"]
    assert list(spec.outputs) == ["pose", "v", "heading"]
    assert [port.optional for port in spec.inputs.values()] == [False, True, True]
    assert {name: p.kind for name, p in spec.params.items()} == {
        "mass": "float",
        "count": "int",
        "table": "array",
    }
    assert spec.attributes["count"] == "n"
    assert {name: p.name for name, p in spec.params.items()} == {n: n for n in spec.params}
    assert spec.states["memory"].shape == ("count", 2)
    assert spec.evaluations == (
        Evaluation("output_pose", (), ("pose",)),
        Evaluation("output", ("gust", "command"), ("v", "heading")),
    )
    assert spec.update == Evaluation("update", ("terms", "v"))
    assert spec.through is None
    assert Plant(count=4).sizes() == {"count": 4}


class Base(Block):
    """A base to inherit from."""

    signal = Input(Scalar, name="input")
    out = Output(Scalar)
    gain: float = param(1.0, doc="gain")
    old = State(1)

    def output(self, state: Any, t: float, input: float) -> float:
        return self.gain * input


def test_a_subclass_adds_and_takes_the_place() -> None:
    class Child(Base):
        signal = Input(Vector(2), name="u")
        old = State(3)
        bias: int = param(2, doc="bias")

        def output(self, state: Any, t: float, u: Any) -> float:
            return float(u[0])

    assert list(Child.spec.inputs) == ["u"]
    assert Child.spec.states["old"].shape == (3,)
    assert list(Child.spec.params) == ["gain", "bias"]
    assert list(Base.spec.params) == ["gain"]
    assert Child(gain=2, bias=1).parameters() == {"gain": 2.0, "bias": 1}


def test_a_subclass_may_take_away() -> None:
    class Child(Base):
        old = None  # type: ignore[assignment]

    assert Child.spec.states == {}


def test_lengths_may_come_from_the_blocks_own_sizes() -> None:
    class Table(Block):
        out = Output(Scalar)
        rows: FloatArray = param(shape=(None,), doc="rows")
        memory = State("rows")

        def sizes(self) -> dict[str, int]:
            return {"rows": len(self.rows)}

        def output(self, state: Any, t: float) -> float:
            return 0.0

    assert Table(rows=[1, 2, 3]).sizes() == {"rows": 3}


def no_method() -> Any:
    class Bad(Block):
        out = Output(Scalar)


def no_method_for_the_rest() -> Any:
    class Bad(Block):
        a = Output(Scalar)
        b = Output(Scalar)

        def output_a(self, state: Any, t: float) -> float:
            return 0.0


def misspelt_method() -> Any:
    class Bad(Block):
        pose = Output(Scalar)

        def output(self, state: Any, t: float) -> float:
            return 0.0

        def output_poes(self, state: Any, t: float) -> float:
            return 0.0


def unknown_input() -> Any:
    class Bad(Block):
        command = Input(Scalar)
        out = Output(Scalar)

        def output(self, state: Any, t: float, comand: float) -> float:
            return 0.0


def output_as_an_input() -> Any:
    class Bad(Block):
        a = Output(Scalar)
        b = Output(Scalar)

        def output(self, state: Any, t: float, a: float) -> Any: ...


def no_time() -> Any:
    class Bad(Block):
        u = Input(Scalar)
        out = Output(Scalar)

        def output(self, state: Any, u: float) -> float:
            return 0.0


def star() -> Any:
    class Bad(Block):
        terms = Input(Scalar, variadic=True)
        out = Output(Scalar)

        def output(self, state: Any, t: float, *terms: float) -> float:
            return 0.0


def keyword_only() -> Any:
    class Bad(Block):
        u = Input(Scalar)
        out = Output(Scalar)

        def output(self, state: Any, t: float, *, u: float) -> float:
            return 0.0


def update_of_nothing() -> Any:
    class Bad(Block):
        u = Input(Scalar)

        def update(self, state: Any, t: float, w: float) -> None: ...


def through_nothing() -> Any:
    class Bad(Block):
        command = Input(Scalar)
        out = Output(Scalar, through="comand")

        def output(self, state: Any, t: float) -> float:
            return 0.0


def through_another_type() -> Any:
    class Bad(Block):
        command = Input(Pose)
        out = Output(Twist, through="command")

        def output(self, state: Any, t: float) -> Any: ...


def through_many() -> Any:
    class Bad(Block):
        terms = Input(Twist, variadic=True)
        out = Output(Twist, through="terms")

        def output(self, state: Any, t: float) -> Any: ...


def no_annotation() -> Any:
    class Bad(Block):
        gain = param(1.0, doc="gain")


def odd_annotation() -> Any:
    class Bad(Block):
        gain: list[float] = param(doc="gain")


def two_annotations() -> Any:
    class Bad(Block):
        gain: int | str = param(doc="gain")


def unseen_annotation() -> Any:
    class Bad(Block):
        gain: float = param(1.0, doc="gain")
        other: Unseen


def default_out_of_bounds() -> Any:
    class Bad(Block):
        gain: float = param(-1.0, above=0.0, doc="gain")


def default_of_another_kind() -> Any:
    class Bad(Block):
        count: int = param(1.5, doc="count")


def no_signal_type() -> Any:
    class Bad(Block):
        u = Input("Scalar")  # type: ignore[arg-type]


def no_length() -> Any:
    class Bad(Block):
        u = Input(Vector)  # type: ignore[arg-type]


def twice() -> Any:
    class Bad(Block):
        u = Input(Scalar)
        w = Input(Scalar, name="u")


def input_and_output() -> Any:
    class Bad(Block):
        u = Input(Scalar)
        v = Output(Scalar, name="u")

        def output(self, state: Any, t: float) -> float:
            return 0.0


def output_and_state() -> Any:
    class Bad(Block):
        out = Output(Scalar)
        kept = State(name="out")

        def output(self, state: Any, t: float) -> float:
            return 0.0


def reserved_state() -> Any:
    class Bad(Block):
        dt = State(1)


def reserved_input() -> Any:
    class Bad(Block):
        state = Input(Scalar)


def undocumented() -> Any:
    class Bad(Block):
        gain: float = param(1.0)


def hidden_method() -> Any:
    class Bad(Block):
        value = State(1)


def reserved_parameter() -> Any:
    class Bad(Block):
        kind: str = param("a", name="type", doc="type")


def dotted() -> Any:
    class Bad(Block):
        u = Input(Scalar, name="a.b")


def constant_with_inputs() -> Any:
    class Bad(Block):
        u = Input(Scalar)
        out = Output(Scalar, constant=True)

        def output(self, state: Any, t: float, u: float) -> float:
            return u


def state_of_unknown_length() -> Any:
    class Bad(Block):
        u = Input(Vector("n"))
        neurons: int = param(3, doc="neurons")
        kept = State("neuron")


def state_like_nothing() -> Any:
    class Bad(Block):
        u = Input(Same("T"), name="input")
        kept = State(like="inptu")


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (no_method, "Bad declares out but has no method output(self, state, t, ...) to compute"),
        (no_method_for_the_rest, "Bad declares b but has no method output(self, state, t, ...)"),
        (misspelt_method, "Bad.output_poes: there is no output 'poes', did you mean 'pose'?"),
        (
            unknown_input,
            "Bad.output: 'comand' is not a port it can read, did you mean 'command'? (command)",
        ),
        (output_as_an_input, "Bad.output: 'a' is not a port it can read (none)"),
        (no_time, "Bad.output must start with (self, state, t, ...)"),
        (star, "Bad.output: name each port, in place of *terms: 'float'; an input that takes ma"),
        (keyword_only, "Bad.output: name each port, in place of u: 'float'"),
        (update_of_nothing, "Bad.update: 'w' is not a port it can read (u)"),
        (through_nothing, "Bad.out: through='comand' is not an input, did you mean 'command'?"),
        (
            through_another_type,
            "Bad.out: through='command' takes Pose, which cannot replace Twist",
        ),
        (
            through_many,
            "Bad.out: through='terms' takes many wires of Twist, which cannot replace Twist",
        ),
        (no_annotation, "Bad.gain: annotate the parameter with float, int, bool, str, FloatAr"),
        (odd_annotation, "Bad.gain: annotate the parameter with float, int, bool, str, FloatA"),
        (two_annotations, "Bad.gain: annotate the parameter with float, int, bool, str, Float"),
        (unseen_annotation, "Bad: cannot read its annotations: name 'Unseen' is not defined; imp"),
        (
            default_out_of_bounds,
            "Bad.gain: its default: expected a number above 0, got -1.0",
        ),
        (default_of_another_kind, "Bad.count: its default: expected an integer, got 1.5"),
        (no_signal_type, "Bad.u: expected a signal type such as Scalar, Pose or Vector(3), got 'S"),
        (no_length, "; give it a length, as in Vector(3) or Vector('n')"),
        (twice, "Bad.w: the name 'u' is taken by the attribute 'u'"),
        (input_and_output, "Bad.v: the name 'u' is taken by the attribute 'u'"),
        (output_and_state, "Bad.kept: the name 'out' is taken by the attribute 'out'"),
        (reserved_state, "Bad.dt: 'dt' is reserved in states; rename it"),
        (reserved_input, "Bad.state: 'state' is an argument of every method (self, state, t, ..."),
        (undocumented, "param() needs a line of documentation: param(1.0, doc='the gain')"),
        (hidden_method, "Bad.value: hides Block.value; rename it, with name='value'"),
        (reserved_parameter, "Bad.kind: 'type' is reserved in graphs; rename it"),
        (dotted, "Bad.u: 'a.b' is not a valid name; use letters, digits and _"),
        (constant_with_inputs, "Bad.out: a constant output cannot need inputs (u)"),
        (
            state_of_unknown_length,
            "Bad.kept: no integer parameter and no port gives the length 'neuron', did you mean "
            "'neurons'?",
        ),
        (state_like_nothing, "Bad.kept: like='inptu' is not a port, did you mean 'input'?"),
    ],
)
def test_contradictions(declare: Callable[[], Any], message: str) -> None:
    with pytest.raises(DeclarationError) as caught:
        declare()
    assert message in str(caught.value)


def test_a_declaration_error_is_a_type_error() -> None:
    assert issubclass(blocks.DeclarationError, TypeError)
