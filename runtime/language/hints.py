"""What editors show between the lines: types and rates at wires, values of params, and commands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from runtime.document import flow_yaml
from runtime.language.addresses import target_of
from runtime.language.cursor import steps
from runtime.language.items import Item
from runtime.language.model import Model
from runtime.language.scopes import params_in, scope_at
from runtime.language.text import Span

MAX_SHOWN = 30


@dataclass(frozen=True)
class Hint:
    """A text shown after an offset; ``is_type`` for types of wires."""

    offset: int
    label: str
    is_type: bool


@dataclass(frozen=True)
class Lens:
    """A command above a line: ``run``, ``compare`` (with and without a block) or ``diagram``."""

    span: Span
    title: str
    command: str
    block: str = ""


def hints(model: Model, span: Span) -> list[Hint]:
    """The hints in a part of the text."""
    if model.kind in ("experiment", "world"):
        return []
    return [*_hints(model, model.root, span)]


def _hints(model: Model, item: Item, span: Span) -> Iterator[Hint]:
    for inner in item.items:
        if inner.begin > span.end:
            return
        if max(inner.end, inner.key_end) < span.start:
            continue
        if inner.kind == "scalar":
            label, is_type = _label(model, inner)
            if label:
                yield Hint(inner.end, label, is_type)
        else:
            yield from _hints(model, inner, span)


def _label(model: Model, item: Item) -> tuple[str, bool]:
    """What to show after a scalar: a param's value, or the type and rate of a wire."""
    path = steps(item)
    scope, rest = scope_at(model, path)
    if item.value.startswith("$"):
        node = params_in(model, scope).get(item.value[1:])
        if node is None:
            return "", False
        shown = flow_yaml(node.plain())
        return f" = {shown if len(shown) <= MAX_SHOWN else shown[: MAX_SHOWN - 3] + '...'}", False
    if rest[0] != "wires" or len(rest) < 3:
        return "", False
    found = target_of(model, scope, item.value)
    if found is None or found.type is None:
        return "", False
    constant = found.entry is not None and found.end.port in found.entry.cls.spec.outputs
    if constant and found.entry is not None:
        constant = found.entry.cls.spec.outputs[found.end.port].constant
    rate = "constant" if constant else found.rate
    return f": {found.type}, {rate}", True


def lenses(model: Model) -> list[Lens]:
    """Commands for the whole graph at its title, and for each block at its name."""
    if model.kind != "graph":
        return []
    first = model.root.get("graph") or next(iter(model.root.items), None)
    if first is None:
        return []
    span = first.key_span
    found = [Lens(span, "Run", "run"), Lens(span, "Show diagram", "diagram")]
    blocks = model.root.get("blocks")
    for item in blocks.items if blocks is not None else ():
        if item.key:
            title = f"Compare with and without '{item.key}'"
            found.append(Lens(item.key_span, title, "compare", item.key))
    return found
