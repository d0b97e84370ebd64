"""Reads a block class: collects its declarations and checks that they are consistent."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Container, Iterator, Mapping
from dataclasses import replace
from typing import Any

from blocks.core.declarations import BlockSpec, Evaluation, Input, Output, State
from blocks.core.hints import hint
from blocks.core.params import KINDS, DeclarationError, Param, ParamKind, param
from blocks.core.settings import Setting
from blocks.core.signals import Same, Scalar, SignalType

RESERVED_PARAMETERS = ("type", "module", "dt")
STATED = "_signal"
# The first arguments of a method, which an input of that name could not be told from.
RESERVED_INPUTS = ("self", "state", "t")
RESERVED_STATES = ("context", "dt", "seed", "is_seed_read", "rng", "published", "_declared")


def read_declarations(cls: type, own_sizes: bool = False, own_variables: bool = False) -> BlockSpec:
    """Collect ports, states and parameters of a class, inherited ones first.

    With ``own_sizes`` the class provides lengths beyond its integer parameters; with
    ``own_variables`` it resolves its type variables itself. Every other block with one type
    variable gets a parameter ``signal`` for the type, for use where wires do not determine it.

    Raises
    ------
    DeclarationError : at the first inconsistency.
    """
    declarations: dict[type, dict[str, Any]] = {Input: {}, Output: {}, State: {}, Param: {}}
    attributes: dict[str, str] = {}
    origins: dict[str, str] = {}
    hints = _annotations(cls)
    for attribute, declared in _declared(cls, declarations):
        kind = type(declared)
        name = declared.name or attribute
        _check_name(cls, attribute, name, kind, origins)
        if kind is Param:
            declared = declared.bound(attribute, _kind(cls, attribute, hints.get(attribute)))
            attributes[name] = attribute
        declarations[kind][name] = declared
    inputs, outputs = declarations[Input], declarations[Output]
    spec = BlockSpec(
        inputs=inputs,
        outputs=outputs,
        states=declarations[State],
        params=declarations[Param],
        attributes=attributes,
        evaluations=_output_methods(cls, inputs, outputs),
        update=_optional(cls, "update", {**inputs, **outputs}),
        derivative=_optional(cls, "derivative", {**inputs, **outputs}),
        projects=getattr(cls, "project", None) is not None,
        guards=_optional(cls, "guards", {**inputs, **outputs}),
        event=_optional(cls, "event", {**inputs, **outputs}),
    )
    # Where nothing typed is wired, as from Constant to Gain, only the user knows the type.
    if spec.generic and not own_variables and "signal" not in spec.params:
        spec = replace(
            spec,
            params={**spec.params, "signal": _signal_param()},
            attributes={**attributes, "signal": STATED},
        )
    _check_ports(cls, spec)
    _check_states(cls, spec, own_sizes)
    _check_continuous(cls, spec)
    _check_defaults(cls, spec.params)
    return spec


def read_params(cls: type) -> dict[str, Param]:
    """The parameters that any class declares, inherited ones first.

    Raises
    ------
    DeclarationError : at the first inconsistency.
    """
    hints = _annotations(cls)
    params = {
        declared.name or attribute: declared.bound(
            attribute, _kind(cls, attribute, hints.get(attribute))
        )
        for attribute, declared in _declared(cls, (Param,))
    }
    _check_defaults(cls, params)
    return params


def _signal_param() -> Param:
    declared: Param = param(
        None, doc="the signal type, where nothing typed is wired: Scalar, Pose, Vector(3), ..."
    )
    return declared.bound("signal", "signal")


def _declared(cls: type, kinds: Container[type]) -> Iterator[tuple[str, Any]]:
    """Declarations by attribute; a class overrides what it inherits."""
    # From object downwards: a name keeps the place where it was declared first, and takes the
    # value that was declared last; a method that replaces a declaration removes it.
    merged: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        for attribute, value in vars(base).items():
            if attribute in merged or type(value) in kinds:
                merged[attribute] = value
    return ((key, value) for key, value in merged.items() if type(value) in kinds)


def _annotations(cls: type) -> dict[str, Any]:
    if not any(isinstance(value, Param) for base in cls.__mro__ for value in vars(base).values()):
        return {}
    try:
        return typing.get_type_hints(cls)
    except NameError as error:
        raise DeclarationError(
            f"{cls.__name__}: cannot read its annotations: {error}; import that name at the top "
            "of the module, outside TYPE_CHECKING"
        ) from None


def _check_name(cls: type, attribute: str, name: str, kind: type, origins: dict[str, str]) -> None:
    """Ports and states share one namespace, that of addresses; parameters have their own."""
    label = f"{cls.__name__}.{attribute}"
    if not name.isidentifier():
        raise DeclarationError(f"{label}: '{name}' is not a valid name; use letters, digits and _")
    # Block itself: a declaration named `start` or `value` would replace that method silently.
    base = next(c for c in reversed(cls.__mro__) if "spec" in vars(c))
    if attribute in vars(base):
        suggestion = f"rename it, with name='{name}' if graphs should use that name"
        raise DeclarationError(f"{label}: hides {base.__name__}.{attribute}; {suggestion}")
    if kind is Param:
        # The 'type' of an input of a graph is that of its signal.
        if name in RESERVED_PARAMETERS and cls.__name__ != "GraphInput":
            raise DeclarationError(f"{label}: '{name}' is reserved in graphs; rename it")
        key = f"parameter {name}"
    else:
        if kind is Input and name in RESERVED_INPUTS:
            raise DeclarationError(
                f"{label}: '{name}' is an argument of every method (self, state, t, ...), so an "
                "input cannot be named so; rename it"
            )
        if kind is State and name in RESERVED_STATES:
            raise DeclarationError(f"{label}: '{name}' is reserved in states; rename it")
        key = name
    if origins.setdefault(key, attribute) != attribute:
        raise DeclarationError(
            f"{label}: the name '{name}' is taken by the attribute '{origins[key]}'"
        )


def _kind(cls: type, attribute: str, annotation: Any) -> ParamKind | type[Setting]:
    options: list[Any] = [annotation]
    if typing.get_origin(annotation) in (typing.Union, types.UnionType):
        options = [option for option in typing.get_args(annotation) if option is not type(None)]
    for known, kind in KINDS.items():
        if options == [known]:
            return kind
    if len(options) == 1 and isinstance(options[0], type) and issubclass(options[0], Setting):
        return options[0]
    raise DeclarationError(
        f"{cls.__name__}.{attribute}: annotate the parameter with float, int, bool, str, "
        "FloatArray, tuple[str, ...] or Mapping[str, float] (or one of them | None), "
        f"not {annotation}"
    )


def _check_ports(cls: type, spec: BlockSpec) -> None:
    for name, port in spec.ports.items():
        if not isinstance(port.type, (SignalType, Same)):
            sized = getattr(port.type, "__name__", "") == "sized"
            suggestion = "; give it a length, as in Vector(3) or Vector('n')" if sized else ""
            raise DeclarationError(
                f"{cls.__name__}.{name}: expected a signal type such as Scalar, Pose or "
                f"Vector(3), got {port.type!r}{suggestion}"
            )
    for name, port in spec.inputs.items():
        count = port.variadic
        if port.spread and (count is not True or port.type != Scalar):
            raise DeclarationError(
                f"{cls.__name__}.{name}: spread needs a variadic input of Scalar"
            )
        if isinstance(count, str) and getattr(spec.params.get(count), "kind", "") != "int":
            raise DeclarationError(
                f"{cls.__name__}.{name}: variadic='{count}' is not an integer parameter"
                f"{hint(count, spec.params)}"
            )
    for name, output in spec.outputs.items():
        source = spec.inputs.get(output.through)
        if output.through and source is None:
            raise DeclarationError(
                f"{cls.__name__}.{name}: through='{output.through}' is not an input"
                f"{hint(output.through, spec.inputs)}"
            )
        if source is not None and (source.type != output.type or source.variadic):
            many = "many wires of " if source.variadic else ""
            raise DeclarationError(
                f"{cls.__name__}.{name}: through='{output.through}' takes {many}{source.type}, "
                f"which cannot replace {output.type}"
            )
    for evaluation in spec.evaluations:
        # Computed once before the first tick, when no input has a value.
        constant = [name for name in evaluation.outputs if spec.outputs[name].constant]
        if constant and evaluation.needs:
            raise DeclarationError(
                f"{cls.__name__}.{constant[0]}: a constant output cannot need inputs "
                f"({', '.join(evaluation.needs)})"
            )


def _check_states(cls: type, spec: BlockSpec, own_sizes: bool) -> None:
    kinds = [port.type for port in spec.ports.values()]
    lengths = {str(t.length) for t in kinds if isinstance(t, SignalType) and t.symbol}
    lengths |= {name for name, declared in spec.params.items() if declared.kind == "int"}
    for name, state in spec.states.items():
        if state.like and state.like not in spec.ports:
            raise DeclarationError(
                f"{cls.__name__}.{name}: like='{state.like}' is not a port"
                f"{hint(state.like, spec.ports)}"
            )
        for length in state.shape:
            whole = isinstance(length, int) and not isinstance(length, bool) and length >= 0
            if not whole and not isinstance(length, str):
                raise DeclarationError(
                    f"{cls.__name__}.{name}: expected lengths, whole numbers or names, as in "
                    f"State(2, 3) or State('n'), got {length!r}"
                )
        # What `sizes` returns depends on parameters, of which a class knows no values.
        unknown = [n for n in state.shape if isinstance(n, str) and n not in lengths]
        if unknown and not own_sizes:
            raise DeclarationError(
                f"{cls.__name__}.{name}: no integer parameter and no port gives the length "
                f"'{unknown[0]}'{hint(unknown[0], lengths)}"
            )


def _check_continuous(cls: type, spec: BlockSpec) -> None:
    """Continuous states and ``derivative`` belong together, and are nothing else."""
    if spec.continuous and spec.derivative is None:
        raise DeclarationError(
            f"{cls.__name__} declares the continuous state '{spec.continuous[0]}' but has no "
            "method derivative(self, state, t, ...) that returns its rate of change"
        )
    for method in ("derivative", "project"):
        if getattr(cls, method, None) is not None and not spec.continuous:
            raise DeclarationError(
                f"{cls.__name__}.{method}: the class has no continuous state; declare one, as in "
                "x = State(3, continuous=True)"
            )
    for name in spec.continuous:
        for other in ("event", "cached"):
            if getattr(spec.states[name], other):
                message = f"a continuous state cannot be {other}: the solver integrates it"
                raise DeclarationError(f"{cls.__name__}.{name}: {message}")
    if spec.projects:
        names = list(inspect.signature(getattr(cls, "project")).parameters)  # noqa: B009
        if names[1:] != ["state"]:
            raise DeclarationError(f"{cls.__name__}.project must take (self, state)")


def _check_defaults(cls: type, params: Mapping[str, Param]) -> None:
    for name, declared in params.items():
        if declared.required:
            continue
        try:
            declared.convert(declared.default)
        except ValueError as error:
            raise DeclarationError(f"{cls.__name__}.{name}: its default: {error}") from None


def _output_methods(
    cls: type, inputs: Mapping[str, Input], outputs: Mapping[str, Output]
) -> tuple[Evaluation, ...]:
    methods = [name for name in dir(cls) if name.startswith("output_")]
    for method in methods:
        port = method.removeprefix("output_")
        if port not in outputs and inspect.isfunction(getattr(cls, method)):
            raise DeclarationError(
                f"{cls.__name__}.{method}: there is no output '{port}'"
                f"{hint(port, outputs) or '; rename the method'}"
            )
    # A method of its own for a port means feedthrough of its own; the rest shares one call.
    own = {port: f"output_{port}" for port in outputs if f"output_{port}" in methods}
    rest = tuple(port for port in outputs if port not in own)
    evaluations = [_evaluation(cls, m, inputs, (port,)) for port, m in own.items()]
    if rest:
        if not inspect.isfunction(getattr(cls, "output", None)):
            raise DeclarationError(
                f"{cls.__name__} declares {', '.join(rest)} but has no method "
                f"output(self, state, t, ...) to compute it"
            )
        evaluations.append(_evaluation(cls, "output", inputs, rest))
    return tuple(evaluations)


def _optional(cls: type, method: str, ports: Mapping[str, Any]) -> Evaluation | None:
    """A method that a class need not have."""
    return None if getattr(cls, method, None) is None else _evaluation(cls, method, ports)


def _evaluation(
    cls: type, method: str, ports: Mapping[str, Any], outputs: tuple[str, ...] = ()
) -> Evaluation:
    return Evaluation(method, _needs(cls, method, ports), outputs, getattr(cls, method))


def _needs(cls: type, method: str, ports: Mapping[str, Any]) -> tuple[str, ...]:
    parameters = inspect.signature(getattr(cls, method)).parameters
    names = list(parameters)
    first = ["state", "t", "which"] if method == "event" else ["state", "t"]
    if names[1 : 1 + len(first)] != first:
        text = f"{cls.__name__}.{method} must start with (self, {', '.join(first)}, ...)"
        raise DeclarationError(text)
    taken = names[1 + len(first) :]
    for name in taken:
        if parameters[name].kind is not inspect.Parameter.POSITIONAL_OR_KEYWORD:
            raise DeclarationError(
                f"{cls.__name__}.{method}: name each port, in place of {parameters[name]}; "
                "an input that takes many wires comes as one tuple"
            )
        if name not in ports:
            raise DeclarationError(
                f"{cls.__name__}.{method}: '{name}' is not a port it can read"
                f"{hint(name, ports)} ({', '.join(ports) or 'none'})"
            )
    return tuple(taken)
