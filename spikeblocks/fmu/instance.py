"""A running FMU: one interface to both versions and both kinds, on the package fmpy.

In goes a description, out comes an instance whose numbers are floats::

    model = Instance(described("tank.fmu"), "CoSimulation", {"area": 2.0})
    model.set(inputs, (0.5,))
    model.step(0.0, 0.01)
    model.get(outputs)          # (1.02,)
"""

from __future__ import annotations

import hashlib
import io
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from ctypes import POINTER, c_double
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray, ParameterError, require
from blocks.files import archive
from spikeblocks.fmu.description import UNPACKED, Description, Variable

TYPES = {"Enumeration": ("Integer", "Int64")}  # how values of a type are given
SERIALIZE = "canSerializeFMUState"


class Instance:
    """An FMU that was initialised at t = 0.

    kind : "CoSimulation" or "ModelExchange". values : start values by name.

    Raises
    ------
    MissingPackageError : fmpy is not installed.
    ParameterError : it has no binary for this computer, or refuses to begin.
    """

    def __init__(self, description: Description, kind: str, values: Mapping[str, float]) -> None:
        require("fmpy", "a block of an FMU", "fmu")
        self.description, self.kind = description, kind
        self.is_three = description.version == 3
        self.stored, self.steps, self.due = b"", 0, math.inf
        self.said: list[str] = []
        names = {"CoSimulation": "Slave", "ModelExchange": "Model"}
        module = require(f"fmpy.fmi{description.version}", "a block of an FMU", "fmu")
        try:
            made = getattr(module, f"FMU{description.version}{names[kind]}")(
                guid=description.token,
                unzipDirectory=_unpacked(description.content),
                modelIdentifier=description.kinds[kind]["modelIdentifier"],
                instanceName="model",
            )
            made.instantiate(**self._logging(module))
        except Exception as error:  # noqa: BLE001 -- what fmpy raises
            message = f"'{description.name}' does not load: {error}"
            raise ParameterError([("file", message)]) from None
        self.fmu: Any = made
        self._begin(values)

    def _logging(self, module: Any) -> dict[str, Any]:
        """What keeps the FMU's messages, instead of printing them."""
        if self.is_three:
            return {"logMessage": lambda *said: self.said.append(_text(said[-1]))}
        calls = module.fmi2CallbackFunctions()
        own = module.fmi2CallbackLoggerTYPE(lambda *said: self.said.append(_text(said[4])))
        free = require("fmpy", "a block of an FMU", "fmu")
        calls.logger = own
        calls.allocateMemory = module.fmi2CallbackAllocateMemoryTYPE(free.calloc)
        calls.freeMemory = module.fmi2CallbackFreeMemoryTYPE(free.free)
        # Not fmpy's addLoggerProxy, which would put the numbers into the texts: it has one pointer
        # for all FMUs of a process, and a message after the last one's end would crash Python.
        return {"callbacks": calls}

    def _begin(self, values: Mapping[str, float]) -> None:
        fmu, own = self.fmu, self.description
        starting = [(own.variable(name), value) for name, value in values.items()]
        try:
            if not self.is_three:
                fmu.setupExperiment(startTime=0.0)
            for variable, value in starting:
                self.set((variable,), (value,))
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        except ArithmeticError as error:
            raise ParameterError([("values", str(error))]) from None
        except Exception as error:  # noqa: BLE001 -- what fmpy raises
            raise ParameterError([("file", self._failed(error))]) from None

    def _failed(self, error: Exception) -> str:
        said = f": {self.said[-1]}" if self.said else ""
        return f"'{self.description.name}': {error}{said}"

    def call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """Call a function of the FMU.

        Raises
        ------
        ArithmeticError : it reports an error.
        """
        try:
            return function(*arguments)
        except Exception as error:  # noqa: BLE001 -- what fmpy raises
            raise ArithmeticError(self._failed(error)) from None

    def get(self, variables: Sequence[Variable]) -> tuple[float, ...]:
        """The numbers of variables, those of arrays in order."""
        found: list[float] = []
        for each in variables:
            get = getattr(self.fmu, f"get{self._type(each)}")
            counted = {"nValues": each.count} if self.is_three else {}
            found += map(float, self.call(lambda g=get, e=each, c=counted: g([e.reference], **c)))
        return tuple(found)

    def set(self, variables: Sequence[Variable], numbers: Sequence[float]) -> None:
        """Set the numbers of variables, those of arrays in order."""
        first = 0
        for each in variables:
            own = numbers[first : first + each.count]
            first += each.count
            is_real = each.kind in ("Real", "Float64", "Float32")
            if each.kind == "Boolean":
                own = [x > 0.5 for x in own]
            elif not is_real:
                own = [round(x) for x in own]
            self.call(getattr(self.fmu, f"set{self._type(each)}"), [each.reference], list(own))

    def _type(self, variable: Variable) -> str:
        two, three = TYPES.get(variable.kind, (variable.kind, variable.kind))
        return three if self.is_three else two

    # Co-simulation

    def step(self, t: float, dt: float) -> None:
        """Go on by a communication step.

        Raises
        ------
        ArithmeticError : the FMU refuses, or ends the simulation.
        """
        found = self.call(self.fmu.doStep, t, dt)
        if self.is_three and found[1]:
            raise ArithmeticError(f"'{self.description.name}' ends the simulation")

    # Memory

    def can(self, what: str) -> bool:
        return self.description.can(self.kind, what)

    def save(self) -> bytes:
        """All that its next step depends on."""
        if not self.can(SERIALIZE):
            return b""
        state = self.call(self.fmu.getFMUState)
        stored: bytes = self.call(self.fmu.serializeFMUState, state)
        self.call(self.fmu.freeFMUState, state)
        return stored

    def restore(self, stored: bytes) -> None:
        """Go back to what :meth:`save` returned, of this instance or of another one."""
        state = self.call(self.fmu.deserializeFMUState, stored)
        self.call(self.fmu.setFMUState, state)
        self.call(self.fmu.freeFMUState, state)

    # Model exchange

    def events(self) -> tuple[bool, float]:
        """Let events act, in event mode; whether states changed, and the time of the next one."""
        fmu, changed = self.fmu, False
        update = fmu.updateDiscreteStates if self.is_three else fmu.newDiscreteStates
        more = True
        while more:
            more, ends, _, states, is_timed, next_time = self.call(update)
            changed |= bool(states)
            if ends:
                raise ArithmeticError(f"'{self.description.name}' ends the simulation")
        self.call(fmu.enterContinuousTimeMode)
        return changed, next_time if is_timed else math.inf

    def numbers(self, function: str, count: int) -> FloatArray:
        """What a function of the FMU writes into an array."""
        found = np.zeros(count)
        if count:
            pointer = found.ctypes.data_as(POINTER(c_double))
            self.call(getattr(self.fmu, function), pointer, count)
        return found

    def place(self, t: float, x: FloatArray) -> None:
        """Set the time and the continuous states."""
        self.call(self.fmu.setTime, t)
        if len(x):
            own = np.ascontiguousarray(x, dtype=float)
            pointer = own.ctypes.data_as(POINTER(c_double))
            self.call(self.fmu.setContinuousStates, pointer, len(own))

    def __del__(self) -> None:
        with suppress(Exception):
            self.fmu.freeInstance()


def _text(said: Any) -> str:
    return said.decode("utf-8", "replace") if isinstance(said, bytes) else str(said)


@lru_cache(maxsize=16)
def _folder(key: str) -> tempfile.TemporaryDirectory[str]:
    return tempfile.TemporaryDirectory(prefix="fmu_")


def _unpacked(content: bytes) -> str:
    """A folder with the files of an FMU, as long as the process runs."""
    place = Path(_folder(hashlib.sha256(content).hexdigest()).name)
    if not (place / "modelDescription.xml").exists():
        with archive(io.BytesIO(content), UNPACKED) as members:
            # The description last, so that a folder with it is complete; it leaves out what leads
            # out of the folder.
            names = sorted(members.namelist(), key="modelDescription.xml".__eq__)
            members.extractall(place, names)
    return str(place)
