"""Which files another builds on, and which of its blocks are parts: by what is written alone.

In: a model. Out: paths, each with the part that the file is used as::

    extends: base.yaml                      (base.yaml, ())
    blocks: {arm: {graph: parts/arm.yaml}}  (parts/arm.yaml, ("arm",))

Only the scanned tree is read: renaming looks at hundreds of files, of which none must be checked,
and has to work where a graph has errors.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from blocks.files import resolved
from runtime.language.items import YamlItem
from runtime.language.model import Model

PartPath = tuple[str, ...]
# Files that extend each other in a circle end here; the loader reports them.
MAX_LEVELS = 20


def is_experiment_text(model: Model) -> bool:
    """Whether a file describes an experiment, by its keys."""
    return any(model.root.get(key) for key in ("experiment", "vary", "variants"))


def bases(model: Model) -> list[tuple[Path, PartPath]]:
    """The files that another builds on, each with the part that it is used as, or ()."""
    if "bases" not in model.memo:
        model.memo["bases"] = [*_bases(model)]
    result: list[tuple[Path, PartPath]] = model.memo["bases"]
    return result


def _bases(model: Model) -> Iterator[tuple[Path, PartPath]]:
    root = model.root
    if is_experiment_text(model):
        mappings = [root, *(root.get("variants") or YamlItem()).items]
        files = [item.get("graph") for item in mappings]
        yield from _paths_of(model, [item for item in files if item is not None], ())
        return
    extends = root.get("extends")
    if extends is not None:
        yield from _paths_of(model, extends.scalars(), ())
    for item in (root.get("blocks") or YamlItem()).items:
        yield from _parts_of(model, item, ())


def overlays(model: Model) -> list[tuple[Path, Path]]:
    """The files that an experiment lays over a graph, each with that graph."""
    if not is_experiment_text(model):
        return []
    pairs = []
    root = model.root
    for item in (root, *(root.get("variants") or YamlItem()).items):
        graph = item.get("graph") or root.get("graph")
        overlay = item.get("with")
        if graph is None or overlay is None:
            continue
        below = [path for path, _ in _paths_of(model, graph.scalars(), ())]
        pairs += [
            (path, base) for path, _ in _paths_of(model, overlay.scalars(), ()) for base in below
        ]
    return pairs


def _parts_of(model: Model, item: YamlItem, scope: PartPath) -> Iterator[tuple[Path, PartPath]]:
    graph, blocks = item.get("graph"), item.get("blocks")
    if graph is not None:
        yield from _paths_of(model, graph.scalars(), (*scope, item.key))
    for inner in blocks.items if blocks is not None else ():
        yield from _parts_of(model, inner, (*scope, item.key))


def _paths_of(
    model: Model, items: list[YamlItem], scope: PartPath
) -> Iterator[tuple[Path, PartPath]]:
    for item in items:
        path = model.file_of(item.value)
        if path is not None and path != model.path.resolve():
            yield path, scope


def other(model: Model, path: Path) -> Model | None:
    """The model of another file, as this one's surroundings have it; None if it cannot be read."""
    text = model.surroundings.text(path)
    return None if text is None else Model(text, path, model.surroundings)


def parts(model: Model, level: int = 0) -> frozenset[PartPath]:
    """The scopes that blocks of a file open, those of the files that it builds on included."""
    if "parts" not in model.memo:
        model.memo["parts"] = frozenset(_part_scopes(model, level))
    result: frozenset[PartPath] = model.memo["parts"]
    return result


def _part_scopes(model: Model, level: int) -> Iterator[PartPath]:
    for item in (model.root.get("blocks") or YamlItem()).items:
        yield from _inline_parts(item, ())
    if level < MAX_LEVELS:
        for path, scope in bases(model):
            base = other(model, path)
            if base is not None:
                yield from ((*scope, *inner) for inner in parts(base, level + 1))


def _inline_parts(item: YamlItem, scope: PartPath) -> Iterator[PartPath]:
    if item.get("graph") is not None or item.get("blocks") is not None:
        yield (*scope, item.key)
        for inner in (item.get("blocks") or YamlItem()).items:
            yield from _inline_parts(inner, (*scope, item.key))


def modules(model: Model) -> list[Path]:
    """The Python files that the blocks of a file name."""
    paths = []
    for item in (model.root.get("blocks") or YamlItem()).items:
        module = item.get("module")
        if module is not None and module.kind == "scalar":
            paths.append(resolved(model.path.parent / module.value))
    return paths
