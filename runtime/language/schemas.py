"""A JSON Schema of graph files, for editors without a language server.

In: the declarations that the loader checks against. Out: the schema, as ``{"exclusiveMinimum": 0}``
of a parameter with ``above=0.0``. It knows names, types, units and bounds; it cannot know which
blocks a graph has, nor what fits a wire.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from blocks.core import TYPES, Block, GraphInput, Param
from blocks.registry import BUILTIN
from runtime.descriptions import param_row, summary
from runtime.document import PART_SECTIONS, RUN_KEYS, SECTIONS
from runtime.experiments.design import KEYS, PLAN_KEYS
from runtime.language.keys import (
    BLOCK_DOCS,
    COMMON_DOCS,
    WORLD_KEYS,
)
from runtime.language.settings import members_of, root_of
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
        "definitions": {"block": _block(), "wires": _wires()},
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
    condition = {
        "properties": {"type": {"const": name}},
        "required": ["type"],
        "not": {"required": ["module"]},
    }
    inside = dict.fromkeys(BLOCK_KEYS, ANY)
    inside |= {key: param_schema(key, param) for key, param in cls.spec.params.items()}
    then = _object(inside) | {"description": summary(cls)}
    return {"if": condition, "then": then}


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
        condition = {
            "properties": {"kind": {"const": name}},
            "required": ["kind"],
            "not": {"required": ["module"]},
        }
        branches.append({"if": condition, "then": _object(inside)})
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
    """A string, a number or a list, and a mapping whose first key names one of several classes."""
    members = members_of(param)
    root = root_of(param)
    if root is None:
        return [ANY]
    keys = {name for member in members.values() for name in member.declared}
    ours: Schema = {"enum": list(members)}
    inside = dict.fromkeys(sorted(keys), ANY) | {root.key: ours}
    forms = [{"type": ["string", "number"]}, _object(inside)]
    if getattr(root, "together", None) is not None:  # several rules of learning
        forms.append({"type": "array"})
    if root.members.name:  # one of a file, or of a package: its parameters are unknown
        forms.append({"type": "object", "required": ["module"]})
        other = {root.key: {"not": ours}}
        forms.append({"type": "object", "properties": other, "required": [root.key]})
    return forms


def _bounds(param: Param) -> Schema:
    names = {"above": "exclusiveMinimum", "at_least": "minimum"}
    names |= {"below": "exclusiveMaximum", "at_most": "maximum"}
    bounds = {names[key]: getattr(param, key) for key in names}
    return {
        key: value for key, value in bounds.items() if value is not None and math.isfinite(value)
    }
