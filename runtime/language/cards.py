"""Hover cards: what a name in the file stands for, as Markdown.

In: a model and an offset. Out: a :class:`Card` or None. On "lqr.command" in a wire::

    **lqr.command**: Twist, 100 Hz, m/s, rad/s
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from blocks.core import Param
from runtime.descriptions import describe_markdown
from runtime.document import RUN_KEYS, SECTIONS, flow_yaml
from runtime.language.addresses import AddressTarget, line_at, target_of
from runtime.language.cursor import ITEM, steps
from runtime.language.items import YamlItem, deepest
from runtime.language.keys import BLOCK_DOCS, COMMON_DOCS, OUTPUT_KEYS, PORT_KEYS, param_doc
from runtime.language.model import Model
from runtime.language.scopes import class_of, inputs_of, known_types, params_in, scope_at
from runtime.language.settings import param_at
from runtime.language.text import Span
from runtime.network import Scope
from runtime.observation import METRIC_KINDS, PLOT_KINDS, PROBE_KEYS


@dataclass(frozen=True)
class Card:
    """What there is to know about a part of the file, as Markdown."""

    span: Span
    markdown: str


def hover(model: Model, offset: int) -> Card | None:
    """The card of the key or value at an offset; None where there is nothing to say."""
    item = deepest(model.root, offset)
    if item.parent is None:
        return None
    on_key = item.key_start <= offset <= item.key_end and item.key_start >= 0
    on_value = item.kind == "scalar" and item.start <= offset <= item.end
    if not on_key and not on_value:
        return None
    scope, path = scope_at(model, steps(item))
    if on_key:
        text = _of_key(model, scope, path, item)
        return Card(item.key_span, text) if text else None
    text = _of_value(model, scope, path, item)
    return Card(item.span, text) if text else None


def _of_key(model: Model, scope: Scope | None, path: tuple[str, ...], item: YamlItem) -> str:
    if model.kind in ("experiment", "world"):
        return ""
    section, *names = path
    if not names:
        return f"**{section}**: {SECTIONS[section]}" if section in SECTIONS else ""
    if section in ("blocks", "wires") and len(names) == 1:
        return block_card(model, scope, names[0])
    if section == "blocks":
        return _parameter(model, scope, names, item)
    if section == "wires" and len(names) == 2:
        return _input(model, scope, *names)
    if section == "params":
        return _param(model, scope, names[0])
    if section == "run":
        doc = RUN_KEYS[names[0]].doc if names[0] in RUN_KEYS else "of the run"
        return f"**{names[0]}**: {doc}"
    if section in ("plots", "metrics") and len(names) == 2:
        return _option(section, names[1], item)
    tables = {"probes": PROBE_KEYS, "inputs": PORT_KEYS, "outputs": OUTPUT_KEYS}
    docs = tables.get(section, {})
    return f"**{names[-1]}**: {docs[names[-1]]}" if names[-1] in docs else ""


def block_card(model: Model, scope: Scope | None, name: str) -> str:
    """A block's card: box, equation, ports, parameters; or a part's signature."""
    if scope is not None and name in scope.parts:
        return part_card(model, scope, name)
    cls = class_of(model, scope, name)
    return describe_markdown(cls) if cls is not None else ""


def part_card(model: Model, scope: Scope, name: str) -> str:
    """A part's inputs, outputs and params."""
    part = scope.parts[name]
    lines = [f"## {name}", "", "A part.", ""]
    kinds = inputs_of(model, scope, name)
    rows = [(port, str(kinds.get(port) or ""), _doc_of(part, port)) for port in part.inputs]
    outputs = [(port, _output_type(model, part, port), "") for port in part.outputs]
    params = [(n, flow_yaml(v.plain()), "") for n, v in params_in(model, part).items()]
    for title, table in (("inputs", rows), ("outputs", outputs), ("params", params)):
        if table:
            lines += [f"| {title} | | |", "|---|---|---|"]
            lines += [f"| `{a}` | {b} | {c} |" for a, b, c in table]
            lines.append("")
    return "\n".join(lines).rstrip()


def _doc_of(part: Scope, port: str) -> str:
    doc = part.inputs[port].get("doc")
    return str(doc.value) if doc is not None else ""


def _output_type(model: Model, part: Scope, port: str) -> str:
    target = target_of(model, part.parent, f"{part.name}.{port}")
    return str(target.type or "") if target is not None else ""


def _parameter(model: Model, scope: Scope | None, names: list[str], item: YamlItem) -> str:
    name, key = names[0], names[1]
    cls = class_of(model, scope, name)
    param = param_at(cls, names[1:], item.parent)
    if param is not None:
        return _param_markdown(names[-1], param)
    if names[1:2] == ["params"] and len(names) == 3 and scope is not None:
        part = scope.parts.get(name)
        return _param(model, part, names[2]) if part is not None else ""
    return f"**{key}**: {BLOCK_DOCS[key]}" if key in BLOCK_DOCS and len(names) == 2 else ""


def _param_markdown(name: str, param: Param) -> str:
    detail, _ = param_doc(name, param)
    return f"**{name}**: {param.doc}\n\n{detail}"


def _param(model: Model, scope: Scope | None, name: str) -> str:
    node = params_in(model, scope).get(name)
    return "" if node is None else f"**${name}** = `{flow_yaml(node.plain())}`"


def _input(model: Model, scope: Scope | None, consumer: str, port: str) -> str:
    kinds = inputs_of(model, scope, consumer)
    if port not in kinds:
        return ""
    cls = class_of(model, scope, consumer)
    declaration = cls.spec.inputs.get(port) if cls is not None else None
    lines = [f"**{consumer}.{port}**: {kinds[port] or 'any type'}"]
    if declaration is not None:
        lines.append("; ".join(filter(None, (declaration.doc, declaration.unit))))
        if declaration.variadic:
            lines.append("takes any number of wires")
        elif declaration.default is not None:
            lines.append(f"optional; {declaration.default:g} where nothing is wired")
    return "\n\n".join(filter(None, lines))


def _option(section: str, key: str, item: YamlItem) -> str:
    kind_item = item.parent.get("kind") if item.parent is not None else None
    kinds = PLOT_KINDS if section == "plots" else METRIC_KINDS
    kind = kinds.get(kind_item.value) if kind_item is not None else None
    param = kind.options.declared.get(key) if kind is not None else None
    if param is not None:
        return _param_markdown(key, param)
    return f"**{key}**: {COMMON_DOCS.get(key, 'a probe or an address')}"


def _of_value(model: Model, scope: Scope | None, path: tuple[str, ...], item: YamlItem) -> str:
    value = item.value
    if value.startswith("$"):
        return _param(model, scope, value[1:])
    names = [name for name in path if name != ITEM]
    if not names:  # an item of a list in place of a graph's sections
        return ""
    section, last = names[0], names[-1]
    if last == "type" and section == "blocks" and len(names) == 3:
        cls = class_of(model, scope, names[1]) or known_types(model).get(value)
        return describe_markdown(cls) if cls is not None and cls.__name__ == value else ""
    if last == "kind" and section in ("plots", "metrics"):
        kinds = PLOT_KINDS if section == "plots" else METRIC_KINDS
        return f"**{value}**: {kinds[value].doc}" if value in kinds else ""
    if last in ("graph", "extends", "world", "module") and len(names) in (1, 3):
        return _file(model, value)
    if section in ("without", "bypass"):
        return block_card(model, scope, value)
    probe = model.document.get("probes")
    if section in ("plots", "metrics") and probe is not None and probe.get(value) is not None:
        return f"**{value}**: a probe of {flow_yaml((probe.get(value) or probe).plain())}"
    if section in ("wires", "probes", "plots", "metrics", "outputs"):
        target = target_of(model, scope, value)
        return address_card(model, target, value) if target is not None else ""
    return ""


def address_card(model: Model, target: AddressTarget, address: str) -> str:
    """A signal: its type, rate, documentation, and the line of its block."""
    entry, end = target.entry, target.end
    if entry is None:
        return ""
    port = entry.cls.spec.outputs.get(end.port)
    state = entry.cls.spec.states.get(end.port)
    declaration = port or state
    facts = [str(target.type) if target.type is not None else "", target.rate]
    if port is not None and port.constant:
        facts[1] = "constant"
    unit = _unit(target, declaration.unit if declaration is not None else "")
    lines = [f"**{address}**: {', '.join(filter(None, [*facts, unit]))}"]
    if declaration is not None and declaration.doc:
        lines.append(declaration.doc)
    if state is not None:
        lines.append("an event of the tick" if state.event else "a state, for probes")
    line = line_at(model, target.where)
    if line:
        place = f"{Path(target.where.file).name}:{target.where.line}"
        lines.append(f"{place}\n\n```yaml\n{line}\n```")
    return "\n\n".join(lines)


def _unit(target: AddressTarget, unit: str) -> str:
    kind = target.type
    if unit or kind is None:
        return unit
    return ", ".join(f"{c} {u}" for c, u in zip(kind.components, kind.units, strict=False))


def _file(model: Model, name: str) -> str:
    path = model.file_of(name)
    return f"`{path}`" if path is not None else ""
