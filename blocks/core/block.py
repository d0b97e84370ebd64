"""What a block is: a passive description with typed ports, parameters and declared state.

A block is written as a class::

    class Saturator(Block):
        command = Input(Twist)
        limited = Output(Twist, through="command")
        omega_max: float = param(unit="rad/s", above=0.0, doc="largest turn rate")

        def output(self, state, t, command):
            ...

* The parameters of ``output`` after ``state, t`` name the inputs it needs *in this tick*: that is
  the block's direct feedthrough. An output that needs none breaks a loop. Where outputs need
  different inputs, ``output_<port>`` computes that port alone and ``output`` the rest.
* ``update(self, state, t, ...)`` names inputs, or the block's own outputs of this tick, and writes
  into ``state`` in place. Input arrays are read-only; the engine copies output
  arrays that share memory with the state.
* ``start(self, state)`` fills the state before the first tick.

Each of them is called exactly once per tick of the block.

A block in continuous time declares continuous states and says how fast they change::

    class Pendulum(Block):
        torque = Input(Scalar, unit="N m", default=0.0)
        angle = Output(Scalar, unit="rad")

        theta = State(unit="rad", continuous=True)
        omega = State(unit="rad/s", continuous=True)

        def output(self, state, t):
            return float(state.theta)

        def derivative(self, state, t, torque):
            theta, omega = float(state.theta), float(state.omega)
            return omega, torque / self.inertia - self.g / self.length * math.sin(theta)

* ``derivative(self, state, t, ...)`` names inputs, or outputs of the block, as ``update`` does. It
  returns one value per continuous state in the order of their declaration: a float for ``State()``,
  a tuple or an array for ``State(3)``. It changes nothing. The run's solver integrates all
  continuous states of a graph together and calls it several times per tick, at times between ticks;
  outputs of blocks without memory are then computed again.
* ``project(self, state)`` may move the states after each step of the solver: limits, an angle
  wrapped.
* A block may have both: ``update`` comes first, at the tick, and may set continuous states.

Events of continuous signals happen between ticks. A block declares guards, numbers that are above
zero while a condition holds, and what happens where one changes its sign::

    def crossings(self, context):
        return ("rising",)  # of each guard: rising, falling or either

    def guards(self, state, t, signal):
        return np.array([signal - self.level])

    def event(self, state, t, which, signal):
        state.count += 1

* After each step of the solver, ``guards`` is asked; where one has changed its sign in its
  direction, that time is located, and ``event`` called with its number. It may set all states of
  the block. Integration restarts there.
* Outputs of a block with guards and without continuous states hold from event to event, unless it
  ``follows``: then a guard is a corner, at which a step ends.
* A block with continuous states has an ``update`` for ``run: {events: ticks}`` alone, then.
* ``edges(until)`` of a source are the times at which its output jumps or bends; steps end there.

A block is immutable: everything that
changes is in the :class:`BlockState` that the engine owns.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Container, Hashable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, ClassVar

from blocks.core.block_state import BlockContext, BlockState
from blocks.core.declarations import BlockSpec, Evaluation, Input, Output, State
from blocks.core.hints import unknown_parameter
from blocks.core.params import DeclarationError, ParameterError, as_matrix, plain, show
from blocks.core.reading import STATED, read_declarations
from blocks.core.settings import SettingError
from blocks.core.signals import FloatArray, PortType, SignalType
from blocks.messages import message_of

__all__ = [
    "Block",
    "BlockSpec",
    "Evaluation",
    "Input",
    "Output",
    "State",
]


class Block:
    """Base of all blocks. Parameters are given by keyword and checked on construction.

    Raises
    ------
    ParameterError : listing every parameter that is unknown, missing or out of bounds.
    """

    spec: ClassVar[BlockSpec] = BlockSpec()
    # Whether outputs follow inputs between events, with a corner at each, rather than hold.
    follows: ClassVar[bool] = False
    # Whether outputs may be infinite where an input may be, as the largest of a scan's ranges.
    passes_misses: ClassVar[bool] = False
    # What is executed of a file that a parameter names, as in "the library in the FMU"; '' for
    # nothing. --no-modules refuses such a block.
    executes: ClassVar[str] = ""
    # Whether a note says where a condition of its events held to the end of a run without acting.
    notes_conditions: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.spec = read_declarations(
            cls,
            own_sizes=cls.sizes is not Block.sizes or cls.sizes_in is not Block.sizes_in,
            own_variables=cls.variables is not Block.variables,
        )
        if cls.spec.event is not None and cls.spec.guards is None:
            raise DeclarationError(f"{cls.__name__}.event: there are no guards(self, state, t)")
        if cls.spec.guards is not None and cls.crossings is Block.crossings:
            message = "guards need crossings(self, context), the direction of each"
            raise DeclarationError(f"{cls.__name__}.guards: {message}")

    def __init__(self, *unnamed: Any, **values: Any) -> None:
        problems: list[tuple[str, str]] = []
        known = self.spec.params
        for name, value in zip([*known, *("",) * len(unnamed)], unnamed, strict=False):
            written = f"{type(self).__name__}({name}={value!r})"
            text = f"parameters are given by name, as in {written}" if name else "has no parameter"
            problems.append((name or "value", text))
        # All at once, the unknown ones included: a user then corrects a graph in one go.
        problems += [
            (name, unknown_parameter(name, known)) for name in sorted(values.keys() - known.keys())
        ]
        for name, declared in known.items():
            if name not in values and declared.required and not unnamed:
                problems.append((name, declared.missing()))
                continue
            if name not in values and declared.required:
                continue
            try:
                value = declared.convert(values.get(name, declared.default))
            except SettingError as error:
                problems += [(f"{name}.{at}" if at else name, text) for at, text in error.problems]
            except ValueError as error:
                problems.append((name, message_of(error)))
            else:
                self.__dict__[self.spec.attributes[name]] = value
        # Shapes name other parameters, so all of them have to be valid first.
        if not problems:
            problems += self._misshapen()
        if problems:
            raise ParameterError(problems, type(self).__name__)
        try:
            self.validate()
        except ParameterError as error:
            raise ParameterError(error.problems, type(self).__name__) from None

    def _misshapen(self) -> list[tuple[str, str]]:
        sizes = self.sizes()
        stated = self.__dict__.get(STATED)
        if stated is not None and stated.symbol:
            message = f"expected a type with its length, as in {stated.name}(3), got {stated.name}"
            return [("signal", message)]
        return [
            (name, f"{expected}, got {show(plain(value))}{as_matrix(value, declared)}")
            for name, declared in self.spec.params.items()
            if declared.kind == "array"
            and not isinstance(value := self.value(name), (str, type(None)))
            and not declared.fits(value, sizes)
            and (expected := f"expected {declared.describe()}")
        ]

    def validate(self) -> None:
        """Check conditions on several parameters; raise :class:`ParameterError`."""

    def validate_in(self, context: BlockContext) -> None:
        """Check that the block can run in this context; raise :class:`ParameterError`."""

    @property
    def stepwise(self) -> bool:
        """Whether outputs hold between ticks although no ``update`` says so: those that jump.

        A solver would see the value after a jump in the last stage of the step before it.
        """
        return False

    @property
    def recalls(self) -> tuple[str, ...]:
        """Inputs of whose past the outputs are a function at any time.

        If such an input moves between ticks and the block has no ``dt`` of its own, a solver asks
        for the outputs at its stages, from what ``update`` wrote at the tick.
        """
        return ()

    @property
    def glides(self) -> bool:
        """Whether outputs move between two ticks of the block, from what ``update`` wrote.

        They are then asked for at every base tick and at the stages of a solver, where ``update``
        still acts on the block's own ticks. They may depend on the time and the states, and must be
        continuous at the block's ticks: a step that ends there sees the value from before.
        """
        return False

    def crossings(self, context: BlockContext) -> Sequence[str]:
        """In which direction each of the guards is met: rising, falling or either."""
        return ()

    def edges(self, until: float) -> Sequence[float] | FloatArray:
        """The times (s) in a run at which the outputs jump or bend, as a source knows them."""
        return ()

    @property
    def jumps(self) -> bool:
        """Whether outputs that move between edges jump at one, as saw teeth do."""
        return False

    def infer(self, lengths: Mapping[str, int]) -> Mapping[str, int]:
        """Lengths that follow from others that are known, by symbol."""
        return {}

    def why_open(self, published: Container[str]) -> str:
        """Why a length of this block may be open, and what to do; '' for the general message.

        ``published`` are the inputs that receive a published description.
        """
        return ""

    @property
    def files(self) -> Mapping[str, bytes]:
        """The content of the files that the block has read, by resolved path; a run keeps them."""
        return {}

    def instead(self, wanted: SignalType) -> str:
        """What to write for an output of another type, for messages; '' if unknown."""
        return ""

    def discretized(self, method: str, step: float) -> Block | None:
        """The block in discrete time, with the same ports; None if it has no such form.

        Parameters
        ----------
        method : "tustin", "zoh" or "matched". step : the new block's own step (s).

        Raises
        ------
        ParameterError : there is one by other methods only, or for other parameters.
        """
        return None

    def why_not_finite(self) -> str:
        """Why an output may be NaN or infinite, and what to do, for messages; '' if unknown."""
        return ""

    def notes(self, context: BlockContext, steps: Mapping[str, tuple[float, ...]]) -> Iterable[str]:
        """What looks wrong but can run, one text each, after :meth:`validate_in`.

        Parameters
        ----------
        steps : for each input that is wired, how long each of its numbers stays the same (s): 0
            where it moves between ticks, infinity where it is constant.
        """
        return ()

    def start(self, state: BlockState) -> None:
        """Fill the state, which is all zeros, before the first tick."""

    def resume(self, state: BlockState) -> None:
        """Bring what ``start`` derived into line with states that come from an earlier run."""

    def before_differences(self, state: BlockState) -> None:
        """Prepare a state for a linearization, where outputs choose by the data what they compute:
        a state that moves alone would choose otherwise."""

    def facts(self, state: BlockState) -> Mapping[str, float]:
        """Numbers about the started block that ``runtime explain`` shows, by name."""
        return {}

    def watch(self, state: BlockState) -> float:
        """A magnitude that :meth:`diagnose` receives as of eight evenly spaced times of a run."""
        return 0.0

    def diagnose(self, state: BlockState, ticks: int, watched: tuple[float, ...]) -> Iterable[str]:
        """What looks wrong after a run, one text with its number for each; called once.

        ``state`` is as the run left it, ``ticks`` are those of this block, and ``watched`` are
        the values of :meth:`watch`, fewer than eight if the run broke off.
        """
        return ()

    @property
    def variables(self) -> dict[str, SignalType]:
        """Type variables that the block's own parameters determine."""
        stated = self.__dict__.get(STATED)
        return {} if stated is None else {self.spec.generic: stated}

    def port_type(self, name: str) -> PortType:
        """The type of a port; parameters may determine another than the declared one."""
        return self.spec.ports[name].type

    def port_unit(self, name: str) -> str:
        """The unit of a port; parameters may determine another than the declared one."""
        return self.spec.ports[name].unit

    @property
    def evaluations(self) -> tuple[Evaluation, ...]:
        """The calls of output methods, without the inputs that are :attr:`indirect`."""
        left = self.indirect
        if not left:
            return self.spec.evaluations
        return tuple(
            replace(each, needs=tuple(port for port in each.needs if port not in left))
            for each in self.spec.evaluations
        )

    @property
    def indirect(self) -> tuple[str, ...]:
        """Inputs on which no output depends directly, with the block's parameters.

        An output method that names one of them gives it a default and is called without it, as
        that of a linear system with D = 0.
        """
        return ()

    @property
    def state_names(self) -> Mapping[str, tuple[str, ...]]:
        """Names of the components of continuous states that have some, by state."""
        return {}

    def couplings(self, context: BlockContext) -> Sequence[Collection[int]] | None:
        """For each of its continuous states, in order and each component counted, of which of them
        its rate of change is a direct function, not through inputs; None: of all.

        An implicit solver calls a block less often, the fewer they are.
        """
        return None

    def stack_key(self, context: BlockContext) -> Hashable:
        """What blocks share that :meth:`stacked` computes together; None: each is called alone."""
        return None

    @classmethod
    def stacked(
        cls,
        blocks: Sequence[Any],
        states: Sequence[BlockState],
        arrays: Mapping[str, FloatArray],
    ) -> Any:
        """An object that does in one call what ``output`` and ``update`` of several blocks do, with
        the same bits; made after all have started.

        Parameters
        ----------
        blocks : of this class, with equal keys, types of ports and shapes of states.
        arrays : their states, a row per block: what each block has of them is a view of its row.

        Its methods take t and, for each port, the values of all blocks in order: of numbers a
        tuple, of arrays one flat array, of a variadic port a tuple of flat arrays, with zeros for
        blocks with fewer wires. An output is a new array with a row per block.
        """
        raise NotImplementedError

    # Any: the type of a parameter is known to its annotation, not to its name.
    def value(self, name: str) -> Any:
        """A parameter's value by its name in graphs."""
        return self.__dict__[self.spec.attributes[name]]

    def is_tunable(self, path: str) -> bool:
        """Whether a parameter may change during a run: ``q``, ``q[1]``, ``learning.tau``."""
        name, *inner = re.findall(r"[^.\[\]]+", path) or [""]
        declared = self.spec.params.get(name)
        if declared is None or declared.tunable or not inner:
            return declared is not None and declared.tunable
        settings = getattr(self.value(name), "declared", {})
        return inner[0] in settings and settings[inner[0]].tunable

    def sizes(self) -> dict[str, int]:
        """Lengths that integer parameters give to ports and states that name them."""
        return {
            name: self.value(name)
            for name, declared in self.spec.params.items()
            if declared.kind == "int" and self.spec.attributes[name] in self.__dict__
        }

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        """Lengths of states, those included that depend on the step or on types."""
        return self.sizes()

    def parameters(self) -> dict[str, Any]:
        """The parameters that differ from their defaults, as plain Python values."""
        written = {}
        for name, declared in self.spec.params.items():
            value = plain(self.value(name))
            if declared.required or value != plain(declared.convert(declared.default)):
                written[name] = value
        return written

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(
            f"{type(self).__name__} cannot change after construction; make another one, "
            f"and keep what changes in a State (attribute '{name}')"
        )

    def __delattr__(self, name: str) -> None:
        raise AttributeError(f"{type(self).__name__} cannot change after construction")

    def __eq__(self, other: object) -> bool:
        # By what is written: arrays have no truth value, and defaults need not be equal objects.
        return type(self) is type(other) and self.parameters() == other.parameters()

    def __hash__(self) -> int:
        return hash((type(self), repr(self.parameters())))

    def __repr__(self) -> str:
        inside = ", ".join(f"{k}={v!r}" for k, v in self.parameters().items())
        return f"{type(self).__name__}({inside})"
