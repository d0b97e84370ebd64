"""Blocks taken through numba one by one, so that what fails has a name."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from blocks.block import Block, BlockState, Evaluation
from blocks.registry import BUILTIN
from blocks.signals import SignalType
from runtime.compiled import cache
from runtime.compiled.translate import NotCompilableError, Translated, translate
from runtime.network import Network

Signature = tuple[Any, ...]


@dataclass(frozen=True)
class Kernel:
    """A compiled block: where its functions are, what goes into them, what must be made of
    what comes out (statements with ``{0}``, ``{1}`` for the outputs, by method).
    """

    module: str
    methods: dict[str, str]
    fields: tuple[Any, ...]
    casts: dict[str, list[str]] = field(default_factory=dict)


@dataclass
class Kernels:
    """The blocks of a graph: those that compile, and for the others why not."""

    compiled: dict[str, Kernel] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)


class KernelError(Exception):
    """A block that promises loops for the compiled engine, and does not compile."""


def is_promised(cls: type[Block]) -> bool:
    """Whether a block class is written to be compiled: the library's, or one with loops."""
    return cls.__name__ in BUILTIN or any(name.startswith(("loop_", "_loop_")) for name in dir(cls))


def make_kernels(
    network: Network, states: dict[str, BlockState], note: Callable[[str], None]
) -> Kernels:
    """Compile every block that has anything to do in a tick.

    Parameters
    ----------
    states : after ``start``.
    note : called with a line of text when something is compiled, and so takes a while.
    """
    kernels = Kernels()
    for name, entry in sorted(network.entries.items()):
        calls = [e for e in entry.cls.spec.evaluations if not _constant(entry.cls, e)]
        calls += [entry.cls.spec.update] if entry.cls.spec.update else []
        if not calls:
            continue
        terms = {
            port: sum(w.block == name and w.port == port for w in network.wires)
            for port, declared in entry.cls.spec.inputs.items()
            if declared.many
        }
        try:
            made = translate(
                entry.made, states[name], terms, safe=entry.cls.__module__.split(".")[0] != "blocks"
            )
            kernels.compiled[name] = _kernel(network, name, calls, terms, made, note)
        except NotCompilableError as error:
            kernels.refused[name] = str(error)
    return kernels


def _constant(cls: type[Block], evaluation: Evaluation) -> bool:
    return all(cls.spec.outputs[port].constant for port in evaluation.outputs)


def _kernel(
    network: Network,
    name: str,
    calls: list[Evaluation],
    terms: dict[str, int],
    made: Translated,
    note: Callable[[str], None],
) -> Kernel:
    """One block's kernel; what numba said of the same text and types before is looked up."""
    from numba import typeof

    module = cache.module("block", made.text)
    signatures = {call.method: tuple(_arguments(network, name, call, terms)) for call in calls}
    fields = typeof(made.fields)
    key = cache.digest(made.text, str(fields), repr(signatures))
    path = cache.folder() / f"verdict_{key}.json"
    if path.exists():
        verdict = json.loads(path.read_text(encoding="utf-8"))
    else:
        note(f"compiling {network.entries[name].cls.__name__} '{name}'")
        verdict = _verdict(network, name, calls, made, module, fields, signatures)
        cache.write(path.name, json.dumps(verdict))
    if "refused" in verdict:
        raise NotCompilableError(verdict["refused"])
    return Kernel(module.__name__, made.methods, made.fields, verdict["casts"])


def _verdict(
    network: Network,
    name: str,
    calls: list[Evaluation],
    made: Translated,
    module: Any,
    fields: Any,
    signatures: dict[str, Signature],
) -> dict[str, Any]:
    """Compile a block's functions; returns the casts that their results need, or why not."""
    from numba import types
    from numba.core.errors import NumbaError

    casts = {}
    for call in calls:
        function = getattr(module, made.methods[call.method])
        signature = (fields, types.float64, *signatures[call.method])
        try:
            function.compile(signature)
        except (NumbaError, NotImplementedError) as error:
            return {"refused": f"{call.method}: {_reason(error)}"}
        if call.outputs:
            returned = function.overloads[signature].signature.return_type
            kinds = [network.types[name, port] for port in call.outputs]
            try:
                casts[call.method] = list(_casts(kinds, returned))
            except NotCompilableError as error:
                return {"refused": f"{call.method}: {error}"}
    return {"casts": casts}


def _reason(error: Exception) -> str:
    """What numba says, in one screen: its own words without the traces."""
    lines = [line.rstrip() for line in str(error).split("\n")]
    kept = [line for line in lines if line and not line.startswith(("During:", "Failed in"))]
    return "\n    ".join(kept[:12])


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
            yield types.UniTuple(numba_type(kind), terms[port]) if terms[port] else types.Tuple(())
        else:
            yield numba_type(kind)


def _casts(kinds: list[SignalType], returned: Any) -> Iterator[str]:
    """Statements that give results the types of their signals.

    Raises
    ------
    NotCompilableError : a result is something else altogether.
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
            yield f"{{{i}}} = ascontiguousarray({{{i}}})"
        else:
            raise NotCompilableError(f"returns {part}, expected {kind.held_as}")
