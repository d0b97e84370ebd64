"""Runs the compiled plan for the engine, and locates where it stopped.

In go a program and the states of a run, out comes a runner: the plan's text is compiled with the
kernels of its blocks, or found in the cache, and its struct filled with their addresses.
``runner.run(1, 1000, held)`` runs ticks 1 to 999 and returns the variables that outlive them.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from blocks.core import BlockState
from runtime.codegen import support
from runtime.compiler import Kernel, plain
from runtime.engine.compiled.c_plan import INTEGRATE, PlanText, c_plan
from runtime.engine.compiled.kernels import Kernels, make_kernels
from runtime.engine.compiled.memory import Context, Words
from runtime.engine.compiled.signals import FAILED, FINISHED, NOT_FINITE, STOPPED, UNSOLVED
from runtime.engine.program import Program
from runtime.engine.runners import CompiledError, RunContext
from runtime.engine.state import Array, Held
from runtime.network import Network
from runtime.plan import Call, Integrate, Port, calls_in
from runtime.toolchain import QUICK, THOROUGH, Builder, BuildError, TranslationUnit, folder

DRIVER = "<the loop around the compiled plan>"
PLAN = "the plan"
# A plan of at most this many evaluations contains its small blocks. In chains of Gain, a tick then
# takes half as long; of more evaluations, the compiler takes seconds.
INLINED = 200


@dataclass(frozen=True)
class Template:
    """What the compiled runs of a program share: its kernels, the plan's text and its function."""

    kernels: Kernels
    text: PlanText
    function: Callable[..., int]
    compiled: tuple[str, ...]


# The last template of each plan, by its first program; it may not fit the next seed or numbers.
_latest: WeakKeyDictionary[Program, dict[bool, Template]] = WeakKeyDictionary()


def template(
    program: Program,
    states: Mapping[str, BlockState],
    note: Callable[[str], None],
    checked: bool = False,
) -> Template:
    """The template of a program: the last one if it fits these states, or a new one.

    Parameters
    ----------
    states : after ``start``.
    note : called with a message for the user when something is compiled.
    checked : with a check of every index that may be outside of its array.
    """
    known = _latest.setdefault(program.origin, {}).get(checked)
    entries = program.network.entries
    if known is not None and all(
        kernel.fitting(entries[name].block, states[name]) is not None
        for name, kernel in known.kernels.compiled.items()
    ):
        return known
    with Builder() as builder:

        def begin(kernel: Kernel) -> None:
            if not (kernel.is_small and _is_inlined(program)):
                builder.begin(kernel.unit)

        kernels = make_kernels(program.network, states, checked, begin)
        for name in sorted(kernels.broken):
            note(f"block '{name}' is called from Python: {kernels.refused[name]}")
        made = _build(program, kernels, builder, note)
    _latest[program.origin][checked] = made
    return made


def _build(
    program: Program, kernels: Kernels, builder: Builder, note: Callable[[str], None]
) -> Template:
    """Compile and load; a unit that the C compiler does not accept is called from Python."""

    def tell(names: tuple[str, ...]) -> None:
        note(f"compiling {', '.join(names)} (once: kept in {folder()})")

    inside = _is_inlined(program)
    while True:
        small, others = _divide(kernels) if inside else ({}, kernels.compiled)
        text = c_plan(program.plan, program.names, {**others, **small})
        texts = dict.fromkeys(kernel.text for kernel in small.values())
        level = THOROUGH if small else QUICK
        plan = TranslationUnit(PLAN, _whole([*texts, text.text]), level)
        units = {kernel.text: kernel.unit for kernel in others.values()}
        try:
            library = builder.build(
                [plan, *(solver.unit for solver in text.solvers), *units.values()], tell
            )
        except BuildError as error:
            if error.unit == PLAN and small:
                inside = False  # compiled one by one, errors name their block
                continue
            bad = [n for n, kernel in kernels.compiled.items() if kernel.name == error.unit]
            if not bad:
                raise
            for name in bad:
                kernels.refuse(name, program.network.entries[name].cls, str(error))
            continue
        function = library.functions.run
        function.argtypes = [*[ctypes.c_void_p] * 3, *[ctypes.c_int64] * 4]
        function.restype = ctypes.c_int64
        return Template(kernels, text, function, library.compiled)


def _whole(texts: Sequence[str]) -> str:
    """The text of the plan's unit."""
    text = "\n".join(texts)
    return f"{support(text)}\n{text}"


def _is_inlined(program: Program) -> bool:
    """Whether small blocks are part of the plan's unit."""
    updates = sum(entry.cls.spec.update is not None for entry in program.network.entries.values())
    return len(program.plan.evaluations) + updates <= INLINED


def _divide(kernels: Kernels) -> tuple[dict[str, Kernel], dict[str, Kernel]]:
    """The small blocks as the plan's unit contains them, and the others."""
    prefixes: dict[str, str] = {}
    small, others = {}, {}
    for name, kernel in kernels.compiled.items():
        if kernel.is_small:
            prefix = prefixes.setdefault(kernel.text, f"block_{len(prefixes)}")
            small[name] = kernel.enclosed(prefix)
        else:
            others[name] = kernel
    return small, others


class CompiledRunner:
    """Runs the compiled plan of one run.

    Parameters
    ----------
    checked : with a check of every index that may be outside of its array.

    ``numbers`` are the signals of the plan, which move; ``places`` are addresses, which do not.
    """

    checked = False

    def __init__(self, context: RunContext) -> None:
        self.context = context
        self.network = context.program.network
        made = template(context.program, context.states, context.note, self.checked)
        self.kernels, self.text = made.kernels, made.text
        self.function = made.function
        self.held = list(context.program.held)
        self.struct = self.text.struct
        self.numbers: Array = np.zeros(max(1, self.struct.size))
        self.places = Words(self.struct.words)
        self.blocks: Collection[str] = self.kernels.compiled.keys()
        self.reads = [r for k in self.kernels.compiled.values() for r in k.inputs.reads]
        self.memory = Context()
        # The structs of blocks, in memory of their own or as a copy in that of the plan.
        self.fields: dict[str, Words] = {}
        self.constants: dict[Port, Array] = {}
        for name, to in self.struct.pointers.items():
            self._pointer(name, *to)
        for block in self.struct.inside.values():
            self.fields[block] = Words(len(self.kernels.compiled[block].words))
        for owner in self.fields:
            entry, kernel = self.network.entries[owner], self.kernels.compiled[owner]
            self._fill(owner, kernel.fields(entry.block, context.states[owner]))
        self.addresses = (self.numbers.ctypes.data, self.places.address, self.memory.address)
        self.slow = [signal.key for signal in context.program.plan.held]
        self.drive = self._driver() if self.text.driver else partial(self._part, low=0, high=1)

    def _pointer(self, name: str, kind: str, owner: str, state: str) -> None:
        """Fill a member of the plan's places that is an address."""
        at, _ = self.struct.places[name]
        if kind == "fields":
            self.fields[owner] = Words(len(self.kernels.compiled[owner].words))
            self.places.point(at, self.fields[owner].ints)
            return
        value = self.context.namespace[owner] if kind == "array" else None
        if kind == "signal":
            value = self.context.namespace[self.context.program.names.signals[owner, state]]
            value = self.constants[owner, state] = np.array(value, dtype=np.float64, ndmin=1)
        if kind == "open":
            value = np.full(*self.struct.defaults[name])
        if kind == "initial":
            copies = self.context.program.names.initial[owner]
            value = getattr(self.context.namespace[copies], state)
        if kind == "state":
            value = plain(getattr(self.context.states[owner], state), f"state.{state}")
        self.places.point(at, np.asarray(value))

    def _fill(self, name: str, values: tuple[Any, ...]) -> None:
        """Fill the struct of a block."""
        words = self.fields[name]
        words.fill(values)
        for member, inside in self.struct.inside.items():
            if inside == name:
                start, size = self.struct.places[member]
                self.places.ints[start : start + size] = words.ints

    def retune(self, network: Network, name: str) -> bool:
        """Take over a block's new numbers; False if its compiled text has the old ones."""
        return not self._is_called(name) and self._take_over(network, name)

    def begin_again(
        self, network: Network, changed: Collection[str], anew: Collection[str]
    ) -> bool:
        """Take over the numbers of a run that begins again; False if a new runner is needed."""
        if any(map(self._is_called, changed)) or not self.is_current:
            return False
        self.memory.begin()
        return all(self._take_over(network, name) for name in anew)

    @property
    def is_current(self) -> bool:
        """Whether the globals and functions that were translated are still the same."""
        return not any(read.has_changed for read in self.reads)

    def _is_called(self, name: str) -> bool:
        """Whether a block is called from Python in a tick."""
        return name not in self.kernels.compiled and any(
            not call.gate.once for call in self._calls(name)
        )

    def _take_over(self, network: Network, name: str) -> bool:
        """Take over a block's numbers; False if its compiled text has the old ones."""
        block, kernel = network.entries[name].block, self.kernels.compiled.get(name)
        values = None if kernel is None else kernel.fitting(block, self.context.states[name])
        if kernel is not None and values is None:
            return False
        self.network = network
        if values is not None and name in self.fields:
            self._fill(name, values)
        for (owner, port), array in self.constants.items():
            if owner == name:
                value = self.context.namespace[self.context.program.names.signals[name, port]]
                array[...] = np.array(value, dtype=np.float64, ndmin=1)
        return True

    def _calls(self, name: str) -> list[Call]:
        """The calls of a block in a tick, those between ticks included."""
        operations = self.context.program.plan.operations
        between = [each.between for each in operations if isinstance(each, Integrate)]
        return [c for part in (operations, *between) for c in calls_in(part) if c.block == name]

    def store(self, member: str, value: Any) -> None:
        """Write an output into the plan's struct."""
        start, size = self.struct.members[member]
        flat = np.ravel(value)
        self.numbers[start : start + min(size, flat.size)] = flat

    def read(self, block: str, port: str) -> Any:
        """An output in the form that Python blocks take; an array is a read-only copy."""
        if (block, port) in self.struct.outside:
            return self.context.namespace[self.context.program.names.signals[block, port]]
        kind = self.network.types[block, port]
        start, size = self.struct.members[self.struct.signals[block, port]]
        if kind.form == "scalar":
            return float(self.numbers.item(start))
        row = self.numbers[start : start + size]
        if kind.form == "record":
            return tuple(row.tolist())
        copy = row[: int(np.prod(kind.shape))].reshape(kind.shape).copy()
        copy.setflags(write=False)
        return copy

    def adopt(self, held: Held) -> Held:
        """Take over the first tick's variables."""
        for end, value in zip(self.slow, held, strict=True):
            member = self.struct.signals.get(end)
            if member is not None:
                self.store(member, value)
        return held

    def run(self, first: int, last: int, held: Held) -> Held:
        """Run ticks; the variables that it returns are for the engine, not for the next call."""
        self.drive(first, last)
        return tuple(self.read(*end) for end in self.slow)

    def integrate(self, scope: dict[str, Any]) -> bool:
        """Integrate the first tick, if that is compiled; ``scope`` are its variables."""
        if not self.text.integrates:
            return False
        names = self.context.program.names.signals
        known = {key: names[key] for key in self.struct.signals if names[key] in scope}
        for key, name in known.items():
            self.store(self.struct.signals[key], scope[name])
        self._part(0, 1, low=INTEGRATE, high=INTEGRATE)
        scope |= {name: self.read(*key) for key, name in known.items()}
        return True

    def _part(self, first: int, last: int, low: int, high: int) -> None:
        ended = self.function(*self.addresses, first, last, low, high)
        if ended not in (FINISHED, STOPPED):
            raise self._failure(ended)

    def _failure(self, ended: int) -> CompiledError:
        """Where compiled code stopped, and what it met there."""
        tick = self.memory.tick
        if ended not in (FAILED, NOT_FINITE):
            what = "an algebraic loop without a solution"
            what = what if ended == UNSOLVED else "rates of change that it cannot integrate"
            return CompiledError("", tick, what)
        call = self.text.calls[self.memory.at]
        if ended == NOT_FINITE:
            return CompiledError(call.block, tick, f"an output of {call.method} not finite")
        name, message, file, line = self.kernels.compiled[call.block].failures[self.memory.failure]
        numbers = {"index": self.memory.index, "size": self.memory.size, "axis": self.memory.axis}
        for key, value in numbers.items():
            message = message.replace(f"{{{key}}}", str(value))
        return CompiledError(call.block, tick, f"{name}: {message} ({file}:{line})")

    def _driver(self) -> Callable[[int, int], None]:
        ends = {member: end for end, member in self.struct.signals.items()}
        own = {"run": self._part, "store": self.store, "read": lambda name: self.read(*ends[name])}
        scope = {**self.context.namespace, **own}
        exec(compile(self.text.driver, DRIVER, "exec"), scope)
        drive: Callable[[int, int], None] = scope["drive"]
        return drive

    def locate(self, error: BaseException) -> tuple[int, str] | None:
        """The tick and the block that raised an exception; None if it was between two calls."""
        if isinstance(error, CompiledError):  # raised again, perhaps, from elsewhere
            return error.tick, error.block
        trace, is_inside = error.__traceback__, False
        while trace is not None:
            if trace.tb_frame.f_code.co_filename == DRIVER and trace.tb_lineno in self.text.lines:
                tick = int(trace.tb_frame.f_locals.get("k", self.memory.tick))
                return tick, self.text.lines[trace.tb_lineno]
            is_inside |= trace.tb_frame.f_code.co_filename == __file__
            trace = trace.tb_next
        if not is_inside:
            return None
        return self.memory.tick, self.text.calls[self.memory.at].block if self.text.calls else ""


class CheckedRunner(CompiledRunner):
    """Runs a plan that checks every index that may be outside of its array."""

    checked = True
