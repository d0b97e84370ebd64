"""The base of all blocks: built from parameters, immutable, rebuilt from them."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
from blocks import Block, DeclarationError, FloatArray, ParameterError, State, param
from blocks.core.params import plain as written
from blocks.library.registry import BUILTIN
from tests.blocks.direct import REQUIRED, state_of

SQUARE = REQUIRED["WaypointPath"]["points"]
NUMBERS = st.floats(-1e6, 1e6)
SIZES = st.floats(1e-3, 1e3)


def vectors(n: int) -> st.SearchStrategy[list[float]]:
    return st.lists(NUMBERS, min_size=n, max_size=n)


def weights(n: int) -> st.SearchStrategy[list[float]]:
    return st.lists(SIZES, min_size=n, max_size=n)


# Parameters that a type takes; what is left out keeps its default. A type that is not here is
# made with what it requires.
PARAMETERS: dict[str, st.SearchStrategy[dict[str, Any]]] = {
    "LinePath": st.fixed_dictionaries({}, optional={"y": NUMBERS, "x_start": st.just(-3)}),
    "SinePath": st.fixed_dictionaries({}, optional={"amplitude": NUMBERS, "wavelength": SIZES}),
    "CirclePath": st.fixed_dictionaries(
        {}, optional={"center": vectors(2), "radius": SIZES, "clockwise": st.booleans()}
    ),
    "WaypointPath": st.fixed_dictionaries(
        {"points": st.just(SQUARE)},
        optional={"degree": st.integers(1, 3), "closed": st.booleans()},
    ),
    "MatchingPoint": st.fixed_dictionaries(
        {}, optional={"window": SIZES, "curvature": st.sampled_from(["signed", "unsigned"])}
    ),
    "TrackingError": st.just({}),
    "CourseError": st.fixed_dictionaries({}, optional={"v_r": SIZES, "lookahead_time": SIZES}),
    "LQR": st.fixed_dictionaries(
        {},
        optional={
            "q": st.one_of(weights(3), weights(3).map(lambda w: np.diag(w).tolist())),
            "r": weights(2),
            "v_r": SIZES,
            "model": st.sampled_from(["paper", "exact"]),
            "max_iterations": st.integers(1, 2**60),
        },
    ),
    "PathPID": st.fixed_dictionaries({}, optional={"kp": SIZES, "limit": SIZES, "v_r": SIZES}),
    "PurePursuit": st.fixed_dictionaries({}, optional={"lookahead_time": SIZES, "v_r": SIZES}),
    "Stanley": st.fixed_dictionaries({}, optional={"k": SIZES, "wheel_base": SIZES}),
    "LQI": st.fixed_dictionaries({}, optional={"q_integral": SIZES, "v_r": SIZES, "r": weights(2)}),
    "DisturbanceObserver": st.fixed_dictionaries({}, optional={"rate": SIZES, "tau": SIZES}),
    "L1Adaptive": st.fixed_dictionaries({}, optional={"filter": SIZES, "predictor": SIZES}),
    "MPC": st.fixed_dictionaries({}, optional={"omega_rate": SIZES, "steps": st.integers(1, 50)}),
    "MRAC": st.fixed_dictionaries({}, optional={"power": SIZES, "e_leak": SIZES}),
    "AdaptiveBias": st.fixed_dictionaries({}, optional={"power": SIZES, "leak": SIZES}),
    "AdaptiveEnsemble": st.fixed_dictionaries(
        {"neurons": st.just(3)},
        optional={
            "learning_rate": SIZES,
            "voltage": st.lists(st.floats(0, 1), min_size=3, max_size=3),
            "encoders": st.one_of(vectors(3), st.just([[1, 2], [3, 4], [5, 6]])),
        },
    ),
    "Constant": st.one_of(
        st.builds(lambda x: {"value": x}, st.one_of(NUMBERS, st.integers(-9, 9))),
        st.builds(lambda x: {"value": x, "signal": "Pose"}, vectors(3)),
        st.builds(lambda x: {"value": x, "signal": "Vector"}, vectors(4)),
    ),
    "Sum": st.fixed_dictionaries({}, optional={"signs": st.just([1, -1])}),
    "Mux": st.just({}),
    "Gain": st.fixed_dictionaries({"gain": NUMBERS}),
    "UnitDelay": st.fixed_dictionaries({}, optional={"initial": st.one_of(NUMBERS, vectors(2))}),
    "Lowpass": st.fixed_dictionaries({"tau": SIZES}, optional={"initial": st.none()}),
    "Saturator": st.fixed_dictionaries({"omega_max": SIZES}),
    "ActuatorFault": st.fixed_dictionaries(
        {}, optional={"gain": vectors(2), "start": st.just(1), "stop": st.just(math.inf)}
    ),
    "PoseNoise": st.fixed_dictionaries({}, optional={"sigma_position": SIZES}),
    "DifferentialDrive": st.fixed_dictionaries(
        {}, optional={"x0": vectors(3), "integrator": st.sampled_from(["euler", "rk4", "exact"])}
    ),
}


def plain(value: Any) -> bool:
    """What YAML writes without tags."""
    if isinstance(value, list):
        return all(plain(item) for item in value)
    if isinstance(value, dict):
        return all(type(key) is str and plain(item) for key, item in value.items())
    return value is None or type(value) in (bool, int, float, str)


@pytest.mark.parametrize("name", BUILTIN)
@given(data=st.data())
def test_parameters_make_the_same_block(name: str, data: st.DataObject) -> None:
    given_values = data.draw(PARAMETERS.get(name, st.just(REQUIRED.get(name, {}))))
    block = BUILTIN[name](**given_values)
    parameters = block.parameters()
    assert all(plain(value) for value in parameters.values())
    assert parameters.keys() <= given_values.keys()
    again = BUILTIN[name](**parameters)
    assert again == block
    assert hash(again) == hash(block)
    assert again.parameters() == parameters
    for parameter, value in given_values.items():
        np.testing.assert_array_equal(written(again.value(parameter)), value)


@pytest.mark.parametrize("name", BUILTIN)
def test_defaults_are_left_out(name: str) -> None:
    cls = BUILTIN[name]
    defaults = {
        key: declared.default for key, declared in cls.spec.params.items() if not declared.required
    }
    required = REQUIRED.get(name, {})
    assert cls(**{**defaults, **required}).parameters().keys() == required.keys()


@pytest.mark.parametrize("name", BUILTIN)
def test_every_parameter_and_port_is_documented(name: str) -> None:
    spec = BUILTIN[name].spec
    for declared in (*spec.params.values(), *spec.ports.values(), *spec.states.values()):
        assert declared.doc.strip()
    assert "\u25b6" in (BUILTIN[name].__doc__ or "")


def test_blocks_with_other_parameters_differ() -> None:
    assert blocks.Gain(gain=1) == blocks.Gain(gain=1.0) != blocks.Gain(gain=2)
    assert blocks.UnitDelay() != blocks.Mux()
    assert blocks.Gain(gain=1) != 1
    assert len({blocks.Gain(gain=1), blocks.Gain(gain=1.0), blocks.Gain(gain=2)}) == 2


def test_repr_is_how_it_was_made() -> None:
    assert repr(blocks.Saturator(omega_max=1)) == "Saturator(omega_max=1.0)"
    assert repr(blocks.Mux()) == "Mux()"
    made = blocks.ActuatorFault(gain=[1, 0.5], stop=3)
    assert eval(repr(made), {name: getattr(blocks, name) for name in blocks.__all__}) == made


def test_a_block_cannot_be_changed() -> None:
    block = blocks.LQR(q=[1, 2, 3])
    with pytest.raises(AttributeError, match="LQR cannot change after construction; make another"):
        block.v_r = 2.0
    with pytest.raises(AttributeError, match="keep what changes in a State .attribute 'memory'"):
        block.memory = 1.0
    with pytest.raises(AttributeError, match="LQR cannot change after construction"):
        del block.v_r
    with pytest.raises(ValueError, match="read-only"):
        block.q[0] = 5.0
    assert block.parameters() == {"q": [1.0, 2.0, 3.0]}


def test_a_block_keeps_arrays_of_its_own() -> None:
    mine = np.array([1.0, 2.0, 3.0])
    block = blocks.LQR(q=mine)
    mine[0] = 7.0
    assert block.q.tolist() == [1.0, 2.0, 3.0]


def pickled(block: Block) -> Any:
    return pickle.loads(pickle.dumps(block))


@pytest.mark.parametrize("clone", [copy.copy, copy.deepcopy, pickled])
def test_copies_are_equal(clone: Any) -> None:
    block = blocks.WaypointPath(points=SQUARE, closed=True)
    np.testing.assert_array_equal(clone(block).sampled, block.sampled)
    assert clone(block) == block


class Odd(Block):
    """Parameters that check each other."""

    low: float = param(0.0, doc="low")
    high: float = param(1.0, at_most=9.0, doc="high")
    table: FloatArray | None = param(None, shape=("rows",), doc="table")
    rows: int = param(2, at_least=1, doc="rows")
    needed: str = param(doc="needed")

    def validate(self) -> None:
        if self.low > self.high:
            raise ParameterError([("low", f"must lie below high = {self.high:g}")])


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({}, ["Odd.needed: missing; expected a string: needed"]),
        ({"needed": "x", "hihg": 2}, ["Odd.hihg: unknown parameter, did you mean 'high'?"]),
        (
            {"needed": "x", "qq": 2},
            ["Odd.qq: unknown parameter; it has low, high, table, rows, needed"],
        ),
        ({"needed": "x", "low": 2}, ["Odd.low: must lie below high = 1"]),
        (
            {"needed": "x", "table": [1, 2, 3]},
            ["Odd.table: expected an array of rows numbers, got [1.0, 2.0, 3.0]"],
        ),
        (
            {"low": "a", "high": 10, "zz": 1},
            [
                "Odd.zz: unknown parameter; it has low, high, table, rows, needed",
                "Odd.low: expected a number, got the string 'a'",
                "Odd.high: expected a number at most 9, got 10",
                "Odd.needed: missing; expected a string: needed",
            ],
        ),
    ],
)
def test_bad_parameters_are_all_named(parameters: dict[str, Any], message: list[str]) -> None:
    with pytest.raises(ParameterError) as caught:
        Odd(**parameters)
    assert str(caught.value).split("\n") == message


def test_shapes_follow_an_integer_parameter() -> None:
    assert Odd(needed="", rows=3, table=[1, 2, 3]).table.tolist() == [1.0, 2.0, 3.0]


def test_a_type_without_parameters_says_so() -> None:
    with pytest.raises(ParameterError, match="Mux.gain: unknown parameter; it has none"):
        blocks.Mux(gain=1.0)


def test_a_states_generator_comes_from_its_seed() -> None:
    block = blocks.PoseNoise()
    draws = [state_of(block, seed=seed).noise.tolist() for seed in (1, 1, 2)]
    assert draws[0] == draws[1] != draws[2]
    state = state_of(blocks.Mux(), seed=5)
    expected = np.random.Generator(np.random.PCG64(np.random.SeedSequence(5)))
    assert state.rng.random() == expected.random()
    assert state.rng is state.rng


def test_constant_outputs() -> None:
    constant = {"Constant", "LinePath", "SinePath", "CirclePath", "WaypointPath"}
    for name, cls in BUILTIN.items():
        for port in cls.spec.outputs.values():
            assert port.constant == (name in constant)


def test_through_pairs() -> None:
    for name, pair in {
        "Gain": ("input", "out"),
        "UnitDelay": ("input", "out"),
        "Lowpass": ("input", "out"),
        "Saturator": ("command", "limited"),
        "ActuatorFault": ("command", "actual"),
        "PoseNoise": ("pose", "measured"),
        "Sum": None,
        "LQR": None,
        "DifferentialDrive": None,
    }.items():
        assert BUILTIN[name].spec.through == pair


def test_the_shape_of_a_state_may_be_a_tuple() -> None:
    class Held(Block):
        x = State((2, 3))

    assert Held.spec.states["x"] == State(2, 3)


@pytest.mark.parametrize("shape", [(2.0,), (True,), (-1,), ((2, 3), 4), (None,)])
def test_a_state_with_another_shape_is_refused(shape: Any) -> None:
    with pytest.raises(DeclarationError, match=r"Held.x: expected lengths.* as in State\(2, 3\)"):
        type("Held", (Block,), {"x": State(*shape)})
