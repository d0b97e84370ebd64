"""Where a file mentions blocks, params, probes, ports, types and files, by its words alone.

In: a model. Out: :class:`Mention` objects, from which definitions, references and renames follow::

    wires: {sum: {terms: [arm.pid.u]}}   block sum; block arm; block pid in the scope ("arm",)
    blocks: {sum: {gain: $k}}            block sum (defines it); param k
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from runtime.document import PART_SECTIONS
from runtime.experiments.design import CHANGES
from runtime.language.items import YamlItem
from runtime.language.links import is_experiment_text, parts
from runtime.language.model import Model
from runtime.language.text import Span
from runtime.observation import METRIC_KINDS, PLOT_KINDS

Noun = Literal["block", "param", "probe", "input", "output", "plot", "metric", "type", "file"]
PartPath = tuple[str, ...]

# The keys of plots and metrics whose values name probes or addresses.
SIGNAL_KEYS = {"of"}.union(
    *(kind.signals for kind in PLOT_KINDS.values()),
    *((*kind.inputs, *kind.optional) for kind in METRIC_KINDS.values()),
)
_PARAM = re.compile(r"\$([A-Za-z_]\w*)")


@dataclass(frozen=True)
class Symbol:
    """A name with what it names; ``scope`` lists the parts that it is inside of."""

    noun: Noun
    scope: PartPath
    name: str


@dataclass(frozen=True)
class Mention:
    """A symbol at a place of the file; ``defines`` marks the entry that introduces it."""

    symbol: Symbol
    span: Span
    defines: bool = False


def mentions(model: Model) -> list[Mention]:
    """All that a file mentions, in no particular order."""
    if "mentions" not in model.memo:
        model.memo["mentions"] = [*_MentionReader(model).read()]
    cached: list[Mention] = model.memo["mentions"]
    return cached


class _MentionReader:
    """Walks the tree of a file; ``parts`` are the scopes that blocks are known to open."""

    def __init__(self, model: Model) -> None:
        self.root = model.root
        self.parts = parts(model)
        self.is_experiment = is_experiment_text(model)

    def read(self) -> Iterator[Mention]:
        if self.is_experiment:
            yield from self.experiment(self.root)
        else:
            yield from self.graph(self.root, ())

    def graph(self, root: YamlItem, scope: PartPath) -> Iterator[Mention]:
        """The sections of a graph or part."""
        for section in root.items:
            name = section.key
            if name == "blocks":
                for item in section.items:
                    yield from self.block(item, scope)
            elif name == "wires":
                for item in section.items:
                    yield from self.wires(item, scope)
            elif name in ("params", "inputs"):
                noun: Noun = "param" if name == "params" else "input"
                yield from (self.key(item, noun, scope, True) for item in section.items)
            elif name in ("probes", "plots", "metrics", "outputs"):
                yield from self.recorded_signals(section, scope)
            elif name in ("without", "bypass"):
                for item in section.scalars():
                    yield from self.address(item, scope)
            elif name in ("extends", "world") and not section.items:
                yield from self.file(section)
            elif name == "extends":
                for item in section.items:
                    yield from self.file(item)
            # Blocks were read above, where those of a part have another scope; params cannot refer
            # to params.
            if name not in ("blocks", "params"):
                yield from self.params(section, scope)

    def key(self, item: YamlItem, noun: Noun, scope: PartPath, defines: bool = False) -> Mention:
        return Mention(Symbol(noun, scope, item.key), item.key_span, defines)

    def file(self, item: YamlItem) -> Iterator[Mention]:
        if item.kind == "scalar":
            yield Mention(Symbol("file", (), item.value), item.span)

    def params(self, item: YamlItem, scope: PartPath) -> Iterator[Mention]:
        """The ``$names`` in a value."""
        for inner in item.walk():
            match = _PARAM.fullmatch(inner.value) if inner.kind == "scalar" else None
            if match is not None:
                # Behind the quote, if there is one, and the "$".
                start = inner.start + inner.quoted + 1
                yield Mention(Symbol("param", scope, match[1]), Span(start, start + len(match[1])))

    def block(self, item: YamlItem, scope: PartPath) -> Iterator[Mention]:
        yield self.key(item, "block", scope, True)
        inside = (*scope, item.key)
        is_part = inside in self.parts
        for entry in item.items:
            if entry.key == "type" and entry.kind == "scalar":
                yield Mention(Symbol("type", scope, entry.value), entry.span)
            elif entry.key in ("graph", "module"):
                yield from self.file(entry)
            elif is_part and entry.key == "params":
                yield from (self.key(inner, "param", inside) for inner in entry.items)
                yield from self.params(entry, scope)
            elif not (is_part and entry.key in PART_SECTIONS):
                yield from self.params(entry, scope)
        if is_part:
            sections = [e for e in item.items if e.key in PART_SECTIONS and e.key != "params"]
            yield from self.graph(YamlItem(kind="map", items=sections), inside)

    def wires(self, item: YamlItem, scope: PartPath) -> Iterator[Mention]:
        yield self.key(item, "block", scope)
        inside = (*scope, item.key)
        for port in item.items:
            if inside in self.parts:
                yield self.key(port, "input", inside)
            for source in port.scalars():
                yield from self.address(source, scope)

    def recorded_signals(self, section: YamlItem, scope: PartPath) -> Iterator[Mention]:
        nouns: dict[str, Noun] = {"probes": "probe", "plots": "plot", "metrics": "metric"}
        for item in section.items:
            yield self.key(item, nouns.get(section.key, "output"), scope, True)
            if section.key in ("probes", "outputs"):
                for source in (item.get("of") or item).scalars():
                    yield from self.address(source, scope)
                continue
            for entry in item.items:
                if entry.key in SIGNAL_KEYS:
                    for source in entry.scalars():
                        yield from self.signal(source, scope)

    def signal(self, item: YamlItem, scope: PartPath) -> Iterator[Mention]:
        """A probe's name or an address."""
        if "." in item.value:
            yield from self.address(item, scope)
        else:
            yield Mention(Symbol("probe", scope, item.value), item.span)

    def address(self, item: YamlItem, scope: PartPath) -> Iterator[Mention]:
        """The names in ``part.block.output``."""
        start = item.start + item.quoted
        if item.kind == "scalar" and not item.value.startswith("$"):
            yield from self.names(item.value, start, scope)

    def names(self, text: str, start: int, scope: PartPath) -> Iterator[Mention]:
        """The blocks, ports and params in a path that is written at an offset."""
        is_first = True
        while text:
            name, _, text = text.partition(".")
            span = Span(start, start + len(name))
            start = span.end + 1
            # "inputs.error", inside a part, is what is wired to it.
            if is_first and name == "inputs" and text:
                port = text.partition(".")[0]
                yield Mention(Symbol("input", scope, port), Span(start, start + len(port)))
                return
            if name == "blocks" and text:
                continue
            if is_first or (*scope, name) in self.parts:
                yield Mention(Symbol("block", scope, name), span)
            else:
                yield from self.inside(name, span, text, start, scope)
                return
            is_first = False
            if (*scope, name) not in self.parts:
                return
            scope = (*scope, name)

    # "arm.theta" may name an output of the part "arm", an input, or a block inside it, which only
    # the part's file knows. So all three are mentioned; ``names`` takes the one that some file
    # defines.
    def inside(
        self, name: str, span: Span, text: str, start: int, scope: PartPath
    ) -> Iterator[Mention]:
        """A name after that of a part: an output, a block, or ``params.name``."""
        if name == "params" and text:
            param = text.partition(".")[0]
            yield Mention(Symbol("param", scope, param), Span(start, start + len(param)))
        elif text:
            yield Mention(Symbol("block", scope, name), span)
        else:
            yield Mention(Symbol("output", scope, name), span)
            yield Mention(Symbol("block", scope, name), span)
            yield Mention(Symbol("input", scope, name), span)

    def experiment(self, root: YamlItem) -> Iterator[Mention]:
        """The changes that an experiment makes, and what it varies and optimizes."""
        for item in root.items:
            if item.key == "graph":
                yield from self.file(item)
            elif item.key in CHANGES:
                yield from self.change(item)
            elif item.key == "vary":
                for inner in item.items:
                    yield from self.path(inner.key, inner.key_start)
            elif item.key in ("minimize", "maximize") and item.kind == "scalar":
                yield Mention(Symbol("metric", (), item.value), item.span)
            elif item.key == "variants":
                for variant in item.items:
                    yield from self.experiment(variant)

    def change(self, item: YamlItem) -> Iterator[Mention]:
        if item.key == "with":
            for each in item.scalars():
                yield from self.file(each)
        elif item.kind != "map":
            for each in item.scalars():
                yield from self.address(each, ())
        for inner in item.items if item.kind == "map" else ():
            yield from self.path(inner.key, inner.key_start)
            if item.key == "wire":
                for source in inner.scalars():
                    yield from self.address(source, ())

    def path(self, text: str, start: int) -> Iterator[Mention]:
        """A path as ``set`` takes it."""
        head, _, rest = text.partition(".")
        nouns: dict[str, Noun] = {"params": "param", "probes": "probe", "plots": "plot"}
        if head in nouns and rest:
            start += len(head) + 1
            name = rest.partition(".")[0]
            yield Mention(Symbol(nouns[head], (), name), Span(start, start + len(name)))
        elif head not in ("run", "world", "graph"):
            skip = len("blocks.") if head == "blocks" else 0
            yield from self.names(text[skip:], start + skip, ())
