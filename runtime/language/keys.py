"""Which keys may be written in a mapping, from the declarations that the loader checks against.

In: a model and the cursor. Out: offers. At ``blocks: {u: {type: Gain, |}}`` these are Gain's
parameters, required ones first, then "dt" and "module".
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence

from blocks.core import Block, GraphInput, Param
from blocks.library.registry import is_built_in
from runtime.descriptions import describe_markdown, param_row, summary
from runtime.document import (
    EXAMPLES,
    PART_SECTIONS,
    RUN_KEYS,
    SECTIONS,
    STOP_DOCS,
)
from runtime.experiments.design import CHANGES, KEYS, PLAN_KEYS, VARIANT_KEYS
from runtime.language.cursor import ITEM, Cursor
from runtime.language.model import Model
from runtime.language.offers import Offer, choice, offers_of
from runtime.language.scopes import (
    class_of,
    fitting,
    inputs_of,
    is_optional,
    known_types,
    outputs_for,
    params_in,
    scope_at,
)
from runtime.language.settings import param_at, root_of, variant_at
from runtime.network import BLOCK_KEYS, GraphOutput, Scope
from runtime.observation import METRIC_KINDS, PLOT_KINDS, PROBE_KEYS, plot_keys

WORLD_KEYS = {
    "room": "corners of the outer wall, m",
    "obstacles": "solid polygons, m",
    "circles": "solid circles, x, y, r, m",
}
BLOCK_DOCS = {
    "type": "the block's type",
    "dt": "the block's own step, s: a whole multiple of run.dt",
    "offset": "the time of its first tick, s: a whole multiple of run.dt, below its dt",
    "seed": "its own seed: what it draws does not depend on the run's",
    "module": "a Python file that defines the type",
    "graph": "the file of a part",
    "params": "values for the part's params",
    "repeat": "how many copies of the part there are; vectors are divided among them",
    "share": "inputs of a repeated part of which every copy gets the whole",
}
PORT_KEYS = {
    "type": "its signal type",
    **{name: each.doc for name, each in GraphInput.spec.params.items() if name != "type"},
}
OUTPUT_KEYS = {name: each.doc for name, each in GraphOutput.declared.items()}
COMMON_DOCS = {
    "kind": "what it shows or measures",
    "of": "a probe or an address, or several",
    "title": "the title of the figure",
    "labels": "names of the lines, in their order",
    "module": "a Python file that defines the kind",
}


def keys_at(model: Model, cursor: Cursor) -> Iterator[Offer]:
    """The keys that may be written at a cursor."""
    if model.kind == "experiment":
        yield from _of_experiment(model, cursor.path)
        return
    if model.kind == "world" or cursor.path[:1] == ("world",):
        if len(cursor.path) == (model.kind != "world"):
            yield from _key_offers(WORLD_KEYS)
        return
    scope, path = scope_at(model, cursor.path)
    if not path:
        yield from _sections(model, bool(cursor.path))
        return
    section, *names = path
    if section == "blocks":
        yield from _of_blocks(model, scope, names, cursor)
    elif section == "wires":
        yield from _of_wires(model, scope, names, cursor)
    elif section in ("plots", "metrics") and len(names) == 1:
        yield from _of_kind(section, _scalar_of(cursor, "kind"))
    elif section == "run" and not names:
        yield from _key_offers({key: declared.doc for key, declared in RUN_KEYS.items()})
    elif section == "run" and names == ["stop"]:
        yield from _key_offers(STOP_DOCS)
    elif section == "probes" and len(names) == 1:
        yield from _key_offers(PROBE_KEYS)
    elif section in ("inputs", "outputs") and len(names) == 1:
        yield from _key_offers(PORT_KEYS if section == "inputs" else OUTPUT_KEYS)
    elif section == "defaults":
        yield from _of_defaults(model, names)
    elif section == "params" and not names:
        yield from offers_of(params_in(model, scope), "param")


def _key_offers(keys: Mapping[str, str], names: Iterable[str] = ()) -> Iterator[Offer]:
    return (Offer(key, "key", keys.get(key, "")) for key in names or keys)


def _scalar_of(cursor: Cursor, key: str) -> str:
    item = cursor.holder.get(key)
    return item.value if item is not None else ""


def _sections(model: Model, is_inside: bool) -> Iterator[Offer]:
    """The sections of a graph, or of a part."""
    is_part_file = model.kind == "part" or is_inside
    names = [n for n in PART_SECTIONS if n != "part"] if is_part_file else [*SECTIONS, "extends"]
    docs = {**SECTIONS, "extends": "the graph to start from"}
    for rank, name in enumerate(names):
        example = f"`{EXAMPLES[name]}`" if name in EXAMPLES else ""
        yield Offer(name, "section", docs.get(name, ""), example, rank=rank)


def param_doc(name: str, param: Param) -> tuple[str, str]:
    """A parameter in one line, and what there is to know about it as Markdown."""
    _, expected, default, doc = param_row(name, param)
    if default not in ("", "required"):
        default = f"default {default}"
    doc = f"{doc}\n\n{expected}; {default}".rstrip("; \n")
    return ", ".join(filter(None, (expected, default))), doc


def param_offers(params: Mapping[str, Param]) -> Iterator[Offer]:
    """Parameters as keys, required ones first."""
    for name, each in params.items():
        detail, doc = param_doc(name, each)
        yield Offer(name, "key", detail, doc, rank=0 if each.required else 1)


def _of_blocks(
    model: Model, scope: Scope | None, names: list[str], cursor: Cursor
) -> Iterator[Offer]:
    if not names:
        yield from _new_blocks(model, scope)
    elif len(names) == 1:
        cls = class_of(model, scope, names[0])
        if cls is not None:
            yield from param_offers(cls.spec.params)
        keys = [*BLOCK_KEYS, "graph"]
        if scope is not None and names[0] in scope.parts:
            keys = [n for n in PART_SECTIONS if n != "part"]
        docs = {**SECTIONS, **BLOCK_DOCS}
        yield from (Offer(key, "key", docs.get(key, ""), rank=2) for key in keys)
    elif names[1] == "params" and len(names) == 2 and scope is not None:
        part = scope.parts.get(names[0])
        yield from offers_of(params_in(model, part) if part else (), "param")
    else:
        yield from _of_setting(class_of(model, scope, names[0]), names[1:], cursor)


def _of_defaults(model: Model, names: list[str]) -> Iterator[Offer]:
    """Block types and parameters of the graph, or the parameters of a type."""
    entries = model.network.entries.values() if model.network is not None else ()
    classes = {entry.cls.__name__: entry.cls for entry in entries}
    if len(names) == 1 and names[0] in classes:
        yield from param_offers(classes[names[0]].spec.params)
    elif not names:
        yield from _key_offers(dict.fromkeys(sorted(classes), "for blocks of this type"))
    if len(names) <= 1:
        yield from _key_offers(BLOCK_DOCS, ("dt", "offset"))


def _of_setting(cls: type[Block] | None, keys: Sequence[str], cursor: Cursor) -> Iterator[Offer]:
    """The keys of a setting: the one that names its class, and the parameters of that."""
    param = param_at(cls, keys, cursor.holder.parent)
    root = root_of(param)
    if root is None:
        return
    yield Offer(root.key, "key", root.expected, rank=0)
    inside = variant_at(param, cursor.holder)
    if inside is not None:
        yield from param_offers(inside.declared)


def _new_blocks(model: Model, scope: Scope | None) -> Iterator[Offer]:
    """Names that wires mention already, those of the graph below, and a new block of each type."""
    wires = scope.wires if scope is not None else {}
    blocks = scope.names() if scope is not None else []
    # Wires are often written first; each name in them that is no block yet is probably the next
    # block.
    missing = {name for name in wires if name not in blocks}
    for ports in wires.values():
        for node in (ports.value if ports.is_map else {}).values():
            for item in node.value if node.is_list else [node]:
                head = str(item.value).partition(".")[0]
                missing |= {head} - {*blocks, "inputs", "None"}
    yield from offers_of(sorted(missing), "name", "named in wires", rank=0)
    yield from offers_of(blocks, "name", "of the graph that this one extends", rank=1)
    for kind, cls in known_types(model).items():
        entry = block_snippet(kind, cls, 2)
        text = f"${{1:{kind.lower()}}}: {{{entry}}}"
        yield Offer(f"{kind} block", "snippet", summary(cls), "", text, True, 2)


def block_snippet(kind: str, cls: type[Block], first: int) -> str:
    """The inside of a block's entry with its required parameters to be filled in."""
    parts = [f"type: {kind}"]
    for number, (name, param) in enumerate(_required_params(cls), first):
        hint = choice(number, param.choices, param.describe())
        parts.append(f"{name}: {hint}")
    return ", ".join(parts)


def _required_params(cls: type[Block]) -> list[tuple[str, Param]]:
    return [(name, each) for name, each in cls.spec.params.items() if each.required]


def type_offers(model: Model, keys: set[str]) -> Iterator[Offer]:
    """Block types; with their required parameters, where none is ``written`` yet."""
    for kind, cls in known_types(model).items():
        family = cls.__module__.split(".")[1] if is_built_in(cls) else "own"
        required = [name for name, _ in _required_params(cls)]
        doc = describe_markdown(cls)
        yield Offer(kind, "type", f"{family}: {summary(cls)}", doc)
        # Where parameters are written already, a snippet would write them twice.
        if required and not keys & {*cls.spec.params}:
            text = block_snippet(kind, cls, 1).removeprefix("type: ")
            label = f"{kind} with {', '.join(required)}"
            yield Offer(label, "snippet", "with its required parameters", doc, text, True, 3)


def _of_wires(
    model: Model, scope: Scope | None, names: list[str], cursor: Cursor
) -> Iterator[Offer]:
    if scope is None:
        return
    if not names:
        for name in scope.names():
            ports = inputs_of(model, scope, name)
            if ports:
                yield Offer(name, "name", f"inputs: {', '.join(ports)}", rank=0)
                text = f"{name}: {{{wires_snippet(model, scope, name, list(ports))}}}"
                yield Offer(f"{name} {{...}}", "snippet", "all its inputs", "", text, True, 1)
        return
    if len(names) != 1:
        return
    other_keys = {item.key for item in cursor.holder.items if item is not cursor.item}
    ports = inputs_of(model, scope, names[0])
    cls = class_of(model, scope, names[0])
    for port, kind in ports.items():
        declaration = cls.spec.inputs.get(port) if cls is not None else None
        optional = is_optional(model, scope, names[0], port)
        detail = f"{kind or 'any type'}{', optional' if optional else ''}"
        yield Offer(port, "key", detail, declaration.doc if declaration else "", rank=int(optional))
    open_ports = [port for port in ports if port not in other_keys]
    required = [p for p in open_ports if not is_optional(model, scope, names[0], p)]
    if len(required or open_ports) > 1 and cursor.holder.flow:
        text = wires_snippet(model, scope, names[0], required or open_ports)
        label = ", ".join(required or open_ports)
        yield Offer(label, "snippet", "all open inputs", "", text, True, 2)


def wires_snippet(model: Model, scope: Scope | None, name: str, ports: list[str]) -> str:
    """Inputs of a block, each with its fitting outputs to choose from."""
    parts = []
    for number, port in enumerate(ports, 1):
        outputs = outputs_for(model, scope, name, components=False)
        addresses = [each.address for each in filter(fitting(model, scope, name, port), outputs)]
        # A longer list of choices cannot be read in an editor's menu.
        source = choice(number, addresses[:20], "block.output")
        cls = class_of(model, scope, name)
        variadic = cls is not None and port in cls.spec.inputs and cls.spec.inputs[port].variadic
        parts.append(f"{port}: [{source}]" if variadic else f"{port}: {source}")
    return ", ".join(parts)


def _of_kind(section: str, kind: str) -> Iterator[Offer]:
    """The keys of a plot or a metric; those of its kind, if it has one."""
    if section == "plots":
        plot = PLOT_KINDS.get(kind)
        options = dict(plot.options.declared) if plot else {}
        keys: tuple[str, ...] = plot.keys if plot else plot_keys(kind)
    else:
        metric = METRIC_KINDS.get(kind)
        options = dict(metric.options.declared) if metric else {}
        every = METRIC_KINDS.values() if metric is None else [metric]
        keys = ("kind", *dict.fromkeys(key for each in every for key in each.keys), "module")
    for rank, key in enumerate(keys):
        if key in options:
            detail, doc = param_doc(key, options[key])
            yield Offer(key, "key", detail, doc, rank=rank)
        else:
            yield Offer(key, "key", COMMON_DOCS.get(key, "a probe or an address"), rank=rank)


def _of_experiment(model: Model, path: tuple[str, ...]) -> Iterator[Offer]:
    docs = {"experiment": "its name", "graph": "the baseline", "seeds": "as in 0..19"}
    docs |= {"variants": "name: changes", "vary": "path: values, as in 0..1:5"}
    if not path:
        yield from _key_offers(docs, (key for key in KEYS if key not in PLAN_KEYS))
    elif path[0] == "variants" and len(path) == 2:
        yield from _key_offers(docs, VARIANT_KEYS)
    elif path[-1] in CHANGES and ITEM not in path:
        graph = model.baseline
        names = graph.names if graph is not None else []
        yield from offers_of(names, "name")
