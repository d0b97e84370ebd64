"""A translation unit: the functions that a block's methods need, and the methods' C interface.

In go a source and the methods that are called, out comes the text of a C file. Each function is
written once for each combination of types of its arguments, in these passes:

1. ``build``   syntax tree to form, which types and refuses; again where a variable of a loop turns
               out wider than an earlier use of it took it to be: ``n = 0`` before ``n += 0.5``
2. ``tidy``    without what is never read
3. ``leave``   with the ways out after a failure
4. ``print``   form to text
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from runtime.codegen.body import Body
from runtime.codegen.expressions import value_of
from runtime.codegen.form import (
    CTX,
    SELF,
    Call,
    Do,
    Expr,
    For,
    Literal,
    Member,
    Name,
    Return,
    Set,
    Statement,
    While,
    used,
    walk,
)
from runtime.codegen.interface import Parameter, given, results
from runtime.codegen.names import function_name, local_name
from runtime.codegen.passes import leave, tidy
from runtime.codegen.printing import Printer, declared
from runtime.codegen.source import Entry, Failures, Function, RefusedError, Source, support
from runtime.codegen.statements import build
from runtime.codegen.types import NONE, NotTypedError, Type, general, join, leaves
from runtime.codegen.values import Value, converted, none, zero

# A type widens in few steps (int, either; sizes known or not): a function whose types are not
# found after so many builds has a variable that takes ever other forms.
BUILDS = 8
SIZES_SEEN = 4
CONTEXT: Parameter = ("struct context *", "ctx")
ENTRIES: Parameter = ("const struct entries *", "self")
CODES = {"double": "d", "int64_t": "i", "bool": "b"}


@dataclass(frozen=True)
class CFunction:
    """A function of a unit as it was written, without the ways out after a failure.

    parameters : C types and names.
    """

    parameters: tuple[Parameter, ...]
    statements: tuple[Statement, ...]


@dataclass(frozen=True)
class Unit:
    """A finished unit.

    text : of the C file.
    failures : by number: exception, message with {index}, {size} and {axis}, file, line.
    words : the entries' C names and types, in the order of the struct.
    prototypes : of the methods, for other units.
    functions : by their names in C.
    """

    text: str
    failures: list[tuple[str, str, str, int]]
    words: list[tuple[str, str]]
    prototypes: list[str]
    functions: Mapping[str, CFunction]


@dataclass(frozen=True)
class Instance:
    """A function for certain types of arguments.

    effects, changes : whether it has statements that must stay, or that change memory.
    context, entries : whether it takes them.
    """

    name: str
    returned: Type
    effects: bool
    changes: bool
    context: bool
    entries: bool
    text: str
    calls: set[str] = field(default_factory=set)


class Writer:
    """Writes a unit.

    Parameters
    ----------
    source : functions and entries.
    check : check every index that is not certainly inside of its array.
    """

    def __init__(self, source: Source, check: bool = False) -> None:
        self.source, self.check = source, check
        self.failures = Failures()
        self.instances: dict[tuple[str, tuple[Type, ...]], Instance | None] = {}
        # A function is not hidden by a variable of its name.
        self.names = {local_name(n) for f in source.functions.values() for n in f.counts}
        self.names |= set(map(local_name, source.entries))
        self.structs: dict[tuple[str, ...], str] = {}
        # The functions that each of those calls that are being built.
        self.stack: list[set[str]] = []
        self.prototypes: list[str] = []
        self.functions: dict[str, CFunction] = {}

    def unit(self, entries: Sequence[Entry], title: str = "") -> Unit:
        """The whole unit, with these methods.

        Raises
        ------
        RefusedError : something in the source cannot be compiled.
        """
        bodies = [self.interface(entry) for entry in entries]
        needed = self.reached([name for _, names in bodies for name in names])
        written = [i for i in self.instances.values() if i is not None and i.name in needed]
        words = [
            (f"{local_name(name)}{suffix}", c_type)
            for name, kind in self.source.entries.items()
            for suffix, c_type in leaves(kind)
        ]
        members = [f"    {declared(c_type, name)};" for name, c_type in words]
        text = "\n".join(
            [
                "/* Parameters, and pointers to states. */",
                "struct entries {",
                *(members or ["    int64_t none;"]),
                "};",
                "",
                *self.struct_texts(),
                *(instance.text for instance in written),
                *(body for body, _ in bodies),
            ]
        )
        text = "\n".join([*_comment(title), support(text), text])
        return Unit(text, self.failures.listed, words, self.prototypes, self.functions)

    def reached(self, names: Sequence[str]) -> set[str]:
        """The names of functions that are called, directly or not."""
        by_name = {i.name: i for i in self.instances.values() if i is not None}
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting += by_name[name].calls
        return found

    def struct_texts(self) -> list[str]:
        made = []
        for c_types, name in self.structs.items():
            members = [f"    {declared(c_type, f'v{i}')};" for i, c_type in enumerate(c_types)]
            made += [f"struct {name} {{", *members, "};", ""]
        return made

    # Functions

    def call(
        self,
        body: Body,
        target: Function,
        given: Sequence[Value],
        named: Mapping[str, Value],
    ) -> Value:
        """A call of a function of the source."""
        values = self.arguments(body, target, given, named)
        instance = self.instance(target, tuple(value.type for value in values))
        for value, (_, kind) in zip(values, self.kinds(target, values), strict=True):
            if value.type != kind:
                values = [
                    converted(v, k)
                    for v, (_, k) in zip(values, self.kinds(target, values), strict=True)
                ]
                break
        self.stack[-1].add(instance.name)
        first = [CTX] * instance.context + [SELF] * instance.entries
        call = Call(instance.name, (*first, *(leaf for value in values for leaf in value.leaves)))
        kinds = [c_type for _, c_type in leaves(instance.returned)]
        body.changes += instance.changes
        if not kinds:
            body.act(Do(call))
            return none() if instance.returned == NONE else Value(instance.returned)
        body.effects += instance.effects
        if len(kinds) == 1:
            made = Value(instance.returned, (call,))
            return body.kept(made, instance.name) if instance.effects else made
        name = body.held(instance.name, f"struct {self.struct(kinds)}", call)
        members = tuple(Member(name, f".v{i}") for i in range(len(kinds)))
        return Value(instance.returned, members)

    def arguments(
        self,
        body: Body,
        target: Function,
        given: Sequence[Value],
        named: Mapping[str, Value],
    ) -> list[Value]:
        """The values of all parameters; defaults are expressions of the source."""
        unknown = named.keys() - set(target.parameters[len(given) :])
        if len(given) > len(target.parameters) or unknown:
            count = len(given) + len(named)
            raise NotTypedError(f"calls '{target.name}' with {count} arguments that do not fit")
        values = list(given)
        for name in target.parameters[len(given) :]:
            if name in named:
                values.append(named[name])
            elif name in target.defaults:
                values.append(value_of(body, target.defaults[name]))
            else:
                raise NotTypedError(f"calls '{target.name}' without '{name}'")
        return [body.stored(value) for value in values]

    def kinds(self, target: Function, values: Sequence[Value]) -> list[tuple[str, Type]]:
        kinds = self.settled(target, tuple(value.type for value in values))
        return list(zip(target.parameters, kinds, strict=True))

    def settled(self, target: Function, kinds: tuple[Type, ...]) -> tuple[Type, ...]:
        """The types of an instance: of a function with many sizes, one instance for all."""
        if (target.name, kinds) in self.instances:
            return kinds
        wide = tuple(map(general, kinds))
        alike = [
            key
            for key in self.instances
            if key[0] == target.name and tuple(map(general, key[1])) == wide
        ]
        return wide if len(alike) >= SIZES_SEEN else kinds

    def instance(self, target: Function, kinds: tuple[Type, ...]) -> Instance:
        """A function for arguments of these types; written if it is new."""
        kinds = self.settled(target, kinds)
        key = (target.name, kinds)
        if key in self.instances:
            found = self.instances[key]
            if found is None:
                raise NotTypedError(f"calls '{target.name}' from itself; write a loop")
            return found
        self.instances[key] = None
        made = self.write(target, kinds)
        del self.instances[key]
        self.instances[key] = made
        return made

    def write(self, target: Function, kinds: tuple[Type, ...]) -> Instance:
        """Build a function, again until its variables' types are wide enough."""
        name = function_name(target.name, self.names)
        types: dict[str, Type] = {}
        returned: Type | None = None
        for _ in range(BUILDS):
            self.stack.append(set())
            body = Body(self, target, types, returned)
            try:
                falls = self.fill(body, target, kinds)
            except NotTypedError as error:
                raise RefusedError(f"{error} ({target.file}:{body.line})") from None
            finally:
                calls = self.stack.pop()
            found = body.returned
            if falls and found is not None and found != NONE:
                found = join(found, NONE)
            if not body.widened and found == body.returned:
                return self.finish(name, target, kinds, body, found or NONE, calls)
            types, returned = body.types, found
        raise RefusedError(f"the types in '{target.name}' are not settled ({target.file})")

    def fill(self, body: Body, target: Function, kinds: tuple[Type, ...]) -> bool:
        """Build a function's statements; returns whether its end is reached."""
        for parameter, kind in zip(target.parameters, kinds, strict=True):
            body.parameter(parameter, kind)
        falls = build(body, target.statements)
        if falls and body.returned not in (None, NONE):
            body.add(Return(converted(none(), join(body.returned or NONE, NONE)).leaves))
        return falls

    def finish(
        self,
        name: str,
        target: Function,
        kinds: tuple[Type, ...],
        body: Body,
        returned: Type,
        calls: set[str],
    ) -> Instance:
        """The text of a function."""
        statements = tidy(body.whole())
        parameters = [
            (c_type, f"{local_name(parameter)}{suffix}")
            for parameter, kind in zip(target.parameters, kinds, strict=True)
            for suffix, c_type in leaves(kind)
        ]
        names = _names(statements)
        c_types = [c_type for _, c_type in leaves(returned)]
        struct = self.struct(c_types) if len(c_types) > 1 else ""
        c_type = f"struct {struct}" if struct else c_types[0] if c_types else "void"
        context, entries = "ctx" in names, "self" in names
        unused = [each for _, each in parameters if each not in names]
        first = [CONTEXT] * context + [ENTRIES] * entries
        whole = (*first, *parameters)
        self.functions[name] = CFunction(whole, tuple(statements))
        taken = ", ".join(declared(*each) for each in whole) or "void"
        is_plain = {c for c, _ in parameters} == {"double"} and c_type == "double"
        has_loops = any(isinstance(each, (For, While)) for each in walk(statements))
        kept = "static" if context or entries or has_loops or not is_plain else "LANE"
        text = "\n".join(
            [
                *([f"/* {_plain(target.note)} */"] if target.note else []),
                f"{declared(f'{kept} {c_type}', name)}({taken})",
                *_block(unused, body, statements, struct, zero(returned)),
            ]
        )
        acts = (body.effects > 0, body.changes > 0)
        return Instance(name, returned, *acts, context, entries, text, calls)

    def struct(self, c_types: Sequence[str]) -> str:
        """The name of a struct with members of these types."""
        key = tuple(c_types)
        if key not in self.structs:
            code = "".join(CODES.get(c, "p") for c in key)
            name, number = f"values_{code}", 1
            while name in self.structs.values():
                number += 1
                name = f"values_{code}_{number}"
            self.structs[key] = name
        return self.structs[key]

    # The interface

    def interface(self, entry: Entry) -> tuple[str, set[str]]:
        """The text of a method that other units call, and the functions that it calls."""
        target = self.source.functions[entry.function]
        parameters: list[Parameter] = []
        values = [given(name, kind, parameters) for name, kind in entry.arguments]
        self.stack.append(set())
        body = Body(self, target, {})
        try:
            found = self.call(body, target, values, {})
            results(body, entry, found, parameters)
        except NotTypedError as error:
            raise RefusedError(f"{error} ({target.file}:{target.line + 1})") from None
        finally:
            calls = self.stack.pop()
        statements = tidy(body.statements)
        if "ctx" in _names(statements):
            statements.insert(0, Set(Member(CTX, "->arena_used"), Literal(0)))
        names = _names(statements)
        signature = f"void {entry.symbol}({{}})"
        taken = [CONTEXT, ENTRIES, *parameters]
        self.functions[entry.symbol] = CFunction(tuple(taken), tuple(statements))
        head = signature.format(", ".join(declared(*each) for each in taken))
        # Other units have another struct of entries.
        taken[1] = ("const void *", "self")
        self.prototypes.append(signature.format(", ".join(declared(*each) for each in taken)))
        unused = [n for n in ("ctx", *(n for _, n in parameters), "self") if n not in names]
        return "\n".join([f"{head};", "", head, *_block(unused, body, statements)]), calls


def _block(
    unused: Sequence[str],
    body: Body,
    statements: Sequence[Statement],
    struct: str = "",
    zeros: tuple[Expr, ...] = (),
) -> list[str]:
    """The lines of a function after its head."""
    lines = Printer(struct, zeros).lines(leave(statements, zeros, body.fresh))
    return ["{", *[f"    (void){name};" for name in unused], *lines, "}", ""]


def _names(statements: Sequence[Statement]) -> set[str]:
    """The parameters and entries that statements use, those that are assigned to included."""
    assigned = {
        each.place.name
        for each in walk(statements)
        if isinstance(each, Set) and isinstance(each.place, Name)
    }
    return assigned | set(used(statements))


def _comment(text: str) -> list[str]:
    """A comment of several lines, and an empty one."""
    return ["/* " + "\n * ".join(_plain(text).split("\n")) + "\n */", ""] if text else []


def _plain(text: str) -> str:
    """A text that neither ends a comment nor opens one in it."""
    return text.replace("*/", "* /").replace("/*", "/ *")
