"""Which values may be written for a key: outputs, types, kinds, names, files.

In: a model and the cursor. Out: offers, ranked: at ``wires: {lqr: {error: |`` the outputs of the
input's type come first (rank 0), then their components, then all others.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

from blocks.core import TYPES, Param, SignalType
from runtime.document import RUN_KEYS, SHIPPED, flow_yaml, names_in, shipped_graphs
from runtime.experiments.design import CHANGES
from runtime.language.cursor import ITEM, Cursor
from runtime.language.keys import type_offers
from runtime.language.model import Model
from runtime.language.offers import Offer, offers_of
from runtime.language.scopes import (
    WireSource,
    class_of,
    fitting,
    known_types,
    outputs_for,
    params_in,
    scope_at,
)
from runtime.language.settings import forms_of, param_at, root_of
from runtime.network import Scope, fits
from runtime.observation import METRIC_KINDS, PLOT_KINDS, MetricKind, PlotKind

SUFFIXES = (".yaml", ".yml")
MAX_FILES = 200


def values_at(model: Model, cursor: Cursor) -> Iterator[Offer]:
    """The values that may be written at a cursor."""
    if model.kind == "experiment":
        yield from _of_experiment(model, cursor.path)
        return
    scope, path = scope_at(model, cursor.path)
    section, *names = path
    names = [name for name in names if name != ITEM]
    if section == "blocks" and len(names) >= 2:
        yield from _of_block(model, scope, names, cursor)
    elif section == "wires" and len(names) >= 2:
        yield from _sources(model, scope, names[0], names[1], cursor.prefix)
    elif section in ("plots", "metrics") and len(names) == 2:
        yield from _of_kind(model, scope, section, names[1], cursor)
    elif section == "probes" and (len(names) == 1 or names[1:] == ["of"]):
        yield from _recordable(model, scope)
    elif section == "outputs" and (len(names) == 1 or names[1:] == ["of"]):
        yield from _addresses(outputs_for(model, scope), None)
    elif section == "inputs" and (len(names) == 1 or names[1] in ("type", "optional")):
        words = ("true", "false") if names[1:] == ["optional"] else ()
        yield from offers_of(words, "value") if words else _signal_types(model)
    elif section in ("without", "bypass"):
        yield from _removable(model, scope, section)
    elif section == "extends":
        yield from _files(model, SUFFIXES, shipped_graphs())
    elif section == "world" and not names:
        yield from _files(model, SUFFIXES, _package_files("worlds"), under="worlds")
    elif section == "run" and names == ["stop", "when"]:
        numbers = TYPES["Scalar"]
        yield from _addresses(outputs_for(model, scope), lambda each: fits(each.type, numbers))
    elif section == "run":
        known = names and names[0] in RUN_KEYS
        yield from offers_of(RUN_KEYS[names[0]].form.choices if known else (), "value")
        yield from _params(model, scope)


def _params(model: Model, scope: Scope | None) -> Iterator[Offer]:
    for name, node in params_in(model, scope).items():
        yield Offer(f"${name}", "param", flow_yaml(node.plain()), rank=2)


def _of_block(
    model: Model, scope: Scope | None, names: list[str], cursor: Cursor
) -> Iterator[Offer]:
    name, key = names[0], names[1]
    if key == "type":
        keys = {item.key for item in cursor.holder.items}
        yield from type_offers(model, keys)
    elif key == "module":
        yield from _files(model, (".py",), ())
    elif key == "graph":
        yield from _files(model, SUFFIXES, _package_files("parts"), under="parts")
    elif key == "params" or scope is None or name in scope.parts:
        yield from _params(model, scope)
    else:
        cls, inner = class_of(model, scope, name), names[1:]
        around = param_at(cls, inner[:-1], cursor.holder.parent) if inner[1:] else None
        root, param = root_of(around), param_at(cls, inner, cursor.holder)
        if root is not None and inner[-1] == root.key:
            for label, member in root.members.items():
                yield Offer(label, "value", member.summary(), rank=0)
        elif param is not None and ITEM not in cursor.path:
            yield from forms_of(param, cursor.holder.flow)
            yield from option_values(model, param)
        yield from _params(model, scope)


def option_values(model: Model, param: Param) -> Iterator[Offer]:
    """The values of a parameter or option that can be listed."""
    default = "" if param.required or param.default is None else _default_text(param)
    if param.choices:
        for value in param.choices:
            yield Offer(value, "value", "default" if value == default else "", rank=0)
    elif param.kind == "bool":
        for value in ("true", "false"):
            yield Offer(value, "value", "default" if value == default else "", rank=0)
    elif param.kind == "signal":
        yield from _signal_types(model)
    elif default:
        yield Offer(default, "value", f"default; {param.describe()}", rank=0)


def _default_text(param: Param) -> str:
    value = param.default
    if isinstance(value, SignalType):
        return str(value)
    try:
        return flow_yaml(value.tolist() if hasattr(value, "tolist") else value)
    except (TypeError, ValueError):
        return ""


def _signal_types(model: Model) -> Iterator[Offer]:
    network = model.network
    own = network.signal_types if network is not None else {}
    for name, kind in {**TYPES, **own}.items():
        if kind.form == "array":
            text = f"{name}(${{1:3}})"
            yield Offer(f"{name}(n)", "type", ", ".join(kind.components), "", text, True, 0)
        else:
            yield Offer(name, "type", ", ".join(kind.components), rank=0)


def _sources(
    model: Model, scope: Scope | None, consumer: str, port: str, prefix: str
) -> Iterator[Offer]:
    """What can be wired to an input, outputs of a fitting type first."""
    outputs = [*outputs_for(model, scope, consumer, prefix), *_own_outputs(model, scope, consumer)]
    yield from _addresses(outputs, fitting(model, scope, consumer, port))


def _own_outputs(model: Model, scope: Scope | None, consumer: str) -> Iterator[WireSource]:
    """A block's own outputs, which an input of it may be wired to as well."""
    cls, network = class_of(model, scope, consumer), model.network
    if cls is not None and scope is not None and network is not None:
        for name in cls.spec.outputs:
            kind = network.types.get((scope.prefix + consumer, name))
            yield WireSource(f"{consumer}.{name}", kind)


def _addresses(
    outputs: Iterable[WireSource], is_fitting: Callable[[WireSource], bool] | None
) -> Iterator[Offer]:
    for output in outputs:
        is_component = output.address.count(".") > 1
        # Others are offered as well, at the end: a type may be wrong at the other end of the wire.
        rank = 1 + is_component
        if is_fitting is not None:
            rank = int(is_component) if is_fitting(output) else 3 + is_component
        yield Offer(output.address, "output", str(output.type or ""), output.doc, rank=rank)


def _recordable(model: Model, scope: Scope | None) -> Iterator[Offer]:
    """Outputs and their components, then states and events."""
    yield from _addresses(outputs_for(model, scope), None)
    network = model.network
    for name, entry in network.entries.items() if network is not None else ():
        for state, declaration in entry.cls.spec.states.items():
            noun = "event" if declaration.event else "state"
            yield Offer(f"{name}.{state}", "output", noun, declaration.doc, rank=3)


def _of_kind(
    model: Model, scope: Scope | None, section: str, key: str, cursor: Cursor
) -> Iterator[Offer]:
    """Values of a plot's or a metric's key."""
    kinds: dict[str, PlotKind | MetricKind] = {}
    kinds |= PLOT_KINDS.usable() if section == "plots" else METRIC_KINDS.usable()
    kind_item = cursor.holder.get("kind") or cursor.holder.parent
    if kind_item is not None and kind_item.key != "kind" and cursor.holder.parent is not None:
        kind_item = cursor.holder.parent.get("kind")
    kind_spec = kinds.get(kind_item.value) if kind_item is not None else None
    if key == "kind":
        yield from (Offer(name, "value", kind.doc) for name, kind in kinds.items())
        return
    param = kind_spec.options.declared.get(key) if kind_spec is not None else None
    if param is not None:
        yield from option_values(model, param)
        yield from _params(model, scope)
    elif key not in ("title", "labels"):
        for item in (model.document.get("probes") or model.tree).items():
            if model.document.get("probes") is not None:
                yield Offer(item[0], "name", "probe", rank=0)
        yield from _recordable(model, scope)


def _removable(model: Model, scope: Scope | None, section: str) -> Iterator[Offer]:
    if scope is None:
        return
    for name in scope.all_names():
        cls = class_of(model, scope, name)
        through = cls.spec.through if cls is not None else None
        if section == "without":
            yield Offer(name, "name", cls.__name__ if cls is not None else "part")
        elif through is not None:
            yield Offer(name, "name", f"{through[0]} goes to {through[1]}")


def _package_files(folder: str) -> list[str]:
    paths = (SHIPPED / folder).glob("*.yaml")
    return sorted(str(path.relative_to(SHIPPED)) for path in paths)


def _files(
    model: Model, suffixes: tuple[str, ...], package_files: Iterable[str], under: str = ""
) -> Iterator[Offer]:
    """Files beside this one and in the folders below, and those that come with the package."""
    names: set[str] = set()
    folder = model.path.parent
    try:
        # Two levels: a search of the whole tree would read a home folder at each key that is typed.
        for path in sorted([*folder.glob("*"), *folder.glob("*/*")])[: 10 * MAX_FILES]:
            if path.suffix in suffixes and path != model.path and not path.name.startswith("."):
                name = path.relative_to(folder).as_posix()
                names.add(name)
                first = not under or Path(name).parts[0] == under
                yield Offer(name, "file", rank=0 if first else 1)
    except OSError:
        pass
    yield from (
        Offer(name, "file", "shipped", rank=2) for name in package_files if name not in names
    )


def _of_experiment(model: Model, path: tuple[str, ...]) -> Iterator[Offer]:
    """Values in an experiment, from the graph that it names."""
    keys = [name for name in path if name != ITEM]
    if not keys:  # an item of a list in place of the sections
        return
    graph = model.baseline
    document = graph.document if graph is not None else None
    if keys[-1] == "graph":
        yield from _files(model, SUFFIXES, shipped_graphs())
    elif keys[-1] in ("minimize", "maximize") and document is not None:
        metrics = document.get("metrics")
        names = [name for name, _ in metrics.items()] if metrics is not None else []
        yield from offers_of(names, "name", "metric")
    elif keys[-1] == "with":
        yield from _files(model, SUFFIXES, _package_files("conditions"))
    elif keys[-1] in CHANGES and keys[-1] in ("without", "bypass") and document is not None:
        yield from offers_of(names_in(document), "name")
    elif len(keys) > 1 and keys[-2] == "replace":
        yield from offers_of(known_types(model), "type")
