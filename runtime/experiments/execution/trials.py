"""Trials: each configuration of a graph with every seed, as data that can be sent to workers.

In: a graph and the values of its factors. Out: :class:`Trial`, which any process can run that has
this package: the resolved text of the graph, the files of its own blocks, what to set, a seed::

    configuration 2 of three seeds  ->  trials 6, 7, 8
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

from runtime.document import dump_yaml, flow_yaml
from runtime.experiments.design import Seeds

if TYPE_CHECKING:
    from runtime.graph import Graph


@dataclass(frozen=True)
class GraphBundle:
    """A graph that can be sent to another process: its resolved text, and the files that it names.

    Any process that can import this package can run it.
    """

    text: str
    beside: tuple[tuple[str, bytes], ...] = ()

    @classmethod
    def of(cls, graph: Graph) -> GraphBundle:
        """Resolve a graph.

        Raises
        ------
        UsageError : a block type is defined in no file, or in one that cannot be read.
        """
        from runtime.runs import contents, portable

        texts = graph.texts
        plain, files = portable(graph.to_dict(modules=True), texts)
        return cls(dump_yaml(plain), tuple(sorted(contents(files, texts).items())))

    @property
    def files(self) -> dict[str, bytes]:
        """The contents of the files that the graph names, by name."""
        return dict(self.beside)

    @cached_property
    def digest(self) -> str:
        """A hash of the resolved graph and of its files."""
        content_hash = hashlib.sha256(self.text.encode("utf-8", "backslashreplace"))
        for name, content in self.beside:
            content_hash.update(json.dumps([name, len(content)]).encode() + content)
        return content_hash.hexdigest()


@dataclass(frozen=True)
class Configuration:
    """A variant of a graph with a value for each factor.

    Parameters
    ----------
    number : counted from 0.
    cells : its strings in the index, one per column.
    bundle : the graph.
    edits : (path, value as YAML) to set in it.
    """

    number: int
    cells: tuple[str, ...]
    bundle: GraphBundle
    edits: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True)
class Trial:
    """One run: a configuration with a seed. ``number`` counts the trials of the whole plan."""

    number: int
    configuration: Configuration
    seed: int

    @property
    def digest(self) -> str:
        """A hash of all that its numbers depend on."""
        edits = self.configuration.edits
        content = json.dumps([self.configuration.bundle.digest, edits, self.seed])
        return hashlib.sha256(content.encode()).hexdigest()


def trials_of(configurations: Iterable[Configuration], seeds: Seeds) -> Iterator[Trial]:
    """Every configuration with every seed, one configuration after the other."""
    # Not seed by seed: a worker checks and plans a configuration once for all its seeds.
    for configuration in configurations:
        for i, seed in enumerate(seeds):
            yield Trial(configuration.number * len(seeds) + i, configuration, seed)


def configurations_of(
    bundle: GraphBundle,
    paths: tuple[str, ...],
    design: Iterable[tuple[Any, ...]],
    first: int = 0,
    variant: tuple[str, ...] = (),
) -> Iterator[Configuration]:
    """A graph with each combination of values, numbered from ``first``."""
    for number, values in enumerate(design, first):
        cells = tuple(map(flow_yaml, values))
        edits = tuple(zip(paths, cells, strict=True))
        yield Configuration(number, (*variant, *cells), bundle, edits)
