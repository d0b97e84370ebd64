"""What editors show between the lines: types and rates at wires, values of params, and commands.

In: a model and a part of the file. Out: hints as in ``error: sum.out : Scalar, 100 Hz`` or
``gain: $k = 2.0``, and commands above the title and the blocks.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from runtime.document import flow_yaml
from runtime.language.addresses import target_of
from runtime.language.cursor import steps
from runtime.language.items import YamlItem
from runtime.language.model import Model
from runtime.language.scopes import params_in, scope_at
from runtime.language.text import Span

MAX_SHOWN = 30


@dataclass(frozen=True)
class Hint:
    """A label shown after an offset; ``is_type`` for types of wires."""

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
    """The hints in a part of the file."""
    if model.kind in ("experiment", "world"):
        return []
    return [*_hints(model, model.root, span)]


def _hints(model: Model, item: YamlItem, span: Span) -> Iterator[Hint]:
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


def _label(model: Model, item: YamlItem) -> tuple[str, bool]:
    """What to show after a scalar: a param's value, or the type and rate of a wire."""
    path = steps(item)
    scope, rest = scope_at(model, path)
    if item.value.startswith("$"):
        node = params_in(model, scope).get(item.value[1:])
        if node is None:
            return "", False
        value = flow_yaml(node.plain())
        return f" = {value if len(value) <= MAX_SHOWN else value[: MAX_SHOWN - 3] + '...'}", False
    if rest[0] != "wires" or len(rest) < 3:
        return "", False
    target = target_of(model, scope, item.value)
    if target is None or target.type is None:
        return "", False
    constant = target.entry is not None and target.end.port in target.entry.cls.spec.outputs
    if constant and target.entry is not None:
        constant = target.entry.cls.spec.outputs[target.end.port].constant
    rate = "constant" if constant else target.rate
    return f": {target.type}, {rate}", True


def lenses(model: Model) -> list[Lens]:
    """Commands for the whole graph at its title, and for each block at its name."""
    if model.kind != "graph":
        return []
    # An unclosed "[" at the top makes items without keys of what follows.
    first = model.root.get("graph") or next((item for item in model.root.items if item.key), None)
    if first is None:
        return []
    span = first.key_span
    commands = [Lens(span, "Run", "run"), Lens(span, "Show diagram", "diagram")]
    blocks = model.root.get("blocks")
    for item in blocks.items if blocks is not None else ():
        if item.key:
            title = f"Compare with and without '{item.key}'"
            commands.append(Lens(item.key_span, title, "compare", item.key))
    return commands
