"""What a file's meaning depends on besides itself, and what was found of earlier versions of it.

In: the texts that an editor holds, and how modules are read. Out: :class:`Surroundings`, which
models of many texts share::

    Surroundings({path: "blocks: ..."}).load("g.yaml")     the graph with the unsaved text
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

from blocks.core import Block
from blocks.files import read_text
from blocks.library.registry import Modules
from blocks.limits import GRAPH_FILE
from runtime.document import Node, complete_document, find_file, parse_yaml
from runtime.errors import NOWHERE, GraphError, MissingExtraError, Problem, Where
from runtime.graph import Graph

MAX_BLOCKS = 50_000
MAX_BASELINES = 8


@lru_cache(maxsize=128)
def _parse_once(text: str, file: str) -> Node:
    return parse_yaml(text, file)


@dataclass(frozen=True)
class Surroundings:
    """What a file's meaning depends on besides itself.

    unsaved : texts that editors hold, by resolved path; they take the place of the files.
    modules : whether, or how, Python files that graphs name are read.
    block_cache : blocks of earlier versions, by type and parameters.
    longest : characters of a file that is read; None for any number.
    baselines : graphs that experiments name, as they were read last.
    """

    unsaved: Mapping[Path, str] = field(default_factory=dict)
    modules: Modules = False
    block_cache: dict[tuple[type[Block], str], Block] = field(default_factory=dict, compare=False)
    longest: int | None = None
    baselines: dict[Path, Graph] = field(default_factory=dict, compare=False)

    def refusal(self, source: str) -> str:
        """Why a file is not read; empty if it is."""
        if self.longest is None or len(source) <= self.longest:
            return ""
        return (
            f"nothing in this file is checked or completed here, since it has {len(source):,} "
            f"characters, more than {self.longest:,}; 'runtime validate' checks it"
        )

    # Files that many texts extend are parsed once for all of them; the limit is the editor's, so it
    # is checked here and not in the cache.
    def _parse(self, text: str, file: str) -> Node:
        if reason := self.refusal(text):
            raise GraphError([Problem(Where(file), "", reason)])
        return _parse_once(text, file)

    def reusable_blocks(self) -> dict[tuple[type[Block], str], Block]:
        """The blocks that were constructed for earlier versions of files; blocks never change."""
        if len(self.block_cache) > MAX_BLOCKS:
            self.block_cache.clear()
        return self.block_cache

    def complete(self, document: Node, path: Path) -> tuple[Node, list[Problem]]:
        """A document with all that it extends and its parts, and what is wrong with those."""
        return complete_document(document, path, self.unsaved, self._parse)

    def text(self, path: Path) -> str | None:
        """The text of another file; None if it cannot be read."""
        unsaved = self.unsaved.get(path.resolve())
        if unsaved is not None:
            return unsaved
        try:
            return read_text(path, GRAPH_FILE, "utf-8-sig", "replace")
        except (OSError, ValueError):
            return None

    def load(self, name: str) -> Graph:
        """A graph that an experiment names; the same one as long as its text is the same.

        So it is checked once, and so is each value that the experiment tries in it.

        Raises
        ------
        GraphError : it cannot be read.
        """
        path = find_file(name, (NOWHERE, ""), Path())
        document, problems = self.complete(self._parse(self.text(path) or "", str(path)), path)
        if problems:
            raise GraphError(problems)
        earlier = self.baselines.get(path)
        if earlier is not None and earlier.document == document:
            return earlier
        graph = Graph.of_document(document, path, self.modules)
        try:
            if not graph.texts:  # a table or a module may change while the graph does not
                if len(self.baselines) >= MAX_BASELINES:
                    self.baselines.clear()
                self.baselines[path] = graph
        except (GraphError, MissingExtraError):
            pass  # whoever asked for the graph checks it, and reports what is wrong
        return graph
