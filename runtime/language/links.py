"""Which files a text builds on, and which of its blocks are parts: by what is written alone."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from runtime.language.items import Item
from runtime.language.model import Model

Scope = tuple[str, ...]
MAX_LEVELS = 20


def is_experiment_text(model: Model) -> bool:
    """Whether a text describes an experiment, by its keys."""
    return any(model.root.get(key) for key in ("experiment", "vary", "variants"))


def bases(model: Model) -> list[tuple[Path, Scope]]:
    """The files that a text builds on, each with the part that it is used as, or ()."""
    if "bases" not in model.memo:
        model.memo["bases"] = [*_bases(model)]
    found: list[tuple[Path, Scope]] = model.memo["bases"]
    return found


def _bases(model: Model) -> Iterator[tuple[Path, Scope]]:
    root = model.root
    if is_experiment_text(model):
        named = [root, *(root.get("variants") or Item()).items]
        files = [item.get("graph") for item in named]
        yield from _resolved(model, [item for item in files if item is not None], ())
        return
    extends = root.get("extends")
    if extends is not None:
        yield from _resolved(model, extends.scalars(), ())
    for item in (root.get("blocks") or Item()).items:
        yield from _parts_of(model, item, ())


def overlays(model: Model) -> list[tuple[Path, Path]]:
    """The files that an experiment lays over a graph, each with that graph."""
    if not is_experiment_text(model):
        return []
    found = []
    root = model.root
    for item in (root, *(root.get("variants") or Item()).items):
        graph = item.get("graph") or root.get("graph")
        laid = item.get("with")
        if graph is None or laid is None:
            continue
        below = [path for path, _ in _resolved(model, graph.scalars(), ())]
        found += [
            (path, base) for path, _ in _resolved(model, laid.scalars(), ()) for base in below
        ]
    return found


def _parts_of(model: Model, item: Item, scope: Scope) -> Iterator[tuple[Path, Scope]]:
    graph, blocks = item.get("graph"), item.get("blocks")
    if graph is not None:
        yield from _resolved(model, graph.scalars(), (*scope, item.key))
    for inner in blocks.items if blocks is not None else ():
        yield from _parts_of(model, inner, (*scope, item.key))


def _resolved(model: Model, items: list[Item], scope: Scope) -> Iterator[tuple[Path, Scope]]:
    for item in items:
        path = model.found(item.value)
        if path is not None and path != model.path.resolve():
            yield path, scope


def other(model: Model, path: Path) -> Model | None:
    """The model of another file, as the text's surroundings have it; None if it cannot be read."""
    text = model.surroundings.text(path)
    return None if text is None else Model(text, path, model.surroundings)


def parts(model: Model, level: int = 0) -> frozenset[Scope]:
    """The scopes that blocks of a text open, those of the files that it builds on included."""
    if "parts" not in model.memo:
        model.memo["parts"] = frozenset(_opened(model, level))
    found: frozenset[Scope] = model.memo["parts"]
    return found


def _opened(model: Model, level: int) -> Iterator[Scope]:
    for item in (model.root.get("blocks") or Item()).items:
        yield from _written(item, ())
    if level < MAX_LEVELS:
        for path, scope in bases(model):
            base = other(model, path)
            if base is not None:
                yield from ((*scope, *inner) for inner in parts(base, level + 1))


def _written(item: Item, scope: Scope) -> Iterator[Scope]:
    if item.get("graph") is not None or item.get("blocks") is not None:
        yield (*scope, item.key)
        for inner in (item.get("blocks") or Item()).items:
            yield from _written(inner, (*scope, item.key))


def modules(model: Model) -> list[Path]:
    """The Python files that the blocks of a text name."""
    found = []
    for item in (model.root.get("blocks") or Item()).items:
        named = item.get("module")
        if named is not None and named.kind == "scalar":
            found.append((model.path.parent / named.value).resolve())
    return found
