"""From files to one complete document: finds graphs, merges ``extends``, inlines parts.

In: a file, a shipped graph's name or a dict. Out: one tree, whose values keep their positions in
the files that they come from, and the bytes of each file read::

    own.yaml:   extends: line          line.yaml:  blocks: {lqr: {type: LQR, q: 1, r: 1}}
                blocks: {lqr: {q: 2}}
    read_graph("own.yaml")[0]:         blocks: {lqr: {type: LQR, q: 2, r: 1}}
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeAlias

from blocks.core import misspelt, similar
from blocks.files import read, resolved
from blocks.limits import GRAPH_FILE
from blocks.messages import Replace, suggestion
from runtime.document.arrays import with_arrays
from runtime.document.limits import MAX_LEVELS, Work
from runtime.document.node import Node, Value, from_python, parse_yaml
from runtime.document.parse_errors import position
from runtime.document.sections import FILE_KEYS, FILE_SECTIONS
from runtime.errors import NOWHERE, GraphError, Location, Problem, Problems

SHIPPED = Path(__file__).resolve().parents[2] / "graphs"
# Files in a run's, a sweep's or an ablation's folder that can be run again.
RUNNABLE = ("plan.yaml", "graph.resolved.yaml")
SUFFIX = ".yaml"
TYPED = ("blocks", "plots", "metrics")
MOST_SIMILAR = 3  # names that an error message suggests
Parse = Callable[[str, str], Node]
Source: TypeAlias = str | Path | Mapping[str, Value]  # a file, a shipped graph's name, a dict


def shipped_graphs() -> list[str]:
    """Names of the graphs that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob(f"*{SUFFIX}"))


def read_graph(
    source: Source, unsaved: Mapping[Path, str] | None = None
) -> tuple[Node, dict[str, bytes]]:
    """Read a graph with all that it extends and all its parts, and the content of each file.

    Each file is read once, so that a run stores exactly what it ran, even if the files change
    meanwhile.

    Parameters
    ----------
    source : a file, the name of a shipped graph, or the graph as a dict.
    unsaved : what replaces the content of files, by resolved path.

    Returns
    -------
    tuple : the document, and the bytes of each file, by resolved path.

    Raises
    ------
    GraphError : files, or files that they name, cannot be read; it lists all of them.
    """
    loader = _Loader(unsaved)
    if isinstance(source, Mapping):
        document: Node | None = loader.complete(from_python(source), ())
    else:
        document = loader.file(str(source), (NOWHERE, ""), Path(), ())
    loader.problems.raise_any()
    return document or Node({}), loader.contents


def complete_document(
    document: Node,
    path: Path,
    unsaved: Mapping[Path, str],
    parse: Parse = parse_yaml,
) -> tuple[Node, list[Problem]]:
    """A graph whose text is in memory, with all that it extends and all its parts.

    Parameters
    ----------
    document : the parsed text; path : its file, which need not exist.
    unsaved : what replaces the content of files, by resolved path.
    parse : reads a file's text; the default, or one that remembers.

    Returns
    -------
    tuple : the document as far as it can be read, and what is wrong.
    """
    loader = _Loader(unsaved, parse)
    try:
        complete = loader.complete_root(document, (path.resolve(),))
        if complete is not None:
            loader.work.check(complete, complete.where, "")
    except GraphError as error:
        return document, error.problems
    return complete or document, loader.problems.items


def merge(
    base: Node,
    top: Node,
    section: str = "",
    key: str = "",
    charge: Callable[[int], None] = lambda entries: None,
) -> Node:
    """Merge one tree over another: mappings merge, null deletes, everything else replaces.

    A world replaces the one below, and so does a block, plot or metric of another ``type``,
    ``kind`` or ``part``, since their parameters differ. A null with nothing to delete stays, and
    is reported where it is read, since it may be a mistake. ``section`` is the mapping that
    holds the two trees, ``key`` their key in it; ``charge`` is called with the number of
    entries that each step merges.
    """
    is_another = section in TYPED and is_of_another_kind(base, top)
    is_world = key == "world" and not section
    if not (base.is_map and top.is_map) or is_another or is_world:
        return top
    return _merge_entries(base, top, key, charge)


def _merge_entries(base: Node, top: Node, key: str, charge: Callable[[int], None]) -> Node:
    charge(len(base.value) + len(top.value))
    entries = dict(base.value)
    for name, node in top.items():
        below = entries.get(name)
        if below is None:
            entries[name] = node
        elif node.value is None:
            # Removed, not set to null: below it may be given again by a file that extends this one.
            del entries[name]
        else:
            entries[name] = merge(below, node, key, name, charge)
    return Node(entries, top.where, top.key)


def is_of_another_kind(base: Node, top: Node) -> bool:
    """Whether a typed entry replaces the one below, since it has another type, kind or part."""
    for name in ("type", "kind", "part"):
        above, below = top.get(name), base.get(name)
        # An entry that names no type changes the one below, whatever its type.
        if above is not None and (below is None or below.value != above.value):
            return True
    return False


def _shipped_near(path: Path) -> list[str]:
    """The shipped files in the folder that a name such as ``conditions/lag`` has."""
    if path.is_absolute() or len(path.parts) < 2 or ".." in path.parts:
        return []
    return _names((SHIPPED / path).parent.glob(f"*{SUFFIX}"))


def _names(paths: Iterable[Path]) -> list[str]:
    return sorted(path.relative_to(SHIPPED).with_suffix("").as_posix() for path in paths)


def _similar(path: Path, near: list[str], shipped: list[str]) -> list[str]:
    """The files beside a misspelt name, or else the shipped ones, that may be meant.

    Compared are names without folders and suffixes, which would make any two files look alike.
    """
    paths_by_stem = {Path(name).stem: str(path.parent / name) for name in near}
    if close := similar(path.stem, paths_by_stem):
        return [paths_by_stem[close]]
    stems = {name: Path(name).stem for name in shipped}
    begin = [name for name, stem in stems.items() if path.stem and stem.startswith(path.stem)]
    exact = [name for name in begin if stems[name] == path.stem]
    if 0 < len(exact or begin) <= MOST_SIMILAR:
        return exact or begin
    close = similar(path.stem, stems.values())
    return [name for name, stem in stems.items() if stem == close][:MOST_SIMILAR]


def find_file(name: str, at: Location, folder: Path, noun: str = "graph") -> Path:
    """A graph or world by its path relative to ``folder``, or by the name of a shipped one.

    ``at`` is the location of the name, if a graph contains it.

    Raises
    ------
    GraphError : there is none.
    """
    path = Path(name)
    # The own folder first: a user's file may have the name of a shipped graph.
    places = [folder / path, folder / f"{name}{SUFFIX}"]
    if not path.is_absolute():
        places += [SHIPPED / path, SHIPPED / f"{name}{SUFFIX}"]
    try:
        for candidate in places:
            if candidate.is_file():
                return candidate
        is_folder = bool(name) and (folder / path).is_dir()
        inside = [n for n in RUNNABLE if is_folder and (folder / path / n).is_file()]
        near = [file.name for file in (folder / path).parent.glob(f"*{SUFFIX}")]
        beside = _shipped_near(path)
    except OSError as error:
        message = f"'{name[:60]}': {error.strerror}"
        raise GraphError([Problem(*at, message, "missing-file")]) from None
    worlds = sorted(str(path.relative_to(SHIPPED)) for path in SHIPPED.glob(f"worlds/*{SUFFIX}"))
    shipped_names = shipped_graphs() if noun == "graph" else worlds
    everywhere = _names(SHIPPED.rglob(f"*{SUFFIX}")) if noun == "graph" else worlds
    # The file in which the name is written is not the one that is meant.
    near = [file for file in near if file != Path(at[0].file).name]
    candidates = [str(path / n) for n in inside]
    candidates = candidates or _similar(path, near, beside or everywhere)
    known = f"; shipped {noun}s: {', '.join(shipped_names)}"
    if beside:
        known = f"; shipped {path.parent.as_posix()}: {', '.join(beside)}"
    message = f"'{name}': " + ("is a folder" if is_folder else f"no such {noun}")
    fixes = tuple(Replace(each) for each in candidates)
    message += suggestion(candidates) or known
    raise GraphError([Problem(*at, message, "missing-file", fixes)])


def read_file(path: Path, at: Location) -> bytes:
    """The content of a graph's file.

    ``at`` is the location where a graph names the file.

    Raises
    ------
    GraphError : it cannot be read, or is larger than :data:`GRAPH_FILE`.
    """
    try:
        return read(path, GRAPH_FILE)
    except OSError as error:
        message = f"cannot read '{path}': {error.strerror}"
        raise GraphError([Problem(*at, message, "missing-file")]) from None


def decode(data: bytes, path: Path) -> str:
    """The text of a graph's file, UTF-8 with or without a byte order mark.

    Raises
    ------
    GraphError : it is not UTF-8.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = data[: error.start].decode("utf-8-sig")
        message = f"byte 0x{data[error.start]:02X} is not UTF-8; save the file as UTF-8"
        raise GraphError([Problem(position(before, len(before), str(path)), "", message)]) from None


class _Loader:
    """Reads files, and continues after a problem, so that all problems are found.

    ``above`` holds the files that are being read, the outermost first; ``contents`` the content
    of each file read; ``unsaved`` takes the place of files, and ``parse`` reads both.
    """

    def __init__(
        self, unsaved: Mapping[Path, str] | None = None, parse: Parse = parse_yaml
    ) -> None:
        self.unsaved, self.parse = unsaved or {}, parse
        self.problems = Problems()
        self.work = Work(self.problems)
        self.done: dict[str, Node | None] = {}
        self.contents: dict[str, bytes] = {}

    def file(self, name: str, at: Location, folder: Path, above: tuple[Path, ...]) -> Node | None:
        """A graph's file with all that it names; each file is read once, however often named."""
        try:
            path = find_file(name, at, folder)
        except GraphError as error:
            self.problems.items += error.problems
            return None
        # Two names of one file, as through a link, are a circle as well.
        if path.resolve() in above:
            chain = " ▸ ".join(p.name for p in (*above, path))
            message = f"graphs refer to each other in a circle: {chain}"
            self.problems.add(*at, message)
            return None
        if len(above) >= MAX_LEVELS:
            message = f"graphs extend or contain each other more than {MAX_LEVELS} levels deep"
            self.work.stop(*at, message)
        key = str(path)
        # Once: ten blocks of one part share its tree, and Measure counts it once.
        if key not in self.done:
            self.done[key] = self.read(path, at, (*above, path.resolve()))
        document = self.done[key]
        if document is not None:
            self.work.check(document, document.where if at[0] == NOWHERE else at[0], at[1])
        return document

    def read(self, path: Path, at: Location, above: tuple[Path, ...]) -> Node | None:
        try:
            document = self.parse(self.text(path, at), str(path))
        except GraphError as error:
            self.problems.items += error.problems
            return None
        return self.complete_root(document, above)

    def complete_root(self, document: Node, above: tuple[Path, ...]) -> Node | None:
        """A file's document, complete; None, and a problem, if it is not a mapping."""
        if not document.is_map:
            message = f"expected a mapping with blocks and wires, got {document.describe()}"
            self.problems.add(document.where, "", message)
            return None
        self.work.charge(self.work.measure.of(document)[0], document.where)
        return self.complete(document, above)

    def text(self, path: Path, at: Location) -> str:
        """The text of a file; its content is stored."""
        if self.unsaved and path.resolve() in self.unsaved:
            return self.unsaved[path.resolve()]
        data = read_file(path, at)
        self.contents[str(path.resolve())] = data
        return decode(data, path)

    def referenced_graph(
        self, node: Node, address: str, what: str, above: tuple[Path, ...]
    ) -> Node | None:
        """The graph whose file or name is written in another."""
        if not is_path(node):
            self.problems.add(node.where, address, f"expected {what}, got {node.describe()}")
            return None
        return self.file(node.value, (node.where, address), _folder(node), above)

    def complete(self, document: Node, above: tuple[Path, ...]) -> Node:
        """Merge what the document extends, and inline the parts that its blocks name."""
        extends = document.get("extends")
        document = with_arrays(document, self.problems, self.work)
        # Parts are inlined before the merge, since it asks whether an entry is the same part as the
        # one below (`part` is set by inlining).
        document = self.parts(document.with_item("extends", None), "blocks", above)
        document = self.runs(self.world(self.own_kinds(document)))
        if extends is None:
            return document
        base: Node | None = None
        for node in extends.value if extends.is_list else [extends]:
            below = self.referenced_graph(node, "extends", "a graph's file or name", above)
            if below is not None:
                # Of several, a later file lies above the earlier ones, and the graph itself above
                # all.
                base = below if base is None else self.merge_and_charge(base, below, node)
        return document if base is None else self.merge_and_charge(base, document, extends)

    def merge_and_charge(self, base: Node, top: Node, at: Node) -> Node:
        return merge(base, top, charge=partial(self.charge, at))

    def charge(self, at: Node, entries: int) -> None:
        self.work.charge(entries, at.where, "extends")

    def world(self, document: Node) -> Node:
        """Insert the world if it is given by name."""
        node = document.get("world")
        if node is None or not is_path(node):
            return document
        try:
            at = (node.where, "world")
            path = find_file(node.value, at, _folder(node), "world")
            world = self.parse(self.text(path, at), str(path))
        except GraphError as error:
            self.problems.items += error.problems
            return document.with_item("world", None)
        return document.with_item("world", Node(world.value, world.where, node.key))

    def runs(self, document: Node) -> Node:
        """Make the runs that a graph begins from relative to the file that names them."""
        whole, initial = document.get("from"), document.get("initial")
        if whole is not None and is_path(whole):
            document = document.with_item("from", _absolute(whole))
        if initial is not None and initial.is_map:
            entries = {k: _absolute(n) if is_path(n) else n for k, n in initial.items()}
            document = document.with_item("initial", Node(entries, initial.where, initial.key))
        return document

    def parts(self, document: Node, address: str, above: tuple[Path, ...]) -> Node:
        blocks = document.get("blocks")
        if blocks is None or not blocks.is_map:
            return document
        entries = dict(blocks.items())
        for name, entry in blocks.items():
            inner = f"{address}.{name}"
            part = entry.get("graph")
            if part is not None:
                entries[name] = self.part(entry, part, inner, above)
            elif entry.get("blocks") is not None:
                entries[name] = self.parts(entry, f"{inner}.blocks", above)
            else:
                entries[name] = self.with_files(entry, inner)
        return document.with_item("blocks", Node(entries, blocks.where, blocks.key))

    def own_kinds(self, document: Node) -> Node:
        """The files of plots and metrics, as those of blocks."""
        for key in FILE_SECTIONS:
            section = document.get(key)
            if section is not None and section.is_map:
                entries = {
                    name: self.with_files(entry, f"{key}.{name}") if entry.is_map else entry
                    for name, entry in section.items()
                }
                document = document.with_item(key, Node(entries, section.where, section.key))
        return document

    def with_files(self, entry: Node, address: str) -> Node:
        """A block whose files are named by absolute paths."""
        for key in FILE_KEYS if entry.is_map else ():
            node = entry.get(key)
            if node is not None and is_path(node):
                entry = entry.with_item(key, _absolute(node))
            elif node is not None and isinstance(node.value, str) and node.value[:1] == "$":
                # Files are read before params are filled in, so that a part's params are known by
                # then.
                message = "write the path itself, which is relative to this file, not a $param"
                self.problems.add(node.where, f"{address}.{key}", message)
        for key, node in entry.items():
            if node.is_map and node.get("module") is not None:  # a setting, as of a neuron model
                entry = entry.with_item(key, self.with_files(node, f"{address}.{key}"))
        return entry

    def part(self, entry: Node, part: Node, address: str, above: tuple[Path, ...]) -> Node:
        below = self.referenced_graph(part, f"{address}.graph", "the file of a part", above)
        if below is None:
            return entry
        params, arguments = below.get("params"), entry.get("params")
        for name, node in arguments.items() if arguments is not None else ():
            if params is None or params.get(name) is None:
                names = [] if params is None else [key for key, _ in params.items()]
                text, other = f"the part has no param '{name}'", ", ".join(names) or "none"
                message = misspelt("unknown-param", text, name, names, f"; it has {other}")
                self.problems.add(node.key, f"{address}.params.{name}", message)
        below = below.with_item("graph", None)
        rest = self.parts(entry.with_item("graph", None), f"{address}.blocks", above)
        charge = partial(self.charge, part)
        entries = _merge_entries(below, rest, "", charge).with_item("part", part)
        return Node(entries.value, entry.where, entry.key)


def is_path(node: Node) -> bool:
    """Whether a value can name a file; ``$names`` are filled in after files are read."""
    return isinstance(node.value, str) and node.value.isprintable() and node.value[:1] not in "$"


def _absolute(node: Node) -> Node:
    """A path relative to the file that names it, which the merged tree no longer knows."""
    return Node(str(resolved(_folder(node) / node.value)), node.where, node.key)


def _folder(node: Node) -> Path:
    """The folder that a path written in a node is relative to."""
    return Path(node.where.file).parent if node.where.line else Path()
