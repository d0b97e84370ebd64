"""The section ``defaults`` of a graph or part: values for blocks that do not write their own.

In: blocks as they are written, each with its class and its scope. Out: the same with what the
``defaults`` around them add. An entry by key is for all blocks that take it, one by type for
blocks of this type; what stands nearer to a block counts more::

    defaults: {dt: 0.01, Ensemble: {neuron: {type: LIFRate}}}
    blocks: {e: {type: Ensemble}, g: {type: Gain}}
    # e: {type: Ensemble, dt: 0.01, neuron: {type: LIFRate}}, g: {type: Gain, dt: 0.01}
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from blocks.core import Block, misspelt, unknown_parameter
from runtime.document import Node
from runtime.errors import Problems
from runtime.network.scope import Scope

TIMES = ("dt", "offset")
Written = tuple[Scope, Node, type[Block]]


def with_defaults(blocks: Sequence[Written], problems: Problems) -> list[Node]:
    """The blocks' entries with the defaults around them; one that nothing takes is a problem."""
    done = [_fill(*block) for block in blocks]
    scopes = {id(above): above for scope, *_ in blocks for above in _upwards(scope)}
    for scope in scopes.values():
        if scope.defaults:
            inside = [cls for s, _, cls in blocks if any(a is scope for a in _upwards(s))]
            _check(scope, inside, problems)
    return done


def _upwards(scope: Scope | None) -> Iterator[Scope]:
    while scope is not None:
        yield scope
        scope = scope.parent


def _is_type(key: str) -> bool:
    return key[:1].isupper()


def _takes(cls: type[Block], key: str) -> bool:
    """Whether blocks of a class have a parameter, or may have a step of their own."""
    spec = cls.spec
    if key in TIMES and key not in spec.params:
        is_constant = bool(spec.outputs) and all(map(spec.is_constant, spec.evaluations))
        return not spec.continuous and not (is_constant and spec.update is None)
    return key in spec.params or key == "seed"


def _fill(scope: Scope, node: Node, cls: type[Block]) -> Node:
    kind = node.get("type")
    name = cls.__name__ if kind is None else str(kind.value)
    filled = node
    for above in _upwards(scope):
        by_type = above.defaults.get(name)
        named: Mapping[str, Node] = {}
        if by_type is not None and by_type.is_map:
            named = dict(by_type.items())
        by_key = {key: item for key, item in above.defaults.items() if not _is_type(key)}
        # For blocks of all types, an offset is that of ticks; a Sine has one of its own.
        by_key = {k: v for k, v in by_key.items() if k not in TIMES or k not in cls.spec.params}
        for key, item in {**by_key, **named}.items():
            # A step of the block's own has an offset of its own, too.
            is_written = node.get("dt") is not None if key in TIMES else False
            if filled.get(key) is None and _takes(cls, key) and not is_written:
                filled = filled.with_item(key, item)
    return filled


def _check(scope: Scope, inside: Sequence[type[Block]], problems: Problems) -> None:
    """Report defaults that no block in a scope takes, which are typing errors."""
    for key, item in scope.defaults.items():
        address = scope.path("defaults", key)
        if not _is_type(key):
            if not any(_takes(cls, key) for cls in inside):
                known = {*TIMES, "seed", *(name for cls in inside for name in cls.spec.params)}
                text = f"no block here has a parameter '{key}'"
                unknown = misspelt("unknown-name", text, key, sorted(known))
                problems.add(item.key, address, unknown)
            continue
        classes = [cls for cls in inside if cls.__name__ == key]
        if not item.is_map:
            message = f"expected values for parameters, as in {{dt: 0.01}}, got {item.describe()}"
            problems.add(item.where, address, message)
        elif not classes:
            names = sorted({cls.__name__ for cls in inside})
            unknown = misspelt("unknown-type", f"no block here is a {key}", key, names)
            problems.add(item.key, address, unknown)
        else:
            for name, value in item.items():
                if not _takes(classes[0], name):
                    known = {*classes[0].spec.params, *TIMES, "seed"}
                    unknown = unknown_parameter(name, sorted(known))
                    problems.add(value.key, f"{address}.{name}", unknown)
