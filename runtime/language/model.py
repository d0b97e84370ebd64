"""What a file's text means: scanned, parsed and checked, each when it is first needed.

In: the file's text, its path, and its :class:`Surroundings` (unsaved files, how modules are read).
Out: a :class:`Model`, which belongs to one version of the file and never changes, so that every
stage is computed at most once::

    source ─▶ root      tolerant tree, always there
           ─▶ tree      the loader's tree; repaired from ``root`` where the file does not parse
           ─▶ document  with all that it extends ─▶ checked_graph ─▶ problems

Everything else in this room is a function of a model and an offset.
"""

from __future__ import annotations

import gc
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal

from blocks.limits import GRAPH_VALUES
from runtime.document import (
    SECTIONS,
    Node,
    decode,
    find_file,
    is_part,
    parse_scalar,
    parse_yaml,
    read_file,
)
from runtime.errors import NOWHERE, GraphError, Problem, SpikeblocksError, Where
from runtime.experiments.design import is_experiment
from runtime.graph import Content, Examination, Graph, examine
from runtime.language.items import YamlItem, deepest
from runtime.language.scan import scan
from runtime.language.surroundings import Surroundings
from runtime.language.text import SourceText
from runtime.network import INPUTS, Network
from runtime.observation import Observation

# overlay: a file that changes a graph below it ("extends", "--with") and is incomplete alone.
Kind = Literal["graph", "part", "overlay", "experiment", "world"]
Change = Callable[[Graph], Graph]
PORTS = ("inputs", "outputs")
# Sections that hardly any other YAML has.
OWN = {"blocks", "wires", "probes", "bypass", "experiment", "vary", "room", "circles"}
_TOP = re.compile(r"^[{ ]?([A-Za-z_]\w*)\s*:", re.MULTILINE)
# What may be right once the graph is there that an overlay changes.
OF_BASE = {
    "unknown-block",
    "unknown-param",
    "unused-param",
    "open-input",
    "open-type",
    "missing-type",
    "missing-value",
    "missing-world",
    "null-value",
    "no-blocks",
}


@contextmanager
def _no_collection() -> Iterator[None]:
    """No garbage collection: it would go through all of a graph's trees again and again.

    What is made here lives as long as its model; the next collection comes between two requests.
    """
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()


@lru_cache(maxsize=128)
def _scan_once(text: str) -> YamlItem:
    return scan(text)


LONGEST_LINE = 500_000  # characters


class Model:
    """One version of one text.

    Parameters
    ----------
    source : the file's text. path : of the file, as messages name it; it need not exist.
    change : makes of the file's graph the one that is checked, as options of a command do.
    """

    def __init__(
        self,
        source: str,
        path: Path,
        surroundings: Surroundings | None = None,
        change: Change | None = None,
    ) -> None:
        self.text = SourceText(source)
        self.path, self.file = path, str(path)
        self.surroundings, self.change = surroundings or Surroundings(), change
        self.memo: dict[str, Any] = {}  # what other modules derive from the file, by their keys

    @classmethod
    def of_file(
        cls, name: str, surroundings: Surroundings | None = None, change: Change | None = None
    ) -> Model:
        """The model of a file, or of a shipped graph.

        Raises
        ------
        GraphError : there is no such file, or it is not text.
        """
        path = find_file(name, (NOWHERE, ""), Path())
        return cls(decode(read_file(path, (NOWHERE, "")), path), path, surroundings, change)

    @cached_property
    def root(self) -> YamlItem:
        """The tree of what is written; empty if the file is too large to be read."""
        # Each entry begins with one of these, and takes 300 bytes; the patterns of the scanner take
        # 100 for each character of a line.
        source = self.text.source
        is_large = sum(map(source.count, ",[{\n\"'")) > GRAPH_VALUES
        is_large = is_large or max(map(len, source.split("\n"))) > LONGEST_LINE
        return YamlItem() if self.refusal or is_large else _scan_once(self.text.source)

    @property
    def refusal(self) -> str:
        """Why the file is not read; empty if it is."""
        return self.surroundings.refusal(self.text.source)

    @cached_property
    def _strict(self) -> Node | list[Problem]:
        if self.refusal:
            return [Problem(Where(self.file), "", self.refusal)]
        try:
            with _no_collection():
                return parse_yaml(self.text.source, self.file)
        except GraphError as error:
            return error.problems

    @property
    def syntax(self) -> list[Problem]:
        """Why the file cannot be read as YAML; empty if it can."""
        return self._strict if isinstance(self._strict, list) else []

    @cached_property
    def tree(self) -> Node:
        """The file as the loader sees it; where it cannot be read, what was scanned of it."""
        return (
            self._strict
            if isinstance(self._strict, Node)
            else repair(self.root, self.text, self.file)
        )

    @property
    def is_ours(self) -> bool:
        """Whether the file is one of a graph, or may become one, and not some other YAML."""
        # Other YAML files are open in the same editor, and must not get hundreds of errors. A file
        # of a few known keys only may become a graph; one with a key of ours alone is one.
        names = set(_TOP.findall(self.text.source))
        from runtime.experiments.design import KEYS

        names_of_ours = {*SECTIONS, *PORTS, *KEYS, "extends", "room", "obstacles", "circles"}
        return bool(names & OWN) or names <= names_of_ours

    @cached_property
    def kind(self) -> Kind:
        """What the file describes."""
        tree = self.tree
        names = {name for name, _ in tree.items()}
        if is_experiment(tree):
            return "experiment"
        if names and names <= {"room", "obstacles", "circles"}:
            return "world"
        if self.path.parent.name == "worlds" and not names & {*SECTIONS, *PORTS}:
            return "world"
        if names & set(PORTS) and not names & {"run", "probes", "plots", "metrics"}:
            return "part"
        return "overlay" if names and not names & {"graph", "run"} and self._is_open else "graph"

    @property
    def _is_open(self) -> bool:
        """Whether entries need a graph below: blocks without a type, wires to unknown blocks."""
        document, _ = self._loading
        blocks = dict((document.get("blocks") or Node({})).items())
        if any(b.is_map and not (b.get("type") or is_part(b)) for b in blocks.values()):
            return True
        wires = document.get("wires") or Node({})
        for name, ports in wires.items():
            for node in (ports.value if ports.is_map else {}).values():
                sources = node.value if node.is_list else [node]
                heads = {str(source.value).partition(".")[0] for source in sources}
                if not heads <= blocks.keys():
                    return True
            if name not in blocks:
                return True
        return False

    @cached_property
    def _loading(self) -> tuple[Node, list[Problem]]:
        document, problems = self.surroundings.complete(self.tree, self.path)
        if self.change is None or problems or self.syntax:
            return document, problems
        try:
            graph = Graph.of_document(document, self.path, self.surroundings.modules)
            return self.change(graph).document, []
        except GraphError as error:
            return document, error.problems

    @property
    def document(self) -> Node:
        """The graph or part with all that it extends."""
        return self._loading[0]

    @cached_property
    def checked_graph(self) -> Examination:
        """The checked graph, as far as that goes."""
        if self.kind in ("experiment", "world"):
            return Examination(self._check_other())
        content = Content(
            self.document,
            source=self.path,
            modules=self.surroundings.modules,
            block_cache=self.surroundings.reusable_blocks(),
            is_part=self.kind == "part",
        )
        with _no_collection():
            return examine(content, loops=True)

    def _check_other(self) -> list[Problem]:
        if self.kind == "world":
            if self.change is not None:
                message = "a world has no blocks; options that change a graph do not apply to it"
                return [Problem(Where(self.file), "", message)]
            result = examine(Content(Node({"world": self.tree, "blocks": Node({})})))
            return [problem for problem in result.problems if problem.address.startswith("world")]
        from runtime.experiments.design import check_experiment

        try:
            change = self.change or (lambda graph: graph)
            near = self.surroundings
            check_experiment(self.tree, self.path, near.load, change, near.unsaved)
        except GraphError as error:
            return error.problems
        except SpikeblocksError as error:
            return [Problem(Where(self.file), "", str(error))]
        return []

    def file_of(self, name: str) -> Path | None:
        """The file that a name in this text stands for: a graph, a world or a Python file."""
        at = (Where(self.file, 1, 1), "")
        for noun in ("graph", "world"):
            try:
                return find_file(name, at, self.path.parent, noun).resolve()
            except GraphError:
                continue
        return None

    @cached_property
    def baseline(self) -> Graph | None:
        """The graph that an experiment names; None if it cannot be read."""
        node = self.tree.get("graph")
        if node is None or not isinstance(node.value, str):
            return None
        try:
            path = find_file(node.value, (node.where, ""), self.path.parent)
            return self.surroundings.load(str(path))
        except GraphError:
            return None

    @property
    def network(self) -> Network | None:
        return self.checked_graph.network

    @property
    def observation(self) -> Observation | None:
        return self.checked_graph.observation

    @cached_property
    def problems(self) -> list[Problem]:
        """Everything that is wrong, in the order of the file, as ``runtime validate`` has it."""
        if self.syntax:
            return self.syntax
        # Where "extends" failed, half a graph would be checked, and every wire would be an error.
        loading = [] if self.kind in ("experiment", "world") else self._loading[1]
        problems = loading or self.checked_graph.problems
        if self.kind == "part":
            # A block may fail for want of what only the graph around a part gives.
            given = {"block-failed", "open-type"} if self._has_open_inputs else {"block-failed"}
            problems = [p for p in problems if p.where.line and p.kind not in given]
        if self.kind == "overlay":
            problems = [p for p in problems if not (p.kind in OF_BASE or self._is_about_null(p))]
        return sorted(set(problems))

    @property
    def _has_open_inputs(self) -> bool:
        """Whether an input of a part has the type, or the length, of what is wired to it."""
        network = self.network
        names = [name for name in network.entries if name.startswith(INPUTS)] if network else []
        return network is not None and not all(map(network.is_typed, names))

    def _is_about_null(self, problem: Problem) -> bool:
        """Whether a problem is about a null, which deletes what the graph below may have."""
        if problem.where.file not in ("", self.file):
            return problem.kind == "unknown-input"  # a null there is known to that file alone
        item = deepest(self.root, self.text.at(problem.where))
        return item.kind == "empty" or (item.kind == "scalar" and item.value in ("null", "~"))


# Completion needs the types of a graph that does not parse. So what was scanned goes to the
# same loader and checks, as if the rest had been written:
#     wires: {sum: {terms: [a.out,      becomes     {"wires": {"sum": {"terms": ["a.out"]}}}
# A key without a colon is left out: as an entry with the value null it would delete what
# "extends" brings. Of two equal keys the first counts; the second is probably being renamed.
def repair(item: YamlItem, text: SourceText, file: str) -> Node:
    """What was scanned, as the loader would have read it."""
    where = text.where(item.start, file)
    key = where if item.key_start < 0 else text.where(item.key_start, file)
    if item.kind == "map":
        entries: dict[str, Node] = {}
        for inner in item.items:
            if inner.colon >= 0 or inner.kind != "empty":
                entries.setdefault(inner.key, repair(inner, text, file))
        return Node(entries, where, key)
    if item.kind == "list":
        return Node([repair(inner, text, file) for inner in item.items], where, key)
    if item.kind == "empty" or item.quoted:
        return Node(item.value if item.quoted else None, where, key)
    try:
        return Node(parse_scalar(item.value), where, key)
    except ValueError:
        return Node(0, where, key)
