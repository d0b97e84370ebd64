"""A JSON Schema of graph files, for editors without a language server.

In: the declarations that the loader checks against. Out: the schema, as ``{"exclusiveMinimum": 0}``
of a parameter with ``above=0.0``. It knows names, types, units and bounds; it cannot know which
blocks a graph has, nor what fits a wire.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from blocks.core import TYPES, Block, GraphInput, Param, Variant
from blocks.library.registry import BUILTIN
from runtime.descriptions import param_row, summary
from runtime.document import PART_SECTIONS, RUN_KEYS, SECTIONS
from runtime.experiments.design import KEYS, PLAN_KEYS
from runtime.language.keys import (
    BLOCK_DOCS,
    COMMON_DOCS,
    WORLD_KEYS,
)
from runtime.language.settings import root_of
from runtime.network import BLOCK_KEYS, GraphOutput
from runtime.observation import METRIC_KINDS, PLOT_KINDS, PROBE_KEYS

Schema = dict[str, Any]
ID = "https://json-schema.org/draft-07/schema#"
REFERENCE: Schema = {"type": "string", "pattern": r"^\$[A-Za-z_]\w*$"}
NAME = "^[A-Za-z_][A-Za-z0-9_]*$"
SOURCE: Schema = {"type": "string", "description": "producer.output"}
SOURCES: Schema = {"anyOf": [SOURCE, {"type": "array", "items": SOURCE}, {"type": "null"}]}
ANY: Schema = {}
PORTS = GraphInput.spec.params


def json_schema() -> Schema:
    """The schema of all files of graphs: whole ones, parts, overlays, experiments and worlds."""
    sections = _sections()
    for key in PART_SECTIONS:
        sections.setdefault(key, {"type": "object"})
    for key, short, params in (
        ("inputs", {"type": "string", "description": f"one of {', '.join(TYPES)}"}, PORTS),
        ("outputs", SOURCE, GraphOutput.declared),
    ):
        whole = _object({name: param_schema(name, each) for name, each in params.items()})
        sections[key] = sections.get(key, {}) | _map({"anyOf": [short, whole]})
    sections["extends"] = SOURCES | {"description": "the graph to start from"}
    for key, text in WORLD_KEYS.items():
        sections[key] = {"type": "array", "description": text}
    for key in KEYS:
        if key not in PLAN_KEYS:
            sections.setdefault(key, ANY)
    for key in ("part", "repeat", "share", "seed"):
        sections.pop(key, None)
    return {
        "$schema": ID,
        "title": "spikeblocks graph",
        "type": "object",
        "properties": sections,
        "additionalProperties": False,
        "definitions": {"block": _block(), "wires": _wires()} | _families(),
    }


def _sections() -> dict[str, Schema]:
    """The sections of a graph."""
    schemas: dict[str, Schema] = {
        "graph": {"type": ["string", "number"]},
        "run": _run(),
        "params": {"type": "object"},
        "world": {"anyOf": [{"type": "string"}, {"type": "object"}, {"type": "null"}]},
        "blocks": _map({"$ref": "#/definitions/block"}),
        "wires": {"$ref": "#/definitions/wires"},
        "probes": _map(_probe()),
        "plots": _map(_kinds(PLOT_KINDS)),
        "metrics": _map(_kinds(METRIC_KINDS)),
        "without": SOURCES,
        "bypass": SOURCES,
    }
    docs = {key: {"description": text} for key, text in SECTIONS.items()}
    return {key: schemas.get(key, ANY) | docs.get(key, {}) for key in {**docs, **schemas}}


def _map(value: Schema) -> Schema:
    """A mapping of any names; null deletes what ``extends`` adds."""
    null = {"type": "null"}
    return {"type": ["object", "null"], "additionalProperties": {"anyOf": [value, null]}}


def _object(properties: Mapping[str, Schema]) -> Schema:
    return {"type": "object", "properties": dict(properties), "additionalProperties": False}


def _run() -> Schema:
    return _object(
        {
            key: {"anyOf": [dict(declared.form.schema), REFERENCE, {"type": "null"}]}
            | {"description": declared.doc}
            for key, declared in RUN_KEYS.items()
        }
    )


def _probe() -> Schema:
    ticks: Schema = {"anyOf": [{"type": "integer", "minimum": 0}, REFERENCE]}
    sampled = _object({"period": ticks, "offset": ticks, "mean": {"type": "boolean"}})
    every: Schema = {"anyOf": [{"type": "integer", "minimum": 1}, REFERENCE, sampled]}
    properties = {key: {"description": text} for key, text in PROBE_KEYS.items()}
    properties["of"] = SOURCES | properties["of"]
    properties["every"] = every | properties["every"]
    return {"anyOf": [SOURCE, {"type": "array", "items": SOURCE}, _object(properties)]}


def _wires() -> Schema:
    inputs = {"type": ["object", "null"], "additionalProperties": SOURCES}
    return {"type": ["object", "null"], "additionalProperties": inputs}


def _block() -> Schema:
    """An entry of ``blocks``: of a type of the library, of one's own, or a part."""
    types: list[Schema] = [
        {"const": name, "description": summary(cls)} for name, cls in BUILTIN.items()
    ]
    properties: dict[str, Schema] = {key: {"description": text} for key, text in BLOCK_DOCS.items()}
    own: Schema = {"type": "string", "description": "a type of your own or of a package"}
    properties["type"] = properties["type"] | {"anyOf": [*types, own]}
    properties["repeat"] |= {"anyOf": [{"type": "integer", "minimum": 1}, REFERENCE]}
    properties["share"] |= SOURCES
    return {
        "type": "object",
        "properties": properties,
        "allOf": [_type_branch(name, cls) for name, cls in BUILTIN.items()],
    }


def _type_branch(name: str, cls: type[Block]) -> Schema:
    """The parameters of a block, if it is of a type of the library."""
    inside = dict.fromkeys(BLOCK_KEYS, ANY)
    inside |= {key: param_schema(key, param) for key, param in cls.spec.params.items()}
    return _branch("type", name, _object(inside) | {"description": summary(cls)})


def _branch(key: str, name: str, then: Schema) -> Schema:
    """What holds of a mapping whose ``key`` names one of ours, and no file of a class."""
    condition: Schema = {
        "properties": {key: {"const": name}},
        "required": [key],
        "not": {"required": ["module"]},
    }
    return {"if": condition, "then": then}


def _families() -> dict[str, Schema]:
    """The families of settings that parameters take, also those of their members' parameters."""
    found: dict[str, Schema] = {}
    waiting = [param for cls in BUILTIN.values() for param in cls.spec.params.values()]
    while waiting:
        root = root_of(waiting.pop())
        if root is not None and root.__name__ not in found:
            found[root.__name__] = _family(root)
            waiting += [each for m in root.members.values() for each in m.declared.values()]
    return dict(sorted(found.items()))


def _family(root: type[Variant]) -> Schema:
    """A mapping whose first key names one of several classes: the parameters of that class."""
    ours: Schema = {"enum": list(root.members)}
    other: Schema = {"type": "string", "description": "one of your own, or of a package"}
    branches, every = [], {root.key}
    for name, member in root.members.items():
        inside = {key: param_schema(key, param) for key, param in member.declared.items()}
        branches.append(_branch(root.key, name, _object({root.key: ANY} | inside)))
        every |= inside.keys()
    # An entry that ``extends`` changes need not repeat the name.
    unnamed = {
        "if": {"not": {"required": [root.key]}},
        "then": _object(dict.fromkeys(sorted(every), ANY)),
    }
    return {
        "type": "object",
        "properties": {root.key: {"anyOf": [ours, other]} if root.members.name else ours},
        "allOf": [*branches, unnamed],
    }


def _kinds(kinds: Mapping[str, Any]) -> Schema:
    """A plot or a metric: the keys of its kind."""
    common = {key: {"description": text} for key, text in COMMON_DOCS.items()}
    names: list[Schema] = [{"const": name, "description": kind.doc} for name, kind in kinds.items()]
    branches = []
    for name, kind in kinds.items():
        options = kind.options.declared
        inside = {
            key: param_schema(key, options[key]) if key in options else common.get(key, ANY)
            for key in ("kind", *kind.keys, "module")
        }
        branches.append(_branch("kind", name, _object(inside)))
    ours: Schema = {"properties": {"kind": {"anyOf": names}}}
    own: Schema = {"required": ["module"]}
    return {
        "type": "object",
        "properties": common,
        "anyOf": [ours, own],
        "allOf": branches,
    }


def param_schema(name: str, param: Param) -> Schema:
    """The schema of a parameter's value, or of a ``$name`` in its place."""
    _, expected, default, doc = param_row(name, param)
    forms = [*_forms(param), REFERENCE]
    if param.default is None:
        forms.append({"type": "null"})
    default_text = (
        f", default {default}" if default not in ("", "required") else f" {default}".rstrip()
    )
    return {"description": f"{doc}: {expected}{default_text}", "anyOf": forms}


def _forms(param: Param) -> Iterable[Schema]:
    """The forms that a value may have, without their units."""
    words: list[Schema] = [{"enum": list(param.choices)}] if param.choices else []
    if words and param.kind != "array":
        return words
    number = {"type": "integer" if param.kind == "int" else "number"} | _bounds(param)
    degrees: list[Schema] = []
    if any(unit.startswith("rad") for unit in param.units):
        degrees = [{"type": "string", "pattern": "deg"}]
    simple: dict[str, list[Schema]] = {
        "bool": [{"type": "boolean"}],
        "str": [{"type": "string"}],
        "signal": [{"type": "string"}, {"type": "object"}],
        "float": [number, *degrees],
        "int": [number],
    }
    if param.kind in simple:
        return simple[param.kind]
    if param.kind != "array":
        return _setting_forms(param)
    alone = [number, *degrees] if not param.shapes or () in param.shapes else []
    computed = {"type": "string", "pattern": r"[(\[]"}
    return [*words, *alone, {"type": "array"}, computed]


def _setting_forms(param: Param) -> list[Schema]:
    """A name or a number, or a mapping of the family; several of them for rules of learning."""
    root = root_of(param)
    if root is None:
        return [ANY]
    family = {"$ref": f"#/definitions/{root.__name__}"}
    one: list[Schema] = [{"type": ["string", "number"]}, family]
    if getattr(root, "together", None) is None:
        return one
    return [*one, {"type": "array", "items": {"anyOf": one}}]


def _bounds(param: Param) -> Schema:
    names = {"above": "exclusiveMinimum", "at_least": "minimum"}
    names |= {"below": "exclusiveMaximum", "at_most": "maximum"}
    bounds = {names[key]: getattr(param, key) for key in names}
    return {
        key: value for key, value in bounds.items() if value is not None and math.isfinite(value)
    }
