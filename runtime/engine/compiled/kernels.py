"""Compiling blocks one by one, so that every failure names its block."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from blocks.core import Block, BlockState, Evaluation, SignalType, has_kernels
from blocks.registry import BUILTIN
from runtime.engine.compiled import cache
from runtime.engine.compiled.translate import NotCompilableError, Translated, translate
from runtime.engine.continuous import UNROLLED, slots
from runtime.network import Network

PROJECT = Evaluation("project", (), timed=False)
Signature = tuple[Any, ...]


@dataclass(frozen=True)
class Kernel:
    """A compiled block: the module of its functions, their text, and the casts of their results.

    ``casts`` are statements with ``{0}``, ``{1}`` for the outputs, by method.
    """

    module: str
    made: Translated
    casts: dict[str, list[str]] = field(default_factory=dict)

    @property
    def methods(self) -> dict[str, str]:
        """The name of each method's function in the module."""
        return self.made.methods

    def fields(self, block: Block, state: BlockState) -> tuple[Any, ...]:
        """The first argument of the functions in one run."""
        return self.made.fields(block, state)

    def fits(self, block: Block, state: BlockState) -> bool:
        """Whether the constants in the text have the same values in this run."""
        return self.made.fits(block, state)


@dataclass
class Kernels:
    """The blocks of a graph: those that compile, and the reasons why others do not.

    ``broken`` are those of the others that declare kernels.
    """

    compiled: dict[str, Kernel] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    broken: set[str] = field(default_factory=set)

    def refuse(self, name: str, cls: type[Block], error: Exception) -> None:
        """Store why a block is not compiled."""
        self.refused[name] = str(error)
        if has_kernels(cls):
            self.broken.add(name)


@dataclass(frozen=True)
class _Candidate:
    """A block to compile: its text, the types of its functions, the cache entry of the verdict."""

    name: str
    calls: list[Evaluation]
    made: Translated
    signatures: dict[str, Signature]
    verdict: str


def make_kernels(
    network: Network, states: Mapping[str, BlockState], note: Callable[[str], None]
) -> Kernels:
    """Compile every block that is evaluated or updated in a tick.

    Parameters
    ----------
    states : after ``start``.
    note : called with a message for the user when something is compiled.
    """
    kernels = Kernels()
    candidates = []
    for name, entry in sorted(network.entries.items()):
        spec = entry.cls.spec
        calls = [e for e in entry.evaluations if not spec.is_constant(e)]
        calls += [each for each in (spec.update, spec.derivative) if each is not None]
        calls += [PROJECT] if spec.projects else []
        if not calls:
            continue
        try:
            candidates.append(_candidate(network, name, calls, states[name]))
        except NotCompilableError as error:
            kernels.refuse(name, entry.cls, error)
    fresh = {
        network.entries[c.name].cls.__name__
        for c in candidates
        if cache.read_record(c.verdict) is None
    }
    if fresh:
        note(f"compiling {', '.join(sorted(fresh))} (once: kept in {cache.folder()})")
    for candidate in candidates:
        try:
            kernels.compiled[candidate.name] = _kernel(network, candidate)
        except NotCompilableError as error:
            kernels.refuse(candidate.name, network.entries[candidate.name].cls, error)
    return kernels


def _candidate(
    network: Network, name: str, calls: list[Evaluation], state: BlockState
) -> _Candidate:
    """A block's text and types, and the cache entry of the verdict on them."""
    from numba import typeof

    entry = network.entries[name]
    terms = {
        port: sum(w.block == name and w.port == port for w in network.driving)
        for port, declared in entry.cls.spec.inputs.items()
        if declared.variadic
    }
    made = translate(entry.made, state, terms, safe=not is_built_in(entry.cls))
    fields = typeof(made.fields(entry.made, state))
    signatures = {call.method: (fields, *_arguments(network, name, call, terms)) for call in calls}
    key = cache.digest(made.text, repr(signatures))
    return _Candidate(name, calls, made, signatures, f"verdict_{key}")


def _kernel(network: Network, candidate: _Candidate) -> Kernel:
    """One block's kernel; numba's verdict on the same text and types is cached."""
    module = cache.module("block", candidate.made.text)
    verdict = cache.read_record(candidate.verdict)
    if verdict is None:
        verdict = _verdict(network, candidate, module)
        cache.write_record(candidate.verdict, verdict)
    if "refused" in verdict:
        code = getattr(network.entries[candidate.name].cls, verdict["method"]).__code__
        place = f"{code.co_filename}:{code.co_firstlineno}"
        raise NotCompilableError(f"{verdict['method']} ({place}): {verdict['refused']}")
    return Kernel(module.__name__, candidate.made, verdict["casts"])


def is_built_in(cls: type[Block]) -> bool:
    """Whether a block class is built in."""
    return BUILTIN.get(cls.__name__) is cls


def _verdict(network: Network, candidate: _Candidate, module: ModuleType) -> dict[str, Any]:
    """Compile a block's functions; returns the casts of their results, or why it failed."""
    from numba import types
    from numba.core.errors import NumbaError

    casts = {}
    for call in candidate.calls:
        function = getattr(module, candidate.made.methods[call.method])
        fields, *inputs = candidate.signatures[call.method]
        signature = (fields, *(() if call is PROJECT else (types.float64,)), *inputs)
        try:
            function.compile(signature)
        except (NumbaError, NotImplementedError) as error:
            return {"method": call.method, "refused": _reason(error)}
        if call.outputs:
            returned = function.overloads[signature].signature.return_type
            kinds = [network.types[candidate.name, port] for port in call.outputs]
            try:
                casts[call.method] = list(_casts(kinds, returned))
            except NotCompilableError as error:
                return {"method": call.method, "refused": str(error)}
        if call.method == "derivative":
            returned = function.overloads[signature].signature.return_type
            message = _misfit(network, candidate.name, returned)
            if message:
                return {"method": call.method, "refused": message}
    return {"casts": casts}


def _misfit(network: Network, name: str, returned: Any) -> str:
    """Why the text of the plan cannot take apart what a derivative returns; '' if it can."""
    from numba import types

    shapes = [slot.shape for slot in slots(network) if slot.block == name]
    parts = [returned] if len(shapes) == 1 else list(getattr(returned, "types", ()))
    number = (types.Integer, types.Boolean, types.Float)
    for shape, part in zip(shapes, parts, strict=False):
        if len(shape) == 1 and isinstance(part, types.BaseTuple):
            good = all(isinstance(each, number) for each in part)
            good = good and (len(shape) <= UNROLLED or isinstance(part, types.UniTuple))
        elif shape:
            good = isinstance(part, types.Array) and part.ndim == len(shape)
        else:
            good = isinstance(part, number)
        if not good:
            return f"returns {part} as the rate of change of a state of shape {shape}"
    return "" if len(parts) == len(shapes) else f"returns {returned} for {len(shapes)} states"


def _reason(error: Exception) -> str:
    """numba's message in at most ten lines, without the frames of its passes."""
    lines = [line.rstrip() for line in str(error).split("\n")]
    skipped = ("During:", "Failed in", "There are", " - Of which", "Overload", "Typing", "raised")
    kept = [line for line in lines if line.strip() and not line.strip().startswith(skipped)]
    return "\n    ".join(kept[:10])


def numba_type(kind: SignalType) -> Any:
    """A signal's type in compiled text."""
    from numba import types

    if kind.form == "scalar":
        return types.float64
    if kind.form == "record":
        return types.UniTuple(types.float64, len(kind.components))
    return types.Array(types.float64, len(kind.shape), "C")


def _arguments(
    network: Network, name: str, call: Evaluation, terms: dict[str, int]
) -> Iterator[Any]:
    from numba import types

    for port in call.needs:
        kind = network.types[name, port]
        if port in terms:
            yield types.UniTuple(_input(kind), terms[port]) if terms[port] else types.Tuple(())
        else:
            yield _input(kind)


def _input(kind: SignalType) -> Any:
    """A signal's type as an input: arrays are read-only."""
    found = numba_type(kind)
    return found.copy(readonly=True) if kind.form == "array" else found


def _casts(kinds: list[SignalType], returned: Any) -> Iterator[str]:
    """Statements that cast results to the types of their signals.

    Raises
    ------
    NotCompilableError : a result has a type that cannot be cast.
    """
    from numba import types

    parts = [returned] if len(kinds) == 1 else list(getattr(returned, "types", ()))
    if len(parts) != len(kinds):
        raise NotCompilableError(f"returns {returned}, expected {len(kinds)} outputs")
    number = (types.Integer, types.Boolean, types.Float)
    for i, (kind, part) in enumerate(zip(kinds, parts, strict=True)):
        wanted = numba_type(kind)
        if part == wanted:
            continue
        if kind.form == "scalar" and isinstance(part, number):
            yield f"{{{i}}} = float({{{i}}})"
        elif (
            kind.form == "record"
            and isinstance(part, types.BaseTuple)
            and len(part) == len(kind.components)
            and all(isinstance(inner, number) for inner in part)
        ):
            inner = ", ".join(f"float({{{i}}}[{n}])" for n in range(len(part)))
            yield f"{{{i}}} = ({inner},)"
        elif kind.form == "array" and isinstance(part, types.Array) and part.ndim == wanted.ndim:
            copied = "ascontiguousarray({{{0}}})" if part.mutable else "{{{0}}}.copy()"
            yield f"{{{i}}} = " + copied.format(i)
        else:
            raise NotCompilableError(f"returns {part}, expected {kind.held_as}")
