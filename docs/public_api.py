"""The public Python interface: what is stable, and its listing with names and signatures.

In: the doors below. Out: one line for each name, attribute and method, which docs/api.txt holds::

    runtime.load(source: str | Path | Mapping[str, Any] | Node) -> Graph
    runtime.Graph.run(self, progress: ProgressCallback | None = None) -> Result
"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator
from importlib import import_module
from typing import Any

# For users, for authors of blocks, and for authors of packages. All other names may change.
PUBLIC: dict[str, tuple[str, ...]] = {
    "runtime": (),  # all of its __all__
    "blocks": (
        *("Block", "BlockContext", "BlockState", "Input", "Output", "State", "param", "kernel_of"),
        *("DeclarationError", "ParameterError", "FloatArray", "SignalType", "Same", "Scalar"),
        *("Vector", "Pose", "Twist", "WheelSpeeds", "TrackingState", "Scan", "PointCloud", "Path"),
        *("Spikes", "NeuronModel", "DecoderSolver"),
    ),
    "runtime.observation": (
        *("MetricKind", "MetricOptions", "NumberOptions", "PlotKind", "Recording", "RunData"),
        "Series",
    ),
    "runtime.graph": ("BlockInfo", "WireInfo"),
    "runtime.diagrams": ("DiagramFormat",),
    "runtime.export": ("ExportTarget", "Exported", "export"),
    "runtime.arguments": ("add_json", "add_output", "at_least", "integer"),
    "runtime.cli": ("main", "run"),
}


# Classes that are no part of the interface themselves: their members are those of what derives.
BASES = ("Outcome", "TrialTable")
# What commands ask of any experiment.
OUTCOME = ("all_rows", "exit_code", "is_interrupted", "plan", "so_far", "to_dict", "wall_s")
# Of a public class, what other rooms of ours use of it.
INTERNAL = {
    "runtime.Graph": {
        *("document", "network", "observation", "of_document", "overrides", "prepared"),
        *("program", "texts"),
    },
    "runtime.AblationTable": {"__init__", *OUTCOME, "head", "notes", "rows", "test"},
    "runtime.Result": {"__init__"},
    "runtime.SweepTable": {"__init__", *OUTCOME, "tally"},
    "runtime.TuningTable": {"__init__", *OUTCOME, "has_feasible", "held_out", "runs", "verdicts"},
}


def listing() -> str:
    """One line for each public name, and for each public member of a class."""
    lines: list[str] = []
    for module in PUBLIC:
        for name in public_names(module):
            lines += _lines(f"{module}.{name}", getattr(import_module(module), name))
    return "\n".join(lines) + "\n"


def public_names(module: str) -> list[str]:
    """The stable names of a door."""
    return sorted(PUBLIC[module] or import_module(module).__all__)


def _lines(name: str, value: Any) -> Iterator[str]:
    if not inspect.isclass(value):
        called = inspect.isfunction(value)
        yield name + (_signature(value) if called else f": {type(value).__name__}")
        return
    bases = [base.__name__ for base in value.__bases__ if base is not object]
    public = ", ".join(base for base in bases if not _is_hidden(base))
    yield f"class {name}" + (f"({public})" if public else "")
    internal = INTERNAL.get(name, ())
    if inspect.isfunction(value.__init__) and "__init__" not in internal:
        yield f"{name}.__init__{_signature(value.__init__)}"
    for key, member in sorted(_members(value).items()):
        if key not in internal:
            yield f"{name}.{key}{member}"


def _members(cls: type) -> dict[str, str]:
    """The public members of a class and of its private bases, methods with their signature."""
    members: dict[str, str] = {}
    for base in (each for each in cls.__mro__ if each is cls or _is_hidden(each.__name__)):
        fields = inspect.get_annotations(base)
        for key in {*vars(base), *fields} - members.keys():
            value = vars(base).get(key)
            if isinstance(value, (staticmethod, classmethod)):
                value = value.__func__
            is_method = inspect.isfunction(value) and key not in fields
            if key == "__getitem__" or not key.startswith("_"):
                members[key] = _signature(value) if is_method else ""
    return members


def _is_hidden(base: str) -> bool:
    return base.startswith("_") or base in BASES


def _signature(function: Any) -> str:
    # An object without a form of its own shows its address, which differs from run to run.
    text = re.sub(r" at 0x[0-9a-f]+", "", str(inspect.signature(function)))
    # Annotations are strings, since modules postpone their evaluation.
    return re.sub(r"(: |-> )'([^']*)'", r"\1\2", text)
