"""What blocks of FMUs share: ports from the description, and a memory that the engine owns.

An FMU keeps its state to itself. Where it can write it as bytes, these are a declared state of the
block, so that snapshots, checkpoints and branches of a run have it; where it cannot, the block
counts its steps, and a run that goes back is an error::

    memory   [number of bytes, bytes as numbers ...]     steps   [17.0]
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from blocks.core import (
    Block,
    BlockContext,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Same,
    Scalar,
    SignalType,
    State,
    Vector,
    param,
    require,
)
from spikeblocks.fmu.description import Description, Variable, described
from spikeblocks.fmu.instance import SERIALIZE, Instance

SPARE = 64  # bytes that a state may be longer later than at the start


class ImportedFMU(Block, ABC):
    """An FMU as a block: its inputs are the components of ``u``, its outputs those of ``out``."""

    kind: ClassVar[str]
    other: ClassVar[str]
    executes = "the library in the FMU"

    inputs = Input(
        Scalar,
        variadic=True,
        spread="inputs",
        name="u",
        doc="the FMU's inputs in order: numbers, records or vectors, taken apart",
    )
    out = Output(Same("T"), doc="the FMU's outputs in order, by name")

    path: str = param(name="file", doc="an .fmu file, relative to the graph's own")
    values: Mapping[str, float] = param(
        {}, doc="start values of the FMU's variables by name, such as its parameters"
    )
    feedthrough: bool = param(
        True,
        doc="whether outputs are computed from inputs of the same tick, if the FMU does not deny "
        "it; false breaks a loop",
    )

    memory = State("bytes", name="memory", doc="the FMU's own state, if it can write it")
    steps = State(1, name="steps", doc="steps since the start")

    def validate(self) -> None:
        own = self.description
        if self.kind not in own.kinds:
            others = ", ".join(own.kinds) or "neither co-simulation nor model exchange"
            message = f"the FMU is for {others}"
            raise ParameterError(
                [("file", f"{message}; use type: {self.other}" if own.kinds else message)]
            )
        for name in self.values:
            own.variable(name)
        if not own.of("output"):
            raise ParameterError([("file", "the FMU has no outputs that are numbers")])

    def validate_in(self, context: BlockContext) -> None:
        names = component_names(self.description.of("input"))
        count = context.count("u")
        if count != len(names):
            expected = f"expected {len(names)} components, {', '.join(names)}" if names else "none"
            raise ParameterError([("u", f"{expected}; got {count}")])
        require("fmpy", type(self).__name__, "fmu")

    @property
    def description(self) -> Description:
        """What the FMU says of itself."""
        return described(self.path)

    @property
    def files(self) -> Mapping[str, bytes]:
        return {str(Path(self.path).resolve()): self.description.content}

    @property
    def variables(self) -> dict[str, SignalType]:
        results = self.description.of("output")
        units = [each.unit for each in results for _ in range(each.count)]
        rows = tuple(zip(component_names(results), units, strict=True))
        return {"T": replace(Scalar if len(rows) == 1 else Vector(len(rows)), rows=rows)}

    @property
    def indirect(self) -> tuple[str, ...]:
        depends = any(each.depends for each in self.description.of("output"))
        return () if self.feedthrough and depends and self.description.of("input") else ("u",)

    def sizes_in(self, context: BlockContext) -> dict[str, int]:
        made = self.begun()
        size = len(made.save())
        return {**self.sizes(), "bytes": 1 + -(-(size + SPARE) // 8) if size else 0}

    def begun(self) -> Instance:
        """An instance of the FMU at the start."""
        return Instance(self.description, self.kind, self.values)

    def start(self, state: BlockState) -> None:
        state.model = self.begun()
        state.form = state.context.types["out"]
        state.sources, state.results = self.description.of("input"), self.description.of("output")
        self.keep(state)

    def keep(self, state: BlockState) -> None:
        """Write the FMU's state into the memory that the engine owns."""
        model: Instance = state.model
        stored = model.save()
        if len(stored) > 8 * (len(state.memory) - 1) and stored:
            raise ArithmeticError(f"the FMU's state grew to {len(stored)} bytes during the run")
        model.stored, model.steps = stored, int(state.steps[0])
        if stored:
            state.memory[0] = len(stored)
            state.memory[1:].view(np.uint8)[: len(stored)] = np.frombuffer(stored, np.uint8)

    def at(self, state: BlockState) -> Instance:
        """The FMU in the state that the engine has: after a snapshot was restored, an earlier one.

        Raises
        ------
        ArithmeticError : it cannot go there.
        """
        model: Instance = state.model
        if len(state.memory):
            size = int(state.memory[0])
            stored = state.memory[1:].view(np.uint8)[:size].tobytes()
            if stored != model.stored:
                model.restore(stored)
                model.stored = stored
        elif model.steps != int(state.steps[0]):
            message = f"the FMU '{self.description.name}' cannot write its state ({SERIALIZE} is "
            message += "false), so that a run cannot go back, be copied, or go on from a checkpoint"
            raise ArithmeticError(message)
        return model

    @abstractmethod
    def ready(self, state: BlockState, t: float, u: tuple[float, ...]) -> Instance:
        """The FMU at a time with these inputs; without any, with those that it has."""

    def output(self, state: BlockState, t: float, u: tuple[float, ...] = ()) -> float | FloatArray:
        numbers = self.ready(state, t, u).get(state.results)
        return numbers[0] if state.form.form == "scalar" else np.array(numbers)


def component_names(variables: tuple[Variable, ...]) -> list[str]:
    """A name for each number, as addresses have them: ``tank.level[2]`` is tank_level_2."""
    names = []
    for each in variables:
        name = re.sub(r"\W+", "_", each.name, flags=re.ASCII).strip("_")
        names += [name] if each.count == 1 else [f"{name}_{i}" for i in range(each.count)]
    return names
