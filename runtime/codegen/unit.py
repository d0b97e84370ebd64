"""A translation unit: the functions that a block's methods need, and the methods' C interface."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from runtime.codegen.body import Body, Failures
from runtime.codegen.interface import given, results
from runtime.codegen.leaving import leaving
from runtime.codegen.names import function_name, local_name
from runtime.codegen.source import Entry, Function, RefusedError, Source, support
from runtime.codegen.statements import Statements
from runtime.codegen.tidying import tidied
from runtime.codegen.types import (
    NONE,
    NotTypedError,
    Type,
    general,
    join,
    leaves,
)
from runtime.codegen.values import Value, converted, none, zero

PASSES = 8
SIZES_SEEN = 4
LEAVE = "return @@;"
WORD = re.compile(r"\w+")
CODES = {"double": "d", "int64_t": "i", "bool": "b"}


@dataclass(frozen=True)
class Unit:
    """A finished unit.

    text : of the C file.
    failures : by number: exception, message with {index}, {size} and {axis}, file, line.
    words : the entries' C names and types, in the order of the struct.
    prototypes : of the methods, for other units.
    """

    text: str
    failures: list[tuple[str, str, str, int]]
    words: list[tuple[str, str]]
    prototypes: list[str]


@dataclass
class Instance:
    """A function for certain types of arguments."""

    name: str
    returned: Type
    effects: bool
    changes: bool
    uses_context: bool
    uses_entries: bool
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
        self.stack: list[set[str]] = []
        self.leaving = LEAVE
        self.prototypes: list[str] = []

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
        members = [f"    {_declared(c_type, name)};" for name, c_type in words]
        head = ["/* " + line for line in _plain(title).split("\n")] if title else []
        if head:
            head = [
                "\n * ".join(line.removeprefix("/* ") if i else line for i, line in enumerate(head))
                + "\n */",
                "",
            ]
        text = "\n".join(
            [
                *head,
                support(),
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
        return Unit(text, self.failures.listed, words, self.prototypes)

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
            members = [f"    {_declared(c_type, f'v{i}')};" for i, c_type in enumerate(c_types)]
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
        texts = [text for value in values for text in value.texts]
        texts = ["self"] * instance.uses_entries + texts
        texts = ["ctx"] * instance.uses_context + texts
        text = f"{instance.name}({', '.join(texts)})"
        if instance.uses_entries:
            body.uses_entries = True
        kinds = [c_type for _, c_type in leaves(instance.returned)]
        if not kinds:
            body.effects += 1
            body.changes += instance.changes
            body.put(f"{text};")
            return none() if instance.returned == NONE else Value(instance.returned)
        body.effects += instance.effects
        body.changes += instance.changes
        if len(kinds) == 1:
            made = Value(instance.returned, (text,))
            return body.kept(made, instance.name) if instance.effects else made
        name = body.fresh(instance.name)
        body.put(f"const struct {self.struct(kinds)} {name} = {text};")
        members = tuple(f"{name}.v{i}" for i in range(len(kinds)))
        body.stable.update(members)
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
                values.append(body.expr(target.defaults[name]))
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
        made = self.written(target, kinds)
        del self.instances[key]
        self.instances[key] = made
        return made

    def written(self, target: Function, kinds: tuple[Type, ...]) -> Instance:
        """Write a function again until its variables' types are wide enough."""
        name = function_name(target.name, self.names)
        types: dict[str, Type] = {}
        returned: Type | None = None
        for _ in range(PASSES):
            self.stack.append(set())
            body = Statements(self, target, self.failures, types)
            body.returned = returned
            try:
                falls = self.filled(body, target, kinds)
            except NotTypedError as error:
                raise RefusedError(f"{error} ({target.file}:{body.line})") from None
            finally:
                calls = self.stack.pop()
            found = body.returned
            if falls and found is not None and found != NONE:
                found = join(found, NONE)
            if not body.widened and found == body.returned:
                return self.finished(name, target, kinds, body, found or NONE, calls)
            types, returned = body.types, found
        raise RefusedError(f"the types in '{target.name}' are not settled ({target.file})")

    def filled(self, body: Statements, target: Function, kinds: tuple[Type, ...]) -> bool:
        """Write a function's statements; returns whether its end is reached."""
        for parameter, kind in zip(target.parameters, kinds, strict=True):
            body.parameter(parameter, kind)
        falls = body.all(target.statements)
        if falls and body.returned not in (None, NONE):
            body.put(self.returning(converted(none(), join(body.returned or NONE, NONE))))
        return falls

    def finished(
        self,
        name: str,
        target: Function,
        kinds: tuple[Type, ...],
        body: Statements,
        returned: Type,
        calls: set[str],
    ) -> Instance:
        """The text of a function."""
        nothing = self.returning(Value(returned, zero(returned)))
        lines = [line.replace(LEAVE, nothing) for line in body.lines]
        tops = [
            f"    {_declared(c_type, target_name + suffix)} = {text};"
            for target_name, kind in body.tops.items()
            for (suffix, c_type), text in zip(leaves(kind), zero(kind), strict=True)
        ]
        heads = [f"    {line}" for line in body.heads.values()]
        lines = leaving(tidied([*heads, *tops, *lines]), nothing.removeprefix("return").strip(" ;"))
        whole = "\n".join(lines)
        parameters = [
            _declared(c_type, f"{local_name(parameter)}{suffix}")
            for parameter, kind in zip(target.parameters, kinds, strict=True)
            for suffix, c_type in leaves(kind)
        ]
        # One search for all parameters: a Sum of 4,000 terms has as many.
        words = set(WORD.findall(whole))
        unused = [p for p in map(_last_word, parameters) if p not in words]
        uses_context, uses_entries = "ctx" in words, "self" in words
        if uses_entries:
            parameters.insert(0, "const struct entries *self")
        if uses_context:
            parameters.insert(0, "struct context *ctx")
        head = _declared(f"static {self.c_return(returned)}", name)
        text = "\n".join(
            [
                *([f"/* {_plain(target.note)} */"] if target.note else []),
                f"{head}({', '.join(parameters) or 'void'})",
                "{",
                *[f"    (void){p};" for p in unused],
                *lines,
                "}",
                "",
            ]
        )
        counts = (body.effects > 0, body.changes > 0, uses_context, uses_entries)
        return Instance(name, returned, *counts, text, calls)

    def c_return(self, kind: Type) -> str:
        found = [c_type for _, c_type in leaves(kind)]
        if not found:
            return "void"
        return found[0] if len(found) == 1 else f"struct {self.struct(found)}"

    def returning(self, value: Value) -> str:
        """The statement that returns a value."""
        if not value.texts:
            return "return;"
        if len(value.texts) == 1:
            text = value.text
            return f"return {text};"
        kinds = [c_type for _, c_type in leaves(value.type)]
        return f"return (struct {self.struct(kinds)}){{{', '.join(value.texts)}}};"

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
        parameters: list[str] = []
        values = [given(name, kind, parameters) for name, kind in entry.arguments]
        self.stack.append(set())
        body = Statements(self, target, self.failures, {})
        try:
            found = self.call(body, target, values, {})
            results(body, entry, found, parameters)
        except NotTypedError as error:
            raise RefusedError(f"{error} ({target.file}:{target.line + 1})") from None
        finally:
            calls = self.stack.pop()
        lines = leaving(tidied(body.lines), "")
        if any(re.search(r"\bctx\b", line) for line in lines):
            lines.insert(0, "    ctx->arena_used = 0;")
        whole = "\n".join(lines)
        names = [_last_word(p) for p in ("ctx", *parameters, "self")]
        words = set(WORD.findall(whole))
        unused = [n for n in names if n not in words]
        head = ["struct context *ctx", "const struct entries *self", *parameters]
        signature = f"void {entry.symbol}({', '.join(head)})"
        self.prototypes.append(signature.replace("const struct entries *", "const void *"))
        text = "\n".join(
            [
                f"{signature};",
                "",
                signature,
                "{",
                *[f"    (void){n};" for n in unused],
                *lines,
                "}",
                "",
            ]
        )
        return text, calls


def _plain(text: str) -> str:
    """A text that neither ends a comment nor opens one in it."""
    return text.replace("*/", "* /").replace("/*", "/ *")


def _declared(c_type: str, name: str) -> str:
    return f"{c_type}{name}" if c_type.endswith("*") else f"{c_type} {name}"


def _last_word(parameter: str) -> str:
    return re.split(r"[ *]", parameter)[-1]
