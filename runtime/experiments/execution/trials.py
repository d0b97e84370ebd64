"""Trials: each configuration of a graph with every seed, as data that can be sent to workers."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from runtime.document import dump_yaml, flow_yaml, parse_yaml
from runtime.errors import UsageError
from runtime.experiments.design import Seeds

if TYPE_CHECKING:
    from runtime.graph import Graph


@dataclass(frozen=True)
class GraphBundle:
    """A graph that can be sent to another process: its resolved text and its user modules.

    Any process that can import this package can run it.
    """

    text: str
    modules: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, graph: Graph) -> GraphBundle:
        """Resolve a graph.

        Raises
        ------
        UsageError : a block type is defined in no file, or in one that cannot be read.
        """
        from runtime.runs import contents, portable_modules

        plain, files = portable_modules(parse_yaml(graph.to_yaml(), "graph").plain())
        modules = {}
        for name, content in contents(files, graph.texts).items():
            try:
                modules[name] = content.decode("utf-8")
            except UnicodeDecodeError:
                raise UsageError(f"'{files[name]}' is not UTF-8; save the file as UTF-8") from None
        return cls(dump_yaml(plain), tuple(sorted(modules.items())))

    @property
    def files(self) -> dict[str, bytes]:
        """The contents of the modules' files, by name."""
        return {name: text.encode("utf-8") for name, text in self.modules}

    @property
    def digest(self) -> str:
        content = json.dumps([self.text, self.modules])
        return hashlib.sha256(content.encode()).hexdigest()


@dataclass(frozen=True)
class Configuration:
    """A graph with a value for each factor, or a variant of an ablation.

    Parameters
    ----------
    number : counted from 0.
    cells : its texts in the index, one per column.
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


def trials_of(configurations: Iterable[Configuration], seeds: Seeds) -> Iterator[Trial]:
    """Every configuration with every seed, one configuration after the other."""
    for configuration in configurations:
        for i, seed in enumerate(seeds):
            yield Trial(configuration.number * len(seeds) + i, configuration, seed)


def swept_configurations(
    bundle: GraphBundle, paths: tuple[str, ...], design: Iterable[tuple[Any, ...]]
) -> Iterator[Configuration]:
    """The configurations of a sweep."""
    for number, values in enumerate(design):
        cells = tuple(map(flow_yaml, values))
        yield Configuration(number, cells, bundle, tuple(zip(paths, cells, strict=True)))
