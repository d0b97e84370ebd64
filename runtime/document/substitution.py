"""Substitution of ``$names`` by the values of ``params``.

In: a graph or part and its params. Out: the same tree with values in place of names, each with the
position of the param, where a wrong value has to be corrected; inside a text, the number as text::

    params: {v: 1.5}   blocks: {lqr: {v_r: $v}}             ->    {lqr: {v_r: 1.5}}
    params: {n: 3}     blocks: {f: {signal: Vector($n)}}    ->    {f: {signal: Vector(3)}}

Params may be computed from others, by arithmetic with numbers alone: ``wheel: $d * 0.5``. In a part
with ``repeat``, ``$index`` is the number of the copy: ``params: {angle: 2*pi*$index/$n}``.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from blocks.core import ExpressionError, expression_function, misspelt, similar
from blocks.messages import Message, Note, RemoveEntry, as_message
from runtime.document.limits import Work
from runtime.document.node import Node
from runtime.document.sections import SECTIONS, expected_form, is_part, misspelt_keys
from runtime.errors import Problems

_NAME = re.compile(r"\$([A-Za-z_]\w*)")
INDEX = "index"  # of a copy of a repeated part, unless the graph around it has such a param
# Values of a part's entry that are the graph's around it, so that its params are meant.
_OUTER = ("params", "repeat", "share", "seed")


def fill_sections(
    document: Node,
    declared: Node | None,
    address: str,
    problems: Problems,
    work: Work,
    outer: frozenset[str] = frozenset(),
) -> Node:
    """A graph with every ``$name`` replaced by the value of its param.

    Parameters
    ----------
    declared : the section ``params``; for a part with the values given, already filled in.
    address : of the graph in the document: '' or ``blocks.adaptive``.
    outer : the params of the graphs around a part, which it has only if they are passed to it.
    """
    prefix = f"{address}." if address else ""
    # With 'param:' for 'params:' every name would be unknown; the misspelling is reported alone.
    params: dict[str, Node] | None = None if "params" in misspelt_keys(document, SECTIONS) else {}
    if declared is not None and declared.value is not None:
        params = dict(declared.items()) if declared.is_map else None
        if params is None:
            message = f"{expected_form('params')}, got {declared.describe()}"
            problems.add(declared.where, f"{prefix}params", message)
    filler = _Filler(params, problems, work, outer)
    filler.compute_params(prefix)
    for name, node in document.items():
        if name not in ("params", "part"):
            # Elsewhere a text may hold dollars: plots and titles are set in TeX.
            filler.inside = name in ("blocks", "wires", "inputs", "outputs", "probes", "run")
            fill = filler.blocks if name == "blocks" else filler.fill
            document = document.with_item(name, fill(node, f"{prefix}{name or repr(name)}"))
    if filler.lacking:
        where = document.where if declared is None else declared.key
        names = ", ".join(f"'{name}'" for name in filler.lacking)
        given = ", ".join(f"{name}: ${name}" for name in filler.lacking)
        message = f"the part has no param {names}; a part has its own params, to which those of "
        problems.add(where, f"{prefix}params", f"{message}the graph are passed: {{{given}}}")
    for name, node in (params or {}).items():
        # An unused 'gain' and an unknown '$gian' are one mistake, reported at the name; and what a
        # part lacks is reported there.
        is_part_of_error = (
            similar(name, filler.missing) or filler.lacking or name in filler.not_passed
        )
        if name not in filler.used and not is_part_of_error:
            problems.add(node.key, f"{prefix}params.{name}", _unused(name, filler.used))
    return document


def _unused(name: str, used: Iterable[str]) -> Message:
    """The message about a param that nothing uses."""
    message = misspelt("unused-param", f"${name} is not used", name, used)
    removal = RemoveEntry(f"Remove '{name}'")
    after = "" if message.fixes else "; remove it, or write it as a value"
    return Message(message + after, message.kind, (*message.fixes, removal))


def without_unused(before: Node, after: Node, address: str = "") -> tuple[Node, list[Note]]:
    """A graph after a change, without the params that only what was replaced has used.

    A file in which a param is not used is wrong; a change that makes one unused is not::

        lqr: {q: $q}  --set lqr.q=1  lqr: {q: 1}      'q' is left out of params

    Returns
    -------
    tuple : the graph, and a note for each param that was left out, at every depth.
    """
    notes = []
    blocks, old = (each.get("blocks") or Node({}) for each in (after, before))
    for name, entry in blocks.items():
        old_entry = old.get(name)
        # What was not changed is the same object.
        if old_entry is not None and old_entry is not entry and is_part(entry):
            inner = f"{address}.{name}".lstrip(".")
            part, more = without_unused(old_entry, entry, inner)
            notes += more
            blocks = blocks.with_item(name, part) if more else blocks
    if notes:
        after = after.with_item("blocks", blocks)
    declared = after.get("params")
    params = [name for name, _ in declared.items()] if declared is not None else []
    used = _references_of(after) if params else set()
    unused = set(params) - used
    for name in sorted(unused & _references_of(before) if unused else ()):
        declared = declared.with_item(name, None) if declared is not None else None
        place = f"{address}.params.{name}".lstrip(".")
        text = f"{place} is left out: nothing uses ${name} after the change"
        notes.append(Note(text, "changed"))
    return after if not unused else after.with_item("params", declared), notes


def uses_index(entry: Node) -> bool:
    """Whether a repeated part, or a param that it is given, names the number of its copy."""
    params = entry.get("params")
    return INDEX in _references_of(entry) or (params is not None and INDEX in _references(params))


def _references_of(graph: Node) -> set[str]:
    """The params that a graph refers to; inside a part, names are its own."""
    nodes = []
    for key, node in graph.items():
        if key == "blocks":
            for entry in dict(node.items()).values():
                inside = (entry.get(each) for each in _OUTER)
                nodes += [n for n in inside if n is not None] if is_part(entry) else [entry]
        elif key not in ("params", "part"):
            nodes.append(node)
    used = {name for node in nodes for name in _references(node)}
    # With those that the params that are used are computed from.
    params, waiting = graph.get("params") or Node({}), list(used)
    while waiting:
        param = params.get(waiting.pop())
        more = set(_references(param)) - used if param is not None else set()
        used |= more
        waiting += more
    return used


def _references(node: Node) -> Iterator[str]:
    if isinstance(node.value, str):
        yield from _NAME.findall(node.value)
    for item in node.value if node.is_list else ():
        yield from _references(item)
    for name, item in node.items():
        yield from _NAME.findall(name)
        yield from _references(item)


class _Filler:
    """Replaces ``$names``; ``params`` is None where they cannot be read."""

    def __init__(
        self,
        params: dict[str, Node] | None,
        problems: Problems,
        work: Work,
        outer: frozenset[str] = frozenset(),
    ) -> None:
        self.params = params
        self.outer = outer
        self.work = work
        self.problems = problems
        self.used: set[str] = set()
        self.missing: set[str] = set()
        self.lacking: dict[str, None] = {}  # what a part uses, and the graph around it has
        self.not_passed: set[str] = set()  # what parts of this graph use and do not declare
        self.failed: set[str] = set()
        self.inside = True  # whether names inside a text are replaced
        self.in_block = False  # whether those in keys are, as in states: {p($n): m}
        self.later: set[str] = set()  # names that a copy of a repeated part replaces

    def compute_params(self, prefix: str) -> None:
        """Replace the params in params, in an order in which each uses only values."""
        done: set[str] = set()

        def compute(name: str, path: tuple[str, ...]) -> None:
            if self.params is None or name not in self.params or name in done:
                return
            node, address = self.params[name], f"{prefix}params.{name}"
            if name in path:
                circle = " -> ".join(f"${each}" for each in (*path[path.index(name) :], name))
                message = f"the param is computed from itself: {circle}"
                self.problems.add(node.where, address, message)
                self.failed.add(name)
                done.add(name)
                return
            for other in _references(node):
                compute(other, (*path, name))
            if name not in done:
                done.add(name)
                if any(True for _ in _references(node)):
                    before = len(self.problems.items)
                    self.params[name] = self.arithmetic(node, address)
                    self.failed |= {name} if len(self.problems.items) > before else set()

        for name in list(self.params or ()):
            compute(name, ())

    def blocks(self, node: Node, address: str) -> Node:
        """The section ``blocks``; the inside of a part uses the part's own params."""
        if not node.is_map:
            return self.fill(node, address)
        entries = dict(node.items())
        for name, entry in node.items():
            inner = f"{address}.{name}"
            if not is_part(entry):
                self.in_block = True
                entries[name] = self.fill(entry, inner)
                self.in_block = False
                continue
            given = entry.get("params") or Node({})
            self.not_passed |= _references_of(entry) - {param for param, _ in given.items()}
            for key in _OUTER:
                if (node_of_key := entry.get(key)) is not None:
                    value = self.for_part(entry, key, node_of_key, f"{inner}.{key}")
                    self.work.check(value, node_of_key.where, f"{inner}.{key}")
                    entries[name] = entries[name].with_item(key, value)
        return Node(entries, node.where, node.key)

    def for_part(self, entry: Node, key: str, node: Node, address: str) -> Node:
        """What a graph gives a part: its params' values, how often it is repeated."""
        if key != "params" or not node.is_map:
            return self.arithmetic(node, address)
        blocks = entry.get("blocks")
        own_file = blocks is not None and (blocks.where.file, entry.key.file)
        entries = dict(node.items())
        copied = entry.get("repeat") is not None and INDEX not in (self.params or {})
        for name, item in node.items():
            if copied and INDEX in _references(item):
                self.later = {INDEX}
                entries[name] = self.fill(item, f"{address}.{name}")
                self.later = set()
                continue
            # A default that the part computes from its own params stays until its inside is filled.
            references = set(_references(item))
            by_part = own_file and own_file[0] != own_file[1] and item.where.file == own_file[0]
            unknown = not references & (self.params or {}).keys()
            if not (references and references <= entries.keys() - {name} and (by_part or unknown)):
                entries[name] = self.arithmetic(item, f"{address}.{name}")
        return Node(entries, node.where, node.key)

    def fill(self, node: Node, address: str) -> Node:
        """A value with ``$names`` replaced, in its items and texts as well."""
        return self.walk(node, address, self.in_text)

    def arithmetic(self, node: Node, address: str) -> Node:
        """A value as :meth:`fill` gives it, where a text with names is computed to a number."""
        return self.walk(node, address, self.compute)

    def walk(self, node: Node, address: str, text: Callable[[Node, str], Node]) -> Node:
        if node.is_map:
            items = dict[str, Node]()
            for name, item in node.items():
                written = name
                if self.in_block and "$" in name:
                    key = self.in_text(Node(name, item.key), address)
                    written = str(key.value)
                    if written in items:
                        self.problems.add(item.key, address, f"'{written}' is given twice")
                items[written] = self.walk(item, f"{address}.{name}", text)
            return Node(items, node.where, node.key)
        if node.is_list:
            nodes = [self.walk(n, f"{address}[{i}]", text) for i, n in enumerate(node.value)]
            return Node(nodes, node.where, node.key)
        if not isinstance(node.value, str) or "$" not in node.value:
            return node
        match = _NAME.fullmatch(node.value)
        if match and match[1] not in self.later:
            value = self.value(match[1], node, address)
            if value is node:
                self.problems.silence(node.where, address)
            return value
        return text(node, address)

    def in_text(self, node: Node, address: str) -> Node:
        """A text with numbers in place of the names in it."""
        names = [n for n in dict.fromkeys(_NAME.findall(node.value)) if n not in self.later]
        if not names or not (self.inside or {*names} <= (self.params or {}).keys()):
            return node
        values = {name: self.value(name, node, address) for name in names}
        if any(value is node for value in values.values()):
            self.problems.silence(node.where, address)
            return node
        known = {name: _as_text(value.plain()) for name, value in values.items()}
        return replace(node, value=_NAME.sub(lambda m: known.get(m[1], m[0]), node.value))

    def compute(self, node: Node, address: str) -> Node:
        """The number that a text such as ``$d * 0.5`` stands for."""
        filled = self.in_text(node, address)
        if filled is node:
            return node
        try:
            number = expression_function(filled.value, {})()
        except ExpressionError as error:
            text = "expected arithmetic with numbers, as in '$d * 0.5': "
            message: str = as_message(error.message).within(text)
        except (ArithmeticError, ValueError) as error:
            message = f"cannot compute '{node.value}': {error}"
        else:
            if isinstance(number, float):
                # A count stays one: '$n + 1' of an integer repeats a part, 4.0 would not.
                whole = number.is_integer() and not re.search(r"[.]|(?<!/)/(?!/)", filled.value)
                return replace(node, value=int(number) if whole else number)
            message = "expected one number, got a vector or a matrix"
        message = as_message(message).within(after=f" (in '{node.value}')")
        self.problems.add(node.where, address, message)
        self.problems.silence(node.where, address)
        return node

    def value(self, name: str, node: Node, address: str) -> Node:
        """The value of a param, with the position where it is written, not where it is used; the
        node itself if there is none."""
        param = (self.params or {}).get(name)
        if param is not None and param.value is not None:
            self.used.add(name)
            self.work.substitute(name, param, node.where, address)
            # Reported there: it fails itself, or names a param that the outer graph lacks.
            if name in self.failed or any(True for _ in _references(param)):
                self.problems.silence(param.where, address)
            return Node(param.value, param.where, node.key)
        if param is not None:
            self.used.add(name)
            self.problems.add(param.key, address, f"param '{name}' has no value", "null-value")
        elif self.params is not None:
            self.report(name, node, address)
        return node

    def report(self, name: str, node: Node, address: str) -> None:
        """Report a param that does not exist: each slip of the pen, but what is only not declared
        once, however often it is used."""
        near = similar(name, self.params or ())
        if name in self.outer and not near:
            self.lacking[name] = None
        elif near or name not in self.missing:
            text = f"there is no param '{name}'"
            other = f"; params: {', '.join(self.params or ()) or 'none'}"
            message = misspelt("unknown-param", text, name, self.params or (), other)
            self.problems.add(node.where, address, message)
        self.missing.add(name)


def _as_text(value: object) -> str:
    """A value inside a text: in parentheses, unless it is a name or a number that needs none."""
    if isinstance(value, list):
        return f"[{', '.join(map(_as_text, value))}]"
    text = str(value) if isinstance(value, str) else repr(value)
    return text if re.fullmatch(r"[\w.]*(e[+-]?\d+)?", text) else f"({text})"
