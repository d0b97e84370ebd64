"""Definitions, references and renames of the names in a file, across the files that share them.

In: a model, an offset and a :class:`Project` (the models of a folder). Out: places, or edits by
file. A file that extends another, an experiment and its graph, and a part and the graphs that use
it share names. So does an overlay with the graphs that an experiment lays it over; one that no
experiment names shares those of the only graph that has all blocks that it needs, if there is one.

    base.yaml  blocks: {pid: ...}        rename pid here, and all three files change:
    my.yaml    extends: base.yaml        wires: {pid: ...}
    sweep.yaml graph: my.yaml            vary: {pid.kp: ...}

A symbol is looked for first upwards (:meth:`Project.roots`: who defines it?), then downwards from
there (:meth:`Project.family`: who means the same?), since two files may extend one base and share
its names without naming each other.
"""

from __future__ import annotations

import inspect
import io
import re
import tokenize
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from blocks.core import Block
from blocks.files import read_text
from blocks.library.registry import is_built_in
from runtime.document import name_problem
from runtime.errors import UsageError
from runtime.language.items import YamlItem, deepest
from runtime.language.links import bases, modules, overlays
from runtime.language.mentions import Mention, Symbol, mentions
from runtime.language.model import Model
from runtime.language.scopes import known_types
from runtime.language.text import SourceText, Span

_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
RESERVED = ("inputs", "outputs")


@dataclass(frozen=True)
class Place:
    """A part of a file."""

    path: Path
    span: Span


class Project:
    """The files that may share names with a file: models by resolved path."""

    def __init__(self, models: Iterable[Model]) -> None:
        self.models = {model.path.resolve(): model for model in models}

    @cached_property
    def _links(self) -> list[tuple[Path, Path, tuple[str, ...]]]:
        """(file, the file that it builds on, the part that it uses it as or ())."""
        links = []
        for path, model in self.models.items():
            links += [(path, base, scope) for base, scope in self.bases(model)]
        return links

    def bases(self, model: Model) -> list[tuple[Path, tuple[str, ...]]]:
        """The files that another builds on, each with the part that it is used as, or ()."""
        below = self._graphs_below.get(model.path.resolve(), ())
        return [*bases(model), *((path, ()) for path in below)]

    @cached_property
    def _graphs_below(self) -> dict[Path, list[Path]]:
        """The graphs that each overlay is laid over."""
        graphs_of: dict[Path, list[Path]] = {}
        for model in self.models.values():
            for path, base in overlays(model):
                graphs_of.setdefault(path, []).append(base)
        # An overlay that no experiment names: guessed only where a single graph can be meant, since
        # a wrong guess would rename blocks of an unrelated graph.
        graphs = [m for m in self.models.values() if is_whole(m)]
        for path, model in self.models.items():
            blocks = needed_by(model) if path not in graphs_of else set()
            if blocks:
                fitting = [m.path.resolve() for m in graphs if blocks <= blocks_of(m)]
                if len(fitting) == 1:
                    graphs_of[path] = fitting
        return graphs_of

    def model(self, path: Path, near: Model) -> Model | None:
        """The model of a file, of the project or not."""
        if path not in self.models:
            text = near.surroundings.text(path)
            if text is None:
                return None
            self.models[path] = Model(text, path, near.surroundings)
        return self.models[path]

    def above(self, model: Model, symbol: Symbol) -> list[tuple[Model, Symbol]]:
        """Where the files that a file builds on may define a symbol."""
        bases = []
        for path, scope in self.bases(model):
            if symbol.scope[: len(scope)] != scope:
                continue
            base = self.model(path, model)
            if base is not None and base is not model:
                bases.append((base, replace(symbol, scope=symbol.scope[len(scope) :])))
        return bases

    def below(self, model: Model, symbol: Symbol) -> list[tuple[Model, Symbol]]:
        """What the symbol is called in the files that build on a file."""
        here = model.path.resolve()
        return [
            (self.models[path], replace(symbol, scope=(*scope, *symbol.scope)))
            for path, base, scope in self._links
            if base == here and path != here and not self._replaces(path, here, scope, symbol)
        ]

    def _replaces(self, path: Path, base: Path, scope: tuple[str, ...], symbol: Symbol) -> bool:
        """Whether a file has another part in place of the one that defines a symbol of its base."""
        # A graph that puts another part in the place of its base's: names inside of it are no
        # longer shared.
        inner = (*scope, *symbol.scope)
        own = self._parts_over(path, base) - {scope}
        return any(inner[: len(part)] == part for part in own)

    def _parts_over(self, path: Path, base: Path) -> set[tuple[str, ...]]:
        """The parts that a file has itself, or from what it extends after ``base``."""
        direct = [below for user, below, part in self._links if user == path and not part]
        later = direct[direct.index(base) + 1 :] if base in direct else []
        files = {path, *self._with_bases(later)}
        return {part for user, _, part in self._links if user in files and part}

    def _with_bases(self, paths: list[Path]) -> list[Path]:
        """Some files and all that they extend."""
        files = list(paths)
        for each in files:
            links = (link for link in self._links if link[0] == each)
            files += [below for _, below, part in links if not part and below not in files]
        return files

    def roots(self, model: Model, symbol: Symbol) -> list[tuple[Model, Symbol]]:
        """The files furthest up that define a symbol, with its name there."""
        roots, visited, queue = [], {model.path.resolve()}, [(model, symbol)]
        while queue:
            at, local = queue.pop()
            upper = []
            for base, inner in self.above(at, local):
                if base.path.resolve() not in visited and self.defined_by(base, inner):
                    visited.add(base.path.resolve())
                    upper.append((base, inner))
            queue += upper
            if not upper:
                roots.append((at, local))
        return roots

    def defined_by(self, model: Model, symbol: Symbol) -> bool:
        """Whether a file, or one that it builds on, defines a symbol."""
        if any(m.defines and m.symbol == symbol for m in mentions(model)):
            return True
        upper = self.above(model, symbol)
        return any(self.defined_by(base, inner) for base, inner in upper if base is not model)

    def _mentioned_by(self, model: Model, symbol: Symbol) -> bool:
        """Whether a file, or one that it extends, mentions a symbol."""
        paths = self._with_bases([model.path.resolve()])
        models = (self.model(path, model) for path in paths)
        return any(m.symbol == symbol for each in models if each for m in mentions(each))

    def family(self, model: Model, symbol: Symbol) -> list[tuple[Model, Symbol]]:
        """All files that mean the same by a symbol, each with its name there."""
        queue, members = self.roots(model, symbol), {}
        while queue:
            at, local = queue.pop()
            key = (at.path.resolve(), local)
            if key not in members:
                members[key] = (at, local)
                queue += self.below(at, local)
                # What a file extends besides the one that defines the name means the same by it.
                upper = self.above(at, local)
                queue += [up for up in upper if self._mentioned_by(*up)]
        return list(members.values())


def is_whole(model: Model) -> bool:
    """Whether a file is a graph with blocks of its own, that no other completes."""
    return model.kind == "graph" and model.root.get("blocks") is not None


def blocks_of(model: Model) -> set[str]:
    """Names of the blocks of a graph, those that it extends included."""
    blocks = model.document.get("blocks")
    return set() if blocks is None else {name for name, _ in blocks.items()}


def needed_by(model: Model) -> set[str]:
    """The blocks that an overlay names and does not define; none for other texts."""
    if model.root.get("extends") is not None or model.kind != "overlay":
        return set()
    entries = (model.root.get("blocks") or YamlItem()).items
    own = {item.key for item in entries if item.get("type") or item.get("graph")}
    names = {
        m.symbol.name for m in mentions(model) if m.symbol.noun == "block" and not m.symbol.scope
    }
    return names - own


def mention_at(model: Model, offset: int) -> Mention | None:
    """What is mentioned at an offset; what a file defines goes before what it may mean."""
    here = [m for m in mentions(model) if m.span.start <= offset <= m.span.end]
    if len(here) < 2:
        return here[0] if here else None
    definitions = {m.symbol for m in mentions(model) if m.defines}
    return next((m for m in here if m.symbol in definitions), here[0])


def _owner(model: Model, offset: int) -> Mention | None:
    """The block before the output that an address names at an offset."""
    item = deepest(model.root, offset)
    inside = [m for m in mentions(model) if item.start <= m.span.start and m.span.end <= offset]
    return inside[-1] if inside and item.kind == "scalar" and "." in item.value else None


def definition(model: Model, offset: int, project: Project) -> list[Place]:
    """Where the name at an offset is introduced."""
    mention = mention_at(model, offset) or _owner(model, offset)
    if mention is None:
        return []
    offset = min(offset, mention.span.end)
    if mention.symbol.noun == "file":
        path = model.file_of(mention.symbol.name)
        return [Place(path, Span(0, 0))] if path is not None else []
    if mention.symbol.noun == "type":
        return _class_place(known_types(model).get(mention.symbol.name))
    places = []
    for symbol in _meanings(model, offset):
        for at, local in project.roots(model, symbol):
            spans = [m.span for m in mentions(at) if m.defines and m.symbol == local]
            places += [Place(at.path, span) for span in spans]
        if places:
            break
    return places


def _meanings(model: Model, offset: int) -> list[Symbol]:
    """The symbols that a name at an offset may stand for, the likeliest first."""
    first = mention_at(model, offset)
    here = [m.symbol for m in mentions(model) if m.span.start <= offset <= m.span.end]
    return list(dict.fromkeys([first.symbol, *here])) if first is not None else []


def _class_place(cls: type[Block] | None) -> list[Place]:
    """The line of a Python file that defines a class."""
    if cls is None:
        return []
    source, name = getattr(cls, "source_file", None), cls.__name__
    try:
        path = Path(source or inspect.getfile(cls))
        text = read_text(path)
    except (OSError, TypeError, ValueError):
        return []
    # Searched, and not asked of inspect: an own class lives in another process.
    match = re.search(rf"^class\s+({re.escape(name)})\b", text, re.MULTILINE)
    span = Span(*match.span(1)) if match else Span(0, 0)
    return [Place(path.resolve(), span)]


def references(model: Model, offset: int, project: Project) -> list[Place]:
    """All places that mean the same as the name at an offset, its definition included."""
    mention = mention_at(model, offset)
    if mention is None:
        return []
    if mention.symbol.noun in ("file", "type"):
        same = (mention.symbol.noun, mention.symbol.name)
        models = {model.path.resolve(): model, **project.models}
        return [
            Place(other.path, m.span)
            for other in models.values()
            for m in mentions(other)
            if (m.symbol.noun, m.symbol.name) == same
        ]
    symbol = _defined_meaning(model, offset, project)
    places = [
        Place(at.path, m.span)
        for at, local in project.family(model, symbol)
        for m in mentions(at)
        if m.symbol == local
    ]
    return list(dict.fromkeys(places))


def _defined_meaning(model: Model, offset: int, project: Project) -> Symbol:
    """The one of the meanings that is defined; the likeliest if none is."""
    meanings = _meanings(model, offset)
    return next((symbol for symbol in meanings if project.defined_by(model, symbol)), meanings[0])


def rename_span(model: Model, offset: int) -> Span | None:
    """The name at an offset that can be renamed; None if there is none."""
    mention = mention_at(model, offset)
    return None if mention is None or mention.symbol.noun == "file" else mention.span


def rename(
    model: Model, offset: int, name: str, project: Project, within: Iterable[Path] = ()
) -> Mapping[Path, list[tuple[Span, str]]]:
    """The edits that rename what an offset names, by file.

    ``within`` are the files that may change, besides this one; without them, all may.

    Raises
    ------
    UsageError : the name is not valid or taken, or a file that must not change defines it.
    """
    mention = mention_at(model, offset)
    if mention is None or mention.symbol.noun == "file":
        raise UsageError("there is nothing to rename here")
    if mention.symbol.noun == "type":
        return _rename_class(model, mention.symbol.name, name, project)
    symbol = _defined_meaning(model, offset, project)
    _check_name(model, symbol, name)
    may_change = {path.resolve() for path in within}
    edits: dict[Path, list[tuple[Span, str]]] = {}
    for place in references(model, offset, project):
        path = place.path.resolve()
        if may_change and path != model.path.resolve() and path not in may_change:
            # Half a rename would break that file.
            raise UsageError(f"'{symbol.name}' is also in '{path}', which is not in this folder")
        edits.setdefault(place.path, []).append((place.span, name))
    return edits


def _check_name(model: Model, symbol: Symbol, name: str) -> None:
    message = ""
    if symbol.noun in ("probe", "plot", "metric"):
        message = name_problem(name, symbol.noun == "probe")
    elif not _NAME.fullmatch(name):
        message = f"'{name}' is not a name for a {symbol.noun}; use letters, digits and _"
    elif symbol.noun == "block" and name in RESERVED:
        message = f"'{name}' is reserved for the ports of a part"
    definitions = {m.symbol for m in mentions(model) if m.defines}
    if not message and replace(symbol, name=name) in definitions and name != symbol.name:
        message = f"there is a {symbol.noun} '{name}' already"
    if message:
        raise UsageError(message)


def _rename_class(
    model: Model, old: str, name: str, project: Project
) -> Mapping[Path, list[tuple[Span, str]]]:
    """Edits of a user's own block type: its class, and every graph that names it."""
    cls = known_types(model).get(old)
    places = _class_place(cls)
    if cls is None or is_built_in(cls) or not places:
        raise UsageError(f"'{old}' is a type of the library; only your own can be renamed")
    if not name.isidentifier() or name in known_types(model):
        raise UsageError(f"'{name}' is no Python name, or a block type has it")
    path = places[0].path
    text = SourceText(read_text(path))
    edits = {path: [(span, name) for span in _python_names(text, old)]}
    for other in {model.path.resolve(): model, **project.models}.values():
        # Only graphs that name the class's file: another file may define another class of that
        # name.
        if path in modules(other) or other is model:
            spans = [m.span for m in mentions(other) if m.symbol.noun == "type"]
            same = [s for s in spans if other.text.source[s.start : s.end].strip("'\"") == old]
            if same:
                edits[other.path] = [(span, name) for span in same]
    return edits


def _python_names(text: SourceText, name: str) -> list[Span]:
    """Where Python code uses a name."""
    spans = []
    try:
        for token in tokenize.generate_tokens(io.StringIO(text.source).readline):
            if token.type == tokenize.NAME and token.string == name:
                start = text.starts[token.start[0] - 1] + token.start[1]
                spans.append(Span(start, start + len(name)))
    except (tokenize.TokenError, IndentationError, SyntaxError):
        return []
    return spans
