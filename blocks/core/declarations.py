"""What a block class declares: ports, states, and a specification of both with parameters."""

from __future__ import annotations

import dis
import inspect
import types
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from blocks.core.params import Param
from blocks.core.signals import PortType, Same, SignalType


@dataclass(frozen=True)
class Input:
    """An input port.

    ``default`` is the value of every component of an input that is not wired; an input without a
    default must be wired. A ``variadic`` input takes any number of wires, none included, or as many
    as the integer parameter that it names; the block receives a tuple. With ``spread``, such an
    input takes numbers, records and vectors alike, and the block receives all their components
    in order as one tuple of numbers; ``spread`` names the length symbol that their number gives.
    With ``fills``, a number that is wired to a vector counts for all its components; the compiled
    block receives it as a vector of one number.
    """

    type: PortType
    doc: str = ""
    unit: str = ""
    default: float | None = None
    variadic: bool | str = False
    spread: str = ""
    fills: bool = False
    name: str = ""

    @property
    def optional(self) -> bool:
        return bool(self.variadic) or self.default is not None


@dataclass(frozen=True)
class Output:
    """An output port.

    ``through`` names the input that replaces it under ``bypass``. A ``constant`` output never
    changes during a run: it is computed and recorded once. ``publishes`` names a method of (state)
    that returns a static description of the signal, such as the tuning of the neurons behind
    spikes: a consumer finds it in ``state.published`` when it starts. The lengths in ``carries``
    travel along the wire, too, and are known when the consumer's own lengths are inferred.
    ``label`` is what figures call a scalar, which may be a formula as ``$e_p$``.
    """

    type: PortType
    doc: str = ""
    unit: str = ""
    through: str = ""
    constant: bool = False
    name: str = ""
    label: str = ""
    publishes: str = ""
    carries: tuple[str, ...] = ()


@dataclass(frozen=True, init=False)
class State:
    """An array that the engine owns on behalf of the block and that a probe may record.

    The shape consists of numbers, names of integer parameters and length symbols of ports, as in
    ``State(2, 3)`` or ``State("n")``; ``State((2, 3))`` is the same. ``like`` appends the shape of
    a port's signal. A probe records a state before the tick's update; an ``event``, which is what
    happened in the tick, after it.
    A ``cached`` state saves an output from repeating a computation: outputs may write it, and must
    return the same values without it.
    A ``continuous`` state is integrated from tick to tick by the run's solver, together with those
    of all other blocks; the block's ``derivative`` returns its rate of change.
    The rows of a ``ring`` are written in turn: it names the state with the number of the next one.
    """

    shape: tuple[int | str, ...]
    like: str = ""
    doc: str = ""
    unit: str = ""
    name: str = ""
    signal: SignalType | None = None
    event: bool = False
    cached: bool = False
    continuous: bool = False
    ring: str = ""

    def __init__(
        self,
        *shape: int | str | tuple[int | str, ...],
        like: str = "",
        doc: str = "",
        unit: str = "",
        signal: SignalType | None = None,
        event: bool = False,
        cached: bool = False,
        continuous: bool = False,
        ring: str = "",
        name: str = "",
    ) -> None:
        if len(shape) == 1 and isinstance(shape[0], (tuple, list)):
            shape = tuple(shape[0])  # State((2, 3)), as NumPy writes shapes
        self.__dict__.update(shape=shape, like=like, doc=doc, unit=unit, name=name)
        self.__dict__.update(signal=signal, event=event, cached=cached, continuous=continuous)
        self.__dict__["ring"] = ring


@dataclass(frozen=True)
class Evaluation:
    """One call of the plan: a method, the ports it needs, and the outputs it computes."""

    method: str
    needs: tuple[str, ...]
    outputs: tuple[str, ...] = ()
    function: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Without the function, which another process may not be able to import."""
        return {**self.__dict__, "timed": self.timed, "function": None}

    @cached_property
    def timed(self) -> bool:
        """Whether the method, or a function inside it, reads ``t``; True if nobody can tell."""
        code = getattr(inspect.unwrap(self.function), "__code__", None) if self.function else None
        if code is None:
            return True
        # By its code: a name t that is never read makes no signal of time, and a block without one
        # need not be evaluated between ticks.
        waiting: list[types.CodeType] = [code]
        while waiting:
            code = waiting.pop()
            for instruction in dis.get_instructions(code):
                read = instruction.argval if isinstance(instruction.argval, tuple) else ()
                if "LOAD" in instruction.opname and "t" in (instruction.argval, *read):
                    return True
            waiting += [each for each in code.co_consts if isinstance(each, types.CodeType)]
        return False


@dataclass(frozen=True)
class BlockSpec:
    """Everything that a block class declares, by name, in the order of declaration."""

    inputs: Mapping[str, Input] = field(default_factory=dict)
    outputs: Mapping[str, Output] = field(default_factory=dict)
    states: Mapping[str, State] = field(default_factory=dict)
    params: Mapping[str, Param] = field(default_factory=dict)
    attributes: Mapping[str, str] = field(default_factory=dict)
    evaluations: tuple[Evaluation, ...] = ()
    update: Evaluation | None = None
    derivative: Evaluation | None = None
    projects: bool = False
    guards: Evaluation | None = None
    event: Evaluation | None = None

    @property
    def continuous(self) -> tuple[str, ...]:
        """The names of the continuous states, in the order in which ``derivative`` returns them."""
        return tuple(name for name, state in self.states.items() if state.continuous)

    @property
    def through(self) -> tuple[str, str] | None:
        """(input, output) of the declared pass-through pair, which ``bypass`` connects."""
        pairs = [(port.through, name) for name, port in self.outputs.items() if port.through]
        return pairs[0] if pairs else None

    def is_constant(self, evaluation: Evaluation) -> bool:
        """Whether an evaluation is performed once, before the first tick."""
        return all(self.outputs[port].constant for port in evaluation.outputs)

    @property
    def generic(self) -> str:
        """The type variable of a block whose generic ports share one; '' if there is none."""
        variables = {p.type.variable for p in self.ports.values() if isinstance(p.type, Same)}
        return variables.pop() if len(variables) == 1 else ""

    @property
    def ports(self) -> dict[str, Input | Output]:
        """Inputs and outputs by name."""
        return {**self.inputs, **self.outputs}
