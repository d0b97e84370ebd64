"""The text of a graph with all that is known about it: the part of the studio that edits.

In: a text, an offset, a block, a change. Out: plain data for the page, and new texts; nothing runs
here. Every change by a click is one of the graph, written into the text
(:func:`runtime.language.write_document`), so that comments stay.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from blocks.core import plain
from blocks.library.registry import BUILTIN, Modules
from runtime.diagrams import diagram
from runtime.document import SHIPPED, Node
from runtime.errors import SpikeblocksError, UsageError
from runtime.graph import Graph
from runtime.language import (
    Model,
    Surroundings,
    actions,
    complete,
    delete_block,
    diagnose,
    hover,
    place_of,
    why_not,
    write_document,
)
from runtime.network import NetworkEntry
from spikeblocks.studio.sliders import is_number, path_of, sliders_of

OFFERED = 60  # types that may take a block's place


class Desk:
    """One text and its model.

    Parameters
    ----------
    text : of the graph. path : its file, which need not exist. modules : how Python files that
        the graph names are read; False leaves them alone.
    """

    def __init__(self, text: str, path: Path, modules: Modules = False) -> None:
        self.path, self.surroundings = path, Surroundings(modules=modules)
        self.read(text)

    def read(self, text: str) -> None:
        """Take another text."""
        self.model = Model(text, self.path, self.surroundings)

    @property
    def text(self) -> str:
        """The present text."""
        return self.model.text.source

    @property
    def graph(self) -> Graph:
        """The graph of the text."""
        return Graph.of_document(self.model.document, self.path, self.surroundings.modules)

    @property
    def is_valid(self) -> bool:
        """Whether the text is that of a graph that can run."""
        return self.model.kind == "graph" and not self.model.problems

    @property
    def python_files(self) -> list[str]:
        """The Python files that the graph names, which running it would execute."""
        names: list[str] = []
        nodes = [self.model.document]
        while nodes:
            node = nodes.pop()
            nodes += node.value.values() if node.is_map else node.value if node.is_list else ()
            named = node.get("module")
            if named is not None and isinstance(named.value, str):
                names.append(named.value)
        return sorted(set(names))

    # What the page shows

    def problems(self) -> list[dict[str, Any]]:
        """What is wrong, with the fixes that are offered."""
        found = []
        for each in diagnose(self.model):
            fixes = [
                {"title": action.title, "edits": [[*edit.span, edit.new] for edit in action.edits]}
                for action in actions(self.model, each.span)
                if action.fixes == each
            ]
            start, end = each.span
            line, column = self.model.text.position(start, "utf-32")
            found.append(
                {
                    **{"from": start, "to": end, "line": line + 1, "column": column + 1},
                    **{"text": each.message, "severity": each.severity, "fixes": fixes[:3]},
                }
            )
        return found

    def picture(self) -> str:
        """The block diagram as SVG; '' without one."""
        network, observation = self.model.network, self.model.observation
        if network is None or self.model.problems:
            return ""
        probes = observation.probes.values() if observation is not None else ()
        text = str(diagram(network, "svg", probes=probes))
        return text[text.index("<svg") :]

    def numbers(self) -> list[dict[str, Any]]:
        """The numbers that sliders change."""
        network = self.model.network
        if network is None or not self.is_valid:
            return []
        return sliders_of(network, self.model.document)

    def block(self, name: str) -> dict[str, Any] | None:
        """What a block is, where it is written, and what can be done to it; why not otherwise."""
        network = self.model.network
        entry = network.entries.get(name) if network is not None else None
        removed = name in _names(self.model.document, "without")
        bypassed = name in _names(self.model.document, "bypass")
        item = self.model.root.at("blocks", name.split(".")[0])
        span = [item.begin, max(item.end, item.key_end)] if item is not None else None
        made: dict[str, Any] = {"name": name, "span": span, "type": "", "doc": ""}
        made |= {"parameters": [], "outputs": [], "removed": removed, "bypassed": bypassed}
        if entry is not None and network is not None:
            spec = entry.cls.spec
            doc = (entry.cls.__doc__ or "").strip().split("\n")[0]
            made |= {"type": entry.cls.__name__, "doc": doc}
            made["outputs"] = [
                {"address": f"{name}.{port}", "type": str(network.types.get((name, port), ""))}
                for port in spec.outputs
            ]
            made["parameters"] = [*self._form(name, entry)]
        made["actions"] = {
            action: self.reason(action, name)
            for action in ("without", "bypass", "delete", "restore")
        }
        return made

    def _form(self, name: str, entry: NetworkEntry) -> Iterator[dict[str, Any]]:
        block = entry.block_or_none
        for key, declared in entry.cls.spec.params.items():
            path = path_of(name, key)
            value = plain(block.value(key)) if block is not None else None
            text = str(value)
            yield {
                **{
                    "key": key,
                    "path": path,
                    "value": text if len(text) < 60 else text[:57] + "...",
                },
                **{"doc": declared.doc, "unit": declared.unit, "expected": declared.describe()},
                "place": place_of(self.model.document, path),
                "number": is_number(value),
            }

    def reason(self, action: str, name: str, value: str = "") -> str:
        """Why an action is not possible; '' if it is."""
        try:
            return why_not(self.model, self.change(action, name, value))
        except SpikeblocksError as error:
            return str(error)

    def replacements(self, name: str) -> list[str]:
        """Types that can take a block's place and have its wired ports."""
        network = self.model.network
        entry = network.entries.get(name) if network is not None else None
        if entry is None or network is None or "." in name:
            return []
        wired_in = {w.port for w in network.wires if w.block == name}
        wired_out = {w.source.port for w in network.wires if w.source.block == name}
        found = []
        for kind, cls in BUILTIN.items():
            fits = wired_in <= set(cls.spec.inputs) and wired_out <= set(cls.spec.outputs)
            if fits and kind != entry.cls.__name__ and not self.reason("replace", name, kind):
                found.append(kind)
            if len(found) == OFFERED:
                break
        return sorted(found)

    # Changes, each a new text

    def change(self, action: str, name: str, value: Any = "") -> str:
        """The text after an action on a block, or with an entry set.

        Raises
        ------
        UsageError, GraphError : it is not possible.
        """
        document, graph = self.model.document, self.graph
        if action == "without":
            new = graph.without(name, origin="without").document
        elif action == "bypass":
            new = graph.bypass(name, origin="bypass").document
        elif action == "restore":
            new = _without_name(document, name)
        elif action == "delete":
            if "." in name:
                raise UsageError(f"'{name}' is written in the file of a part")
            new = delete_block(document, name)
        elif action == "replace":
            new = graph.replace(name, str(value), origin="replace").document
        elif action == "set":
            new = graph.set(place_of(document, name), value, origin=name).document
        else:
            raise UsageError(f"there is no action '{action}'")
        return write_document(self.model, new)

    def completions(self, offset: int) -> dict[str, Any]:
        """What can be written at an offset."""
        found = complete(self.model, offset)
        offers = [
            {
                **{"label": o.label, "detail": o.detail, "icon": o.icon, "doc": o.doc},
                **{"insert": o.text, "snippet": o.is_snippet, "rank": o.rank},
            }
            for o in found.offers[:200]
        ]
        return {"from": found.span.start, "to": found.span.end, "offers": offers}

    def card(self, offset: int) -> dict[str, Any] | None:
        """What is known of the name at an offset."""
        found = hover(self.model, offset)
        if found is None:
            return None
        return {"from": found.span.start, "to": found.span.end, "text": found.markdown}

    def block_at(self, offset: int) -> str:
        """The block whose entry or wires an offset is in; '' if there is none."""
        for section in ("blocks", "wires"):
            holder = self.model.root.get(section)
            for item in holder.items if holder is not None else ():
                if item.begin <= offset <= max(item.end, item.key_end):
                    return item.key
        return ""


def shipped(path: Path) -> bool:
    """Whether a file is one that comes with the library, which is never written."""
    return SHIPPED.resolve() in path.resolve().parents


def _names(document: Node, section: str) -> list[str]:
    node = document.get(section)
    plain_names = node.plain() if node is not None else []
    return plain_names if isinstance(plain_names, list) else [plain_names]


def _without_name(document: Node, name: str) -> Node:
    """The document with a block back in place."""
    if not any(name in _names(document, section) for section in ("without", "bypass")):
        raise UsageError(f"'{name}' is neither left out nor bypassed")
    for section in ("without", "bypass"):
        node = document.get(section)
        if node is None:
            continue
        items = node.value if node.is_list else [node]
        kept = [item for item in items if item.value != name]
        document = document.with_item(section, Node(kept, node.where, node.key) if kept else None)
    return document
