"""Signatures: the ports of the block or part whose wires are being written, or its parameters.

In: a model and an offset. Out: a label, "gain(input: any type)", with the part that is being
written.
"""

from __future__ import annotations

from dataclasses import dataclass

from runtime.language.cursor import cursor_at
from runtime.language.keys import param_doc
from runtime.language.model import Model
from runtime.language.scopes import class_of, inputs_of, scope_at
from runtime.network import Scope


@dataclass(frozen=True)
class Signature:
    """``label`` contains each of ``parameters`` (label, documentation); one may be ``active``."""

    label: str
    doc: str
    parameters: tuple[tuple[str, str], ...]
    active: int | None


def signature(model: Model, offset: int) -> Signature | None:
    """The signature of what is being filled in at an offset."""
    cursor = cursor_at(model.text, model.root, offset)
    if cursor is None:
        return None
    scope, path = scope_at(model, cursor.path)
    if len(path) < 2 or path[0] not in ("wires", "blocks"):
        return None
    name = path[1]
    key = cursor.prefix if cursor.role == "key" else path[2] if len(path) > 2 else ""
    if path[0] == "wires":
        return _of_wires(model, scope, name, key)
    return _of_block(model, scope, name, key)


def _of_wires(model: Model, scope: Scope | None, name: str, key: str) -> Signature | None:
    kinds = inputs_of(model, scope, name)
    if not kinds:
        return None
    cls = class_of(model, scope, name)
    docs = cls.spec.inputs if cls is not None else {}
    parameters = tuple(
        (f"{port}: {kind or 'any type'}", docs[port].doc if port in docs else "")
        for port, kind in kinds.items()
    )
    return _signature_of(name, parameters, list(kinds), key)


def _of_block(model: Model, scope: Scope | None, name: str, key: str) -> Signature | None:
    cls = class_of(model, scope, name)
    if cls is None or not cls.spec.params:
        return None
    parameters = []
    for each, param in cls.spec.params.items():
        detail, doc = param_doc(each, param)
        parameters.append((each, f"{detail}\n\n{doc}"))
    return _signature_of(cls.__name__, tuple(parameters), list(cls.spec.params), key)


def _signature_of(
    name: str, parameters: tuple[tuple[str, str], ...], keys: list[str], key: str
) -> Signature:
    label = f"{name}({', '.join(text for text, _ in parameters)})"
    return Signature(label, "", parameters, keys.index(key) if key in keys else None)
