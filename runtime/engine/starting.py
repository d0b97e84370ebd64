"""The start of a run: initial states, constant outputs, and the names that a plan's text uses.

In: a program and a run's state whose arrays are zero. Out: states as blocks' ``start`` leaves them,
and the namespace in which the plan's text is executed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Container, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from blocks.core import FloatArray, ParameterError
from runtime.engine.events import SIDE, UNKNOWN
from runtime.engine.loops import loop_names
from runtime.engine.naming import GLOBALS
from runtime.engine.program import Program
from runtime.engine.rosenbrock import STRUCTURE, implicit
from runtime.engine.state import RunState
from runtime.engine.steps import accept_step, blend, controls, joined, reject_step, substep
from runtime.engine.values import (
    OutputChecks,
    Zeros,
    bad_slope,
    event_names,
    sealed,
    unreached,
    wrong_initial,
)
from runtime.errors import Problem, SimulationError, raised_at, raised_text, text_of
from runtime.plan import Call, Record, Signal
from runtime.solvers import method_of


@dataclass
class Start:
    """Starts the blocks of a run.

    Parameters
    ----------
    arrays : that the probes fill.
    names : for the text of the plan, beside those that every plan has.
    """

    program: Program
    state: RunState
    checks: OutputChecks
    arrays: Mapping[str, FloatArray]
    names: Mapping[str, Any]
    namespace: dict[str, Any] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        self.network, self.plan = self.program.network, self.program.plan

    def all(self) -> dict[str, Any]:
        """Initialise the states, and compute the constant outputs; returns the namespace."""
        functions = (
            math.isfinite,
            math.isnan,
            np.vdot,
            np.array,
            np.full,
            np.concatenate,
            Zeros(),
            self.checks.forms,
            sealed,
            self.checks.not_finite,
            self.checks.floats,
            self.checks.several,
        )
        self.namespace.update(zip(GLOBALS, functions, strict=True))
        self.namespace |= {f"probe_{i}": array for i, array in enumerate(self.arrays.values())}
        self.namespace |= self.names
        self.namespace |= self._continuous_names()
        self.namespace |= loop_names(self.plan, self.state.arrays)
        if self.program.observation.stop is not None:
            self.namespace["stop"] = self.state.stop
        names = self.program.names
        for name, entry in self.network.entries.items():
            self.namespace[names.blocks[name]] = entry.block
            self.namespace[names.states[name]] = self.state.blocks[name]
        for name, initial in names.initial.items():
            shapes = {each.name: each.shape for each in self.plan.states[name]}
            arrays = {key: np.zeros(shape) for key, shape in shapes.items()}
            self.namespace[initial] = SimpleNamespace(**arrays)
        self.begin_again(self.network.entries)
        return self.namespace

    def begin_again(self, names: Container[str]) -> None:
        """Initialise these blocks, and compute what is constant of them."""
        for name in self._order:
            if name in names:
                self._block(name)
        for record in self.plan.records:
            if record.publisher and record.block in names:
                self._record_tuning(record)
        for name, initial in self.program.names.initial.items():
            # In place: compiled code has the addresses.
            for key, array in vars(self.namespace[initial]).items():
                array[...] = getattr(self.state.blocks[name], key)
        for call in self.plan.evaluations:
            if call.gate.once and call.block in names:
                self.compute_constants(call)

    def solve(self) -> list[Problem]:
        """What the blocks that solve for what others publish find wrong; starts only those.

        Such a block is a Decoder, whose system may be singular for the neurons of this seed.
        """
        problems: list[Problem] = []
        failed: set[str] = set()
        receive = {name: self.network.publications(name) for name in self.network.entries}
        publish = {source.block for found in receive.values() for _, source in found}
        for name in self._order:
            sources = {source.block for _, source in receive[name]}
            if not (name in publish or sources) or sources & failed:
                continue
            try:
                self._block(name)
            except SimulationError as error:
                failed.add(name)
                entry, cause = self.network.entries[name], error.__cause__
                if isinstance(cause, ParameterError):
                    problems += [entry.problem(*each) for each in cause.problems]
                else:
                    problems.append(Problem(entry.node.key, entry.address, str(error)))
        return problems

    @cached_property
    def _order(self) -> list[str]:
        """Blocks by name; those that publish descriptions before the others."""
        outputs = {n: e.cls.spec.outputs.values() for n, e in self.network.entries.items()}
        return sorted(outputs, key=lambda n: not any(port.publishes for port in outputs[n]))

    def _block(self, name: str) -> None:
        """Initialise one block's state, with what the outputs wired to it publish."""
        published = {}
        for port, source in self.network.publications(name):
            made = self.network.entries[source.block].block
            describe = getattr(made, type(made).spec.outputs[source.port].publishes)
            call = partial(describe, self.state.blocks[source.block])
            published[port] = self.guard(source.block, call)
        state = self.state.blocks[name]
        state.published = published
        block = self.network.entries[name].block
        self.guard(name, partial(block.start, state))
        if name in self.network.initial:
            for key, array in self.network.initial[name].items():
                wrong = wrong_initial(key, getattr(state, key), array)
                if wrong:
                    raise SimulationError(name, 0, 0.0, wrong)
                getattr(state, key)[...] = array
            self.guard(name, partial(block.resume, state))

    def guard(self, block: str, call: Callable[[], Any]) -> Any:
        """Call a method of a block; an exception becomes an error that names it."""
        try:
            return call()
        except KeyboardInterrupt:
            raise
        except ParameterError as error:
            entry = self.network.entries[block]
            texts = [str(entry.problem(parameter, text)) for parameter, text in error.problems]
            raise SimulationError(block, 0, 0.0, "; ".join(texts)) from error
        except BaseException as error:
            raise SimulationError(block, 0, 0.0, described(error)) from error

    def compute_constants(self, call: Call) -> None:
        """Call a method whose outputs never change, and record them."""
        method = getattr(self.network.entries[call.block].block, call.method)
        value = self.guard(call.block, partial(method, self.state.blocks[call.block], 0.0))
        values = (value,) if len(call.outputs) == 1 else value
        for signal, item in zip(call.outputs, values, strict=True):
            self.checks.form(signal.block, signal.port, item)
            if isinstance(item, np.ndarray):
                item = sealed(item)
            self.namespace[self.program.names.of(signal)] = item
            self._record_constant(signal, item)

    def _record_constant(self, signal: Signal, value: Any) -> None:
        for record in self.plan.records:
            if record.gate.once and not record.publisher and record.source.whole == signal:
                array, source = self.namespace[f"probe_{record.number}"], record.source
                item = value[source.columns] if source.component else value
                array[0 if record.columns is None else (0, record.columns)] = item

    def _record_tuning(self, record: Record) -> None:
        """Record what a block publishes about the neurons behind a signal."""
        block = record.block
        describe = getattr(self.network.entries[block].block, record.publisher)
        self.namespace[f"probe_{record.number}"][0] = describe(self.state.blocks[block]).table()

    def _continuous_names(self) -> dict[str, Any]:
        """What the text of a graph with continuous states refers to."""
        part = self.plan.integration
        if part is None:
            return {}
        size = part.row.size
        method = method_of(part.solver, part.colours)
        slopes = np.zeros((method.slope_rows(size), size))
        run, dt = self.network, self.network.dt
        control = self.state.arrays["run/control"]
        longest = min(dt, run.max_step or dt)
        control[:] = controls(run.rtol, run.atol, longest)
        if part.ends_steps:
            directions = part.directions
            sides = self.state.arrays["run/sides"]
            sides[:] = math.nan
            sides[SIDE] = np.where(directions > 1.0, -1.0, UNKNOWN)
        jacobian: dict[str, Any] = {}
        move: Callable[..., None] = blend
        if part.coupling is not None:
            jacobian = {name: getattr(part.coupling, name) for name in STRUCTURE}
            move = partial(implicit, **jacobian)
        return {
            **jacobian,
            **event_names(part, self.state.arrays),
            "states": self.state.continuous,
            "start": np.zeros(size),
            "slopes": slopes,
            "nodes": method.nodes,
            "weights": method.table if method.is_implicit else method.terms,
            "table": method.table,
            "blend": move,
            "joined": joined,
            "rates": self.checks.rates,
            "bad_slope": partial(bad_slope, part, slopes),
            "errors": np.array(method.errors),
            "control": control,
            "substep": substep,
            "accept_step": accept_step,
            "reject_step": reject_step,
            "unreached": partial(unreached, part, part.solver, control),
        }


def described(error: BaseException) -> str:
    """An exception in one line, with its location in the user's code."""
    place = raised_at(error)
    # Compiled text has no lines of its own.
    place = f" ({place})" if place and Path(place).parent.name != "compiled" else ""
    suggestion = ""
    if isinstance(error, ValueError) and "read-only" in text_of(error):
        suggestion = "; arrays that a block receives or has returned are read-only: write to a copy"
    return f"{raised_text(error, with_place=False)}{place}{suggestion}"
