"""One block as a C unit: what the engine loads, and how it calls it.

In go a block, its state after ``start``, the types of its ports and the methods that are called;
out comes a :class:`Kernel`, from the cache where the same text was written before. The name of the
block's class and the reason are in every :class:`NotCompilableError`, so that a graph runs with
the block called from Python.

    make_kernel(Gain(gain=2.0), state, {}, {"input": Scalar, "output": Scalar}, [output])
    Kernel.text        void block_5a..._output(struct context *ctx, ..., double input, double *out0)
    Kernel.prototypes  the declaration, for the unit of the plan
    Kernel.failures    by number: (exception, message, file, line)
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from blocks.core import (
    Block,
    BlockContext,
    BlockSpec,
    BlockState,
    Evaluation,
    SignalType,
)
from blocks.library.registry import is_built_in
from runtime.codegen import FLOAT, Array, CFunction, Entry, RefusedError, Source, Tuple, Type, apart
from runtime.compiler.cache import Records, salt, source_of, translation
from runtime.compiler.fields import Fields, NotCompilableError, written
from runtime.toolchain import TranslationUnit, digest

PROJECT = Evaluation("project", ())
# A text of at most this many characters, apart from what all units share, can be part of the plan's
# unit, where its calls are inlined: it is compiled again with every edit of the graph.
SMALL = 5000
FUNCTION = re.compile(
    r"^(?:static |LANE )?(?:const )?(?:struct )?\w+ \**(\w+)\(.*\)$", re.MULTILINE
)
STRUCT = re.compile(r"^struct (\w+) \{$", re.MULTILINE)
PROTOTYPE = re.compile(r"^void \w+\(.*\);\n\n", re.MULTILINE)
METHOD = re.compile(r"^void (?=\w+\()", re.MULTILINE)
METHODS = re.compile(r"^void (\w+)\(", re.MULTILINE)
CALL, TAG = re.compile(r"\b(\w+)\("), re.compile(r"\bstruct (\w+)\b")
Failure = tuple[str, str, str, int]
Shapes = Sequence[tuple[int, ...]]


@dataclass(frozen=True)
class Kernel:
    """A compiled block: its C unit, and how to call it.

    symbols, prototypes : the C name and declaration of each method.
    failures : what can go wrong while it runs, by number: exception, message, file, line.
    words : the members of its struct, as names and C types; ``struct`` is its name inside of
        another unit.
    functions : in the typed form, by their names in C, if they were asked for.
    is_new : it was written, not read from the cache.
    """

    inputs: Fields
    name: str
    text: str
    symbols: dict[str, str]
    prototypes: list[str]
    failures: list[Failure]
    words: tuple[tuple[str, str], ...]
    functions: Mapping[str, CFunction]
    is_new: bool = False
    struct: str = ""

    @property
    def unit(self) -> TranslationUnit:
        """The unit for the C compiler."""
        return TranslationUnit(self.name, self.text)

    @property
    def is_small(self) -> bool:
        """Whether it can be part of the plan's unit."""
        return len(apart(self.text)) <= SMALL

    @property
    def has_while(self) -> bool:
        """Whether it has a loop that ends by what it computes."""
        return "while (" in apart(self.text)

    def enclosed(self, prefix: str) -> Kernel:
        """The same for a unit with other blocks: without the support that a unit begins with, and
        with static functions ``<prefix>_...``, of which the methods are ``<prefix>__...``."""
        symbols = {method: f"{prefix}__{method}" for method in self.symbols}
        renamed = {symbol: symbols[method] for method, symbol in self.symbols.items()}
        text = enclosed(self.text, prefix, renamed)
        struct = f"struct {prefix}_entries"
        return replace(self, text=text, symbols=symbols, prototypes=[], struct=struct)

    def fields(self, block: Block, state: BlockState) -> tuple[Any, ...]:
        """The values of the struct in one run."""
        return self.inputs.values(block, state)

    def fitting(self, block: Block, state: BlockState) -> tuple[Any, ...] | None:
        """The same; None if the constants or shapes in the text are not those of this run."""
        return self.inputs.fitting(block, state)


def enclosed(text: str, prefix: str, renamed: Mapping[str, str] | None = None) -> str:
    """The text of a unit as a part of another one: its functions and structs begin with a prefix.

    Parameters
    ----------
    renamed : the names of functions that others call; by default, these stay as they are.
    """
    if renamed is None:
        renamed = {name: name for name in METHODS.findall(text)}
    text = METHOD.sub("static void ", PROTOTYPE.sub("", apart(text)))
    calls = {name: f"{prefix}_{name}" for name in FUNCTION.findall(text)} | dict(renamed)
    tags = {name: f"{prefix}_{name}" for name in STRUCT.findall(text)}
    text = CALL.sub(lambda found: f"{calls.get(found[1], found[1])}(", text)
    return TAG.sub(lambda found: f"struct {tags.get(found[1], found[1])}", text)


def calls_of(
    spec: BlockSpec, evaluations: Sequence[Evaluation], guards: int = 0
) -> list[Evaluation]:
    """The methods of a block that are called in a tick; ``guards`` of it are located."""
    calls = [each for each in evaluations if not spec.is_constant(each)]
    calls += [each for each in (spec.update, spec.derivative) if each is not None]
    calls += [each for each in (spec.guards, spec.event) if each is not None and guards]
    return calls + ([PROJECT] if spec.projects else [])


def refusals(made: Block, state: BlockState, context: BlockContext) -> list[str]:
    """What of a block by itself cannot be compiled: each method, with the reason and its place.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    context : its place in a graph.
    """
    spec = type(made).spec
    found: dict[str, str] = {}
    terms = {port: sum(flags) for port, flags in context.terms.items()}
    rates = [getattr(state, name).shape for name in spec.continuous]
    guards = len(made.crossings(context))
    for call in calls_of(spec, made.evaluations, guards):
        try:
            make_kernel(made, state, terms, context.types, [call], rates=rates, guards=guards)
        except NotCompilableError as error:
            found.setdefault(str(error), call.method)
    return [f"{method} is not compiled: {reason}" for reason, method in found.items()]


def make_kernel(
    made: Block,
    state: BlockState,
    terms: dict[str, int],
    kinds: Mapping[str, SignalType],
    calls: Sequence[Evaluation],
    checked: bool = False,
    rates: Shapes = (),
    records: Records | None = None,
    guards: int = 0,
) -> Kernel:
    """Write one block as C; the same source with the same types is kept on disk.

    Parameters
    ----------
    made, state : the block, and its state after ``start``.
    terms : the number of wires of each variadic input.
    kinds : the signal types of its ports.
    calls : the methods that are called.
    rates : the shapes of its continuous states, whose rates of change ``derivative`` returns.
    records : of the cache; those of a whole graph are read once for all its blocks.
    guards : how many it has.

    Raises
    ------
    NotCompilableError : naming the reason.
    """
    cls = type(made)
    records = Records() if records is None else records
    found = translation(made, state, terms, records)
    checked = checked or not is_built_in(cls) or found.fields.has_functions_of_others
    title = f"{cls.__name__}: {(cls.__doc__ or '').strip()}"
    returns = {"derivative": rates, "guards": [(guards,)]}
    types = {port: signal_type(kind) for port, kind in kinds.items()}
    # As many numbers as arrive: one, or one for each component.
    types |= {
        p: Array("float", (None,), frozen=True) for p, d in cls.spec.inputs.items() if d.fills
    }
    entries = [_entry(found.methods, call, types, terms, returns) for call in calls]
    key = digest(salt(), found.key, repr(entries), title, repr(checked))
    record = records.read(f"block_{key}.json")
    is_new = record is None
    if record is None:
        record, functions = _write(source_of(made, state, terms), entries, key, title, checked)
        records.write(f"block_{key}.json", record, functions)
    if "refused" in record:
        raise NotCompilableError(record["refused"])
    failures = [(str(a), str(b), str(c), int(d)) for a, b, c, d in record["failures"]]
    symbols = {c.method: _symbol(key, e) for c, e in zip(calls, entries, strict=True)}
    return Kernel(
        inputs=found.fields,
        name=cls.__name__,
        text=record["text"],
        symbols=symbols,
        prototypes=record["prototypes"],
        failures=failures,
        words=tuple((str(word), str(c_type)) for word, c_type in record["words"]),
        functions=records.functions.get(f"block_{key}.json", {}),
        is_new=is_new,
    )


def _write(
    source: Source, entries: Sequence[Entry], key: str, title: str, checked: bool
) -> tuple[dict[str, Any], Mapping[str, CFunction]]:
    """The record of a block for the cache, and its functions in the typed form."""
    # Imported where something is written: most starts find everything in the cache.
    from runtime.codegen import Writer

    named = [Entry(_symbol(key, e), e.function, e.arguments, e.results) for e in entries]
    try:
        unit = Writer(source, checked).unit(named, title)
    except RefusedError as error:
        return {"refused": str(error)}, {}
    except Exception as error:
        # A fault of the generator must not end a run that Python can do.
        text = f"cannot be written as C: {type(error).__name__}: {error}"
        raise NotCompilableError(text) from error
    members = {"text": unit.text, "failures": unit.failures, "words": unit.words}
    return {**members, "prototypes": unit.prototypes}, unit.functions


def _symbol(key: str, entry: Entry) -> str:
    return f"block_{key[:16]}_{entry.symbol}"


def _entry(
    methods: Mapping[str, str],
    call: Evaluation,
    types: Mapping[str, Type],
    terms: dict[str, int],
    returns: Mapping[str, Shapes],
) -> Entry:
    arguments: list[tuple[str, Type]] = [] if call == PROJECT else [("t", FLOAT)]
    arguments += [("which", FLOAT)] if call.method == "event" else []
    for port in call.needs:
        if port in terms:
            arguments.append((f"{port}...", Tuple((types[port],) * terms[port])))
        else:
            arguments.append((port, types[port]))
    results: list[Type] = [types[port] for port in call.outputs]
    if call.method in returns:
        shapes = returns[call.method]
        results = [Array("float", written(shape)) if shape else FLOAT for shape in shapes]
    return Entry(call.method, methods[call.method], arguments, results)


def signal_type(kind: SignalType) -> Type:
    """A signal's type in compiled text; arrays of others are read-only."""
    if kind.form == "scalar":
        return FLOAT
    if kind.form == "record":
        return Tuple((FLOAT,) * len(kind.components))
    return Array("float", written(kind.shape), frozen=True)
