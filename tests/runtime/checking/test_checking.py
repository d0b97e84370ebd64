"""The checker: every block of the library passes, and each kind of bad block is caught."""

from __future__ import annotations

import math
import random
import warnings
from functools import cached_property
from pathlib import Path as FilePath
from typing import Any

import numpy as np
import pytest

import blocks
from blocks import (
    Block,
    FloatArray,
    Input,
    Output,
    Path,
    Pose,
    Same,
    Scalar,
    Scan,
    SignalType,
    Spikes,
    State,
    Twist,
    Vector,
    param,
)
from blocks.library.index import TYPES
from blocks.library.registry import BUILTIN, blocks_of_module
from blocks.world.world import World
from runtime import CheckError, NotCompiledWarning, check_block
from tests.blocks.direct import REQUIRED

SQUARE = REQUIRED["WaypointPath"]["points"]
MADE: list[Block] = [
    blocks.LinePath(),
    blocks.SinePath(samples=50),
    blocks.CirclePath(),
    blocks.WaypointPath(points=SQUARE, closed=True),
    blocks.MatchingPoint(),
    blocks.MatchingPoint(window=0.1, curvature="unsigned"),
    blocks.TrackingError(),
    blocks.LQR(),
    blocks.LQR(q=[1, 2, 3]),
    blocks.LQR(q=[1, 2, 3], solver="dare", model="exact"),
    blocks.Constant(value=1),
    blocks.Constant(value=[1, 2], signal="Twist"),
    blocks.Constant(value=[1, 2, 3], signal="Vector"),
    blocks.Sum(),
    blocks.Sum(signs=[1, -1, 1]),
    blocks.Mux(),
    blocks.Gain(gain=2),
    blocks.UnitDelay(),
    blocks.Lowpass(tau=0.1, initial=3),
    blocks.Saturator(omega_max=1),
    blocks.ActuatorFault(gain=[1, 0.5], start=0.02, stop=0.04),
    blocks.PoseNoise(),
    blocks.DifferentialDrive(integrator="rk4"),
]


ROOM = World({"room": [[-2, -2], [2, -2], [2, 2], [-2, 2]], "circles": [[0.5, 1.2, 0.4]]})


@pytest.mark.parametrize("block", MADE, ids=repr)
def test_the_library_passes(block: Block) -> None:
    check_block(block)


@pytest.mark.parametrize("name", sorted(TYPES.keys() - {type(b).__name__ for b in MADE}))
def test_the_rest_of_the_library_passes(name: str) -> None:
    check_block(BUILTIN[name](**REQUIRED.get(name, {})), dt=0.001, world=ROOM)


def test_the_examples_pass() -> None:
    examples = FilePath(__file__).parents[3] / "examples"
    found = blocks_of_module(examples / "slippery_patch.py")
    assert found
    for cls in found.values():
        check_block(cls())


def test_a_world_may_be_given() -> None:
    robot = blocks.DifferentialDrive(body_radius=0.1)
    check_block(robot, world=ROOM)
    with pytest.raises(blocks.ParameterError, match="the graph has no world"):
        check_block(robot)


@pytest.mark.parametrize("parameters", [{}, {"leak": 1.0}, {"learning_rate": 0.0, "neurons": 1}])
def test_ensembles_pass_at_their_step(parameters: dict[str, float]) -> None:
    check_block(blocks.AdaptiveEnsemble(**parameters), ticks=30, dt=0.001)
    with pytest.raises(blocks.ParameterError, match="longer than tau_ref"):
        check_block(blocks.AdaptiveEnsemble(**parameters))


@pytest.mark.parametrize("kind", [Pose, Vector(4), Path(9), Scan(5), Spikes(7)], ids=str)
def test_generic_blocks_pass_with_every_type(kind: SignalType) -> None:
    for block in (blocks.UnitDelay(), blocks.Lowpass(tau=0.1), blocks.Gain(gain=0.3)):
        check_block(block, {"input": kind})
    check_block(blocks.Sum(), {"terms": kind})


def test_open_lengths_may_be_given() -> None:
    check_block(blocks.MatchingPoint(), {"path": Path(50)})
    check_block(blocks.AdaptiveEnsemble(), {"input": Vector(2), "error": Vector(5)}, dt=0.001)


@pytest.mark.parametrize(
    ("inputs", "message"),
    [
        ({"paht": Path(3)}, "MatchingPoint has no input 'paht', did you mean 'path'?"),
        ({"pose": Twist}, "MatchingPoint.pose takes Pose, not Twist"),
        ({"path": Vector(3)}, r"MatchingPoint.path takes Path\(3\), not Vector\(3\)"),
    ],
)
def test_types_that_do_not_fit(inputs: dict[str, SignalType], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        check_block(blocks.MatchingPoint(), inputs)


class Good(Block):
    """A block to spoil: a filter with noise.

    u -> [ Good ] -> out, again
    """

    u = Input(Vector(2))
    out = Output(Scalar)
    again = Output(Vector(2))
    kept = State(2)
    noise = State(1)

    def start(self, state: Any) -> None:
        state.noise[0] = state.rng.standard_normal()

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return float(state.kept[0] + state.noise[0] + u[1]), state.kept + u

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        state.kept[:] = 0.5 * state.kept + u
        state.noise[0] = state.rng.standard_normal()


def test_a_good_block_passes() -> None:
    check_block(Good())


class NoDocstring(Good):
    pass


class BlankDocstring(Good):
    """ """


class Integer(Good):
    """Returns an int."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 1, u.copy()


class Boolean(Good):
    """Returns a bool."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return u[0] > 0.0, u.copy()


class ListForArray(Good):
    """Returns a list."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, [1.0, 2.0]


class WrongShape(Good):
    """Returns too many numbers."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, np.zeros(3)


class SinglePrecision(Good):
    """Returns float32."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, u.astype(np.float32)


class OneForTwo(Good):
    """Returns one output."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return u.copy()


class ListOfOutputs(Good):
    """Returns its outputs in a list."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return [0.0, u.copy()]


class ArrayForRecord(Block):
    """Returns an array for a pose."""

    pose = Output(Pose)

    def output(self, state: Any, t: float) -> Any:
        return np.zeros(3)


class ShortRecord(Block):
    """Returns two numbers for a pose."""

    pose = Output(Pose)

    def output(self, state: Any, t: float) -> Any:
        return 0.0, 1.0


class OutputWrites(Good):
    """Counts in an output."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        state.kept += 1.0
        return 0.0, u.copy()


class OutputKeeps(Good):
    """Keeps something new in an output."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        state.last = u[0]
        return 0.0, u.copy()


class OutputDraws(Good):
    """Draws in an output."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return state.rng.random(), u.copy()


class OutputChangesInput(Good):
    """Scales its input in place."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        u *= 2.0
        return 0.0, u.copy()


class UpdateChangesInput(Good):
    """Scales its input in place, later."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        u[0] = 0.0


class UpdateChangesOutput(Good):
    """Writes into what it has put out."""

    def update(self, state: Any, t: float, again: FloatArray) -> Any:  # type: ignore[override]
        again[0] = 0.0


class OutputIsRandom(Good):
    """Asks the world for a number."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return random.random(), u.copy()


class ReturnsItsState(Good):
    """Hands out the array that update writes to."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, state.kept


class ReturnsAView(Good):
    """Hands out a view of the array that update writes to."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, state.kept[::-1]


class Remembers(Good):
    """Keeps memory on the block, past the guard."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        self.__dict__["count"] = self.__dict__.get("count", 0) + 1


class RemembersAtStart(Good):
    """Keeps memory on the block from the start."""

    def start(self, state: Any) -> None:
        object.__setattr__(self, "state", state)


class Sets(Good):
    """Sets an attribute, which the block refuses."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        self.count = 1


class SharedList(Good):
    """Keeps memory in a list of its class."""

    history: list[float] = []  # noqa: RUF012

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        self.history.append(t)


class InheritedList(SharedList):
    """Keeps memory in a list of its base."""


WORLD: list[float] = []


class Worldly(Good):
    """Keeps memory in the module."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return float(len(WORLD)), u.copy()

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        WORLD.append(t)


class WorldlyReset(Good):
    """Keeps memory in the module, made anew by start: one run at a time looks fine."""

    def start(self, state: Any) -> None:
        WORLD.clear()

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return float(sum(WORLD)), u.copy()

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        WORLD.append(float(u[0]))


class Undeclared(Good):
    """Keeps memory in the state without saying so."""

    def start(self, state: Any) -> None:
        state.count = 0

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return float(state.count), u.copy()

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        state.count += 1


class UndeclaredIntoDeclared(Good):
    """Lets undeclared memory move a state that is put out much later."""

    def start(self, state: Any) -> None:
        state.count = 0.0

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 0.0, u.copy()

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        state.count += 1.0
        state.kept[:] = state.count


class UpdateIsRandom(Good):
    """Updates with a number from the world."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        state.kept[:] = random.random()


class Replaces(Good):
    """Assigns another array to its state, which writes into it."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        state.kept = state.kept + u


class ReplacesAtStart(Good):
    """Assigns a number to its state, which fills it."""

    def start(self, state: Any) -> None:
        state.noise = 0.5


class Returns(Good):
    """Returns the new state."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        return state.kept + u


class Fails(Good):
    """Divides by zero."""

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return 1 / 0, u.copy()


class Wavers(Block):
    """Declares a constant that is none."""

    out = Output(Scalar, constant=True)

    def output(self, state: Any, t: float) -> float:
        return t


class FalseCache(Good):
    """Declares its memory as cached."""

    kept = State(2, cached=True)


class OptionalForm(Block):
    """Returns an int where nothing is wired."""

    u = Input(Scalar, default=0.0)
    terms = Input(Scalar, variadic=True)
    out = Output(Scalar)

    def output(self, state: Any, t: float, u: float, terms: tuple[float, ...]) -> float:
        return sum(terms) if terms else 0


class OwnConstructor(Good):
    """Takes something that is no parameter."""

    def __init__(self, extra: int) -> None:
        super().__init__()


class Forgets(Good):
    """Does not take its parameter as it is given."""

    gain: float = param(1.0, doc="gain")

    def __init__(self, **values: Any) -> None:
        super().__init__(**{k: 2.0 * v for k, v in values.items()})


@pytest.mark.parametrize(
    ("block", "message"),
    [
        (NoDocstring(), "NoDocstring: has no docstring; draw the box and give its equation"),
        (BlankDocstring(), "BlankDocstring: has no docstring"),
        (Integer(), "Integer.output: output 'out' must be a float, got 1 (int)"),
        (Boolean(), "Boolean.output: output 'out' must be a float, got np."),
        (
            ListForArray(),
            "ListForArray.output: output 'again' must be a float64 array of shape (2,), "
            "got [1.0, 2.0] (list)",
        ),
        (WrongShape(), "output 'again' must be a float64 array of shape (2,), got an array of flo"),
        (SinglePrecision(), "must be a float64 array of shape (2,), got an array of float32"),
        (OneForTwo(), "OneForTwo.output: must return a tuple of its 2 outputs (out, again), got"),
        (ListOfOutputs(), "ListOfOutputs.output: must return a tuple of its 2 outputs (out, again"),
        (ArrayForRecord(), "output 'pose' must be a tuple of 3 floats (x, y, theta), got an array"),
        (ShortRecord(), "must be a tuple of 3 floats (x, y, theta), got (0.0, 1.0) (tuple)"),
        (OutputWrites(), "OutputWrites.output: changes state 'kept'; only update writes into"),
        (OutputKeeps(), "OutputKeeps.output: changes state 'last'; only update writes into the st"),
        (OutputDraws(), "OutputDraws.output: draws from state.rng; draw in start and update"),
        (OutputChangesInput(), "OutputChangesInput.output: changes its argument 'u' in place"),
        (UpdateChangesInput(), "UpdateChangesInput.update: changes its argument 'u' in place"),
        (UpdateChangesOutput(), "UpdateChangesOutput.update: changes its argument 'again' in pl"),
        (OutputIsRandom(), "OutputIsRandom.output: returns different values when called again w"),
        (
            ReturnsItsState(),
            "ReturnsItsState.output: output 'again' shares the memory of state 'kept'",
        ),
        (ReturnsAView(), "ReturnsAView.output: output 'again' shares the memory of state 'kept'"),
        (Remembers(), "Remembers.update: changes the block's attribute 'count'; a block is immuta"),
        (RemembersAtStart(), "RemembersAtStart.start: changes the block's attribute 'state'"),
        (Sets(), "Sets.update: AttributeError: Sets cannot change after construction; make"),
        (SharedList(), "SharedList.update: changes the block's attribute 'history'"),
        (InheritedList(), "InheritedList.update: changes the block's attribute 'history'"),
        (Worldly(), "Worldly: two runs with the same seed differ, in output 'out' at tick 0"),
        (
            WorldlyReset(),
            "WorldlyReset: simultaneous runs affect each other, in output 'out' at tick 2",
        ),
        (
            Undeclared(),
            "Undeclared: a run that resumes from its declared states differs, in output 'out' at "
            "tick 1",
        ),
        (
            UndeclaredIntoDeclared(),
            "UndeclaredIntoDeclared: a run that resumes from its declared states differs, in state "
            "'kept' at tick 2",
        ),
        (UpdateIsRandom(), "UpdateIsRandom: two runs with the same seed differ"),
        (Returns(), "Returns.update: returns a value, which is not used; write into the state"),
        (Fails(), "Fails.output: ZeroDivisionError: division by zero"),
        (Wavers(), "Wavers: output 'out' is declared constant but changes"),
        (
            FalseCache(),
            "FalseCache.output: its result depends on the content of a cached state (kept)",
        ),
        (OptionalForm(), "OptionalForm.output: output 'out' must be a float, got 0 (int)"),
        (OwnConstructor(1), "OwnConstructor: cannot be rebuilt from parameters()"),
        (Forgets(gain=3.0), "Forgets: differs when rebuilt from parameters()"),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Block) else "",
)
def test_bad_blocks_are_caught(block: Block, message: str) -> None:
    WORLD.clear()
    with pytest.raises(CheckError) as caught:
        check_block(block)
    assert message in str(caught.value)


@pytest.mark.parametrize("block", [Replaces(), ReplacesAtStart()])
def test_an_assignment_to_a_state_writes_into_it(block: Block) -> None:
    check_block(block)


class Scratch(Good):
    """Keeps a buffer beside its state, which holds nothing from tick to tick."""

    def start(self, state: Any) -> None:
        state.buffer = np.empty(2)

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        np.add(state.kept, u, out=state.buffer)
        state.kept[:] = state.buffer


class Lazy(Good):
    """Works out an attribute on first use."""

    @cached_property
    def table(self) -> FloatArray:
        return np.arange(3.0)

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        return float(self.table[1]), u.copy()


class LazyThenChanged(Lazy):
    """Writes into what it has worked out on first use."""

    def update(self, state: Any, t: float, u: FloatArray) -> Any:
        self.table[1] += 1.0


class Memo(Good):
    """Keeps a square root to save work."""

    of = State(1, cached=True)
    root = State(1, cached=True)

    def output(self, state: Any, t: float, u: FloatArray) -> Any:
        if state.of[0] != u[0]:
            state.of[0], state.root[0] = u[0], math.sqrt(abs(u[0]))
        return float(state.root[0]), u.copy()


class Passes(Block):
    """Hands its input on as it is, and a constant of its own."""

    u = Input(Same("T"))
    out = Output(Same("T"), through="u")
    table = Output(Vector(3), constant=True)

    def output_table(self, state: Any, t: float) -> FloatArray:
        return np.arange(3.0)

    def output(self, state: Any, t: float, u: Any) -> Any:
        return u


@pytest.mark.parametrize("block", [Scratch(), Lazy(), Memo(), Passes()])
def test_what_is_allowed(block: Block) -> None:
    check_block(block)


def test_passing_an_array_on_is_allowed() -> None:
    check_block(Passes(), {"u": Vector(4)})


def test_a_lazy_attribute_stays() -> None:
    with pytest.raises(CheckError, match=r"LazyThenChanged.update: changes the block's attribute"):
        check_block(LazyThenChanged())


def test_ticks_and_step_are_those_given() -> None:
    seen: list[float] = []

    class Clock(Good):
        """Tells the time."""

        def update(self, state: Any, t: float, u: FloatArray) -> Any:
            seen.append(t)
            assert state.dt == 0.25

    check_block(Clock(), ticks=3, dt=0.25)
    assert sorted(set(seen)) == [0.0, 0.25, 0.5]


def test_terms_are_there_and_then_not() -> None:
    seen: set[tuple[int, float, tuple[bool, ...]]] = set()

    class Watch(Block):
        """Looks at how many terms come in."""

        u = Input(Scalar)
        w = Input(Scalar, default=-7.0)
        terms = Input(Scalar, variadic=True)

        def update(self, state: Any, t: float, u: float, w: float, terms: Any) -> None:
            assert isinstance(u, float)
            seen.add((len(terms), w if w == -7.0 else 0.0, state.context.terms["terms"]))

    check_block(Watch())
    assert seen == {(2, 0.0, (True, True)), (0, -7.0, (False, False))}


def test_the_inputs_are_of_their_types() -> None:
    spikes: set[float] = set()
    kinds: dict[str, Any] = {
        "a": Scalar,
        "b": Pose,
        "c": Vector("n"),
        "d": Path(5),
        "e": Scan(4),
        "f": Spikes(2),
    }

    class Watch(Block):
        """Looks at what comes in."""

        a, b, c = Input(Scalar), Input(Pose), Input(Vector("n"))
        d, e, f = Input(Path(5)), Input(Scan(4)), Input(Spikes(2))

        def update(
            self, state: Any, t: float, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any
        ) -> Any:
            for name, value in zip("abcdef", (a, b, c, d, e, f), strict=True):
                kind = state.context.types[name]
                assert kind.holds(value)
                assert kind.name == kinds[name].name
            assert c.shape == (3,)
            assert (e > 0.0).all()
            spikes.update(f.tolist())
            # A path is sampled evenly, and its heading is that of its steps.
            steps = np.diff(d[:, :2], axis=0)
            np.testing.assert_allclose(np.hypot(*steps.T), 0.1)

    check_block(Watch())
    assert spikes == {0.0, 100.0}


def test_it_lists_what_cannot_be_compiled_with_its_place_and_a_suggestion() -> None:
    class Sorted(Block):
        """Sorts a vector, and adds one to it."""

        u = Input(Vector(3))
        y = Output(Vector(3))
        last = State(3)

        def output(self, state: Any, t: float, u: FloatArray) -> FloatArray:
            y = np.empty(3)
            np.add(u, 1.0, out=y)  # the first line that is named
            return y

        def update(self, state: Any, t: float, u: FloatArray) -> None:
            state.last[:] = sorted(u)  # the second

    with pytest.warns(NotCompiledWarning) as seen:
        check_block(Sorted())
    lines = FilePath(__file__).read_text(encoding="utf-8").splitlines()
    first, second = (
        next(i for i, line in enumerate(lines, 1) if f"  # {text}" in line)
        for text in ("the first line that is named", "the second")
    )
    assert [str(each.message) for each in seen] == [
        "Sorted.output is not compiled: np.add with the keyword out= is not compiled; "
        f"write the loop ({__file__}:{first})",
        "Sorted.update is not compiled: calls 'sorted(u)', which is not compiled; "
        f"write it with math, arrays and loops ({__file__}:{second})",
    ]


@pytest.mark.parametrize("block", [blocks.Saturator(omega_max=1.0), blocks.Lowpass(tau=0.1)])
def test_it_says_nothing_of_a_block_that_compiles(block: Block) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_block(block)
