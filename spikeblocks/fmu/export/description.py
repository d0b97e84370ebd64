"""The description of an FMU: its variables, and ``modelDescription.xml`` for FMI 2.0 and 3.0.

In goes the layout of an exported graph, out come variables, which have the graph's own names, and
the XML::

    inputs: {force: {type: Scalar, unit: N}}   <ScalarVariable name="force" causality="input" ...
    probes: {angle: cart.angle}                <ScalarVariable name="cart.angle" causality="output"

With FMI 3.0, numbers that have no names of their own are one variable with a dimension.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from blocks.core import SignalType, dimension
from runtime.export import Layout, unused
from runtime.network import Network, PortDeclaration, first_column
from runtime.observation import Signal

NAME = re.compile(r"[A-Za-z_]\w*(\[\d+\])?(\.[A-Za-z_]\w*(\[\d+\])?)*", re.ASCII)
BASE = {"kg": "kg", "m": "m", "s": "s", "A": "A", "K": "K", "mol": "mol", "cd": "cd"}
ANGLE = "radian"  # the unit of an angle has no dimension otherwise
VARIABILITY = {"parameter": "tunable"}


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU.

    causality : as FMI names it. member : where it is in the struct that ``causality`` says.
    first, count : its numbers in that member. start : what they begin with; None for results.
    low, high : its bounds, infinite without.
    """

    name: str
    causality: str
    member: str
    first: int
    count: int
    doc: str
    unit: str = ""
    start: tuple[float, ...] | None = None
    low: float = -math.inf
    high: float = math.inf

    @property
    def variability(self) -> str:
        return VARIABILITY.get(self.causality, "continuous")


def variables(layout: Layout, recorded: Sequence[Signal], arrays: bool) -> list[Variable]:
    """The variables: inputs and outputs of the graph, recorded signals, tunable parameters.

    A graph without a section ``outputs`` has what it records as outputs; otherwise that is local.

    Parameters
    ----------
    recorded : the signals of the graph's probes.
    arrays : whether numbers without names of their own are one variable.
    """
    network = layout.selection.network
    found = [*_inputs(layout, network), *_outputs(layout, network, recorded), *_parameters(layout)]
    taken: set[str] = {"time"}
    made = []
    for each in found:
        every = [each] if arrays and each.count > 1 else list(_numbers(each))
        made += [replace(one, name=unused(one.name, taken)) for one in every]
    return made


def _numbers(each: Variable) -> Iterator[Variable]:
    """A variable for each number of one."""
    for i in range(each.count):
        index = f"[{i}]" if each.count > 1 else ""
        start = None if each.start is None else (each.start[i],)
        yield replace(each, name=f"{each.name}{index}", first=each.first + i, count=1, start=start)


def _inputs(layout: Layout, network: Network) -> Iterator[Variable]:
    ports = {(p.end.block, p.end.port): p for p in network.inputs.values()}
    for port in layout.selection.inputs:
        yield from _of_port(ports[port], "input", layout.names[port])


def _of_port(port: PortDeclaration, causality: str, member: str) -> Iterator[Variable]:
    """The variables of a port: one for each number that has a name, otherwise one."""
    low, high = np.ravel(port.low), np.ravel(port.high)
    default = None
    if causality == "input":
        default = np.ravel(np.zeros(port.type.shape) if port.default is None else port.default)
    parts = list(_parts(port.name, port.type, port.unit.split(", ")))
    for name, first, count, unit in parts:
        start = None if default is None else tuple(default[first : first + count].tolist())
        bounds = float(low[first : first + count].max()), float(high[first : first + count].min())
        yield Variable(name, causality, member, first, count, port.doc, unit, start, *bounds)


def _parts(
    name: str, kind: SignalType, units: Sequence[str]
) -> Iterator[tuple[str, int, int, str]]:
    """Name, first number, count and unit of what a signal consists of."""
    count = math.prod(kind.shape)
    if kind.form == "scalar":
        yield name, 0, 1, units[0]
    elif kind.form == "record" or kind.rows:
        own = units if len(units) == count else [units[0]] * count
        for i, part in enumerate(kind.names):
            yield f"{name}.{part}", i, 1, own[i]
    else:
        yield name, 0, count, units[0] if len(set(units)) == 1 else ""


def _outputs(layout: Layout, network: Network, recorded: Sequence[Signal]) -> Iterator[Variable]:
    selection = layout.selection
    for port in network.outputs.values():
        end = port.end.block, port.end.port
        if end in selection.outputs:
            first = first_column(network.types[end], port.end.component)
            for each in _of_port(port, "output", layout.names[end]):
                yield replace(each, first=first + each.first)
    causality = "local" if network.outputs else "output"
    by_address = {each.address: each for each in recorded if not each.is_state}
    seen = set()
    for signal in by_address.values():
        end = signal.end.block, signal.end.port
        if end not in selection.outputs or signal.publisher:
            continue
        seen.add(end)
        member, kind = layout.names[end], network.types[end]
        first, doc = first_column(kind, signal.end.component), signal.name
        if kind.form == "array" and not (kind.rows or signal.end.component):
            units = set(signal.units)
            unit = units.pop() if len(units) == 1 else ""
            count = math.prod(kind.shape)
            yield Variable(signal.address, causality, member, 0, count, doc, unit)
            continue
        for i, (label, unit) in enumerate(zip(signal.labels, signal.units, strict=True)):
            yield Variable(label, causality, member, first + i, 1, doc, unit)
    others = [] if network.outputs else [end for end in selection.outputs if end not in seen]
    for end in others:
        kind, member = network.types[end], layout.names[end]
        for name, first, count, unit in _parts(".".join(end), kind, kind.units or ("",)):
            yield Variable(name, causality, member, first, count, str(kind), unit)


def _parameters(layout: Layout) -> Iterator[Variable]:
    for each in layout.parameters.values():
        doc, start = each.doc.partition(": ")[2], tuple(np.ravel(each.value).tolist())
        unit = "" if ", " in each.unit else each.unit
        yield Variable(each.path, "parameter", each.name, 0, each.size, doc, unit, start)


def description(
    version: int, layout: Layout, identity: Mapping[str, str], found: Sequence[Variable]
) -> str:
    """The text of ``modelDescription.xml``.

    Parameters
    ----------
    version : 2 or 3. identity : name, token, identifier and about.
    """
    network, is_three = layout.selection.network, version == 3
    token = "instantiationToken" if is_three else "guid"
    every = {"time", *(each.name for each in found)}
    root = Element("fmiModelDescription")
    root.attrib |= {"fmiVersion": f"{version}.0", "modelName": identity["name"]}
    root.attrib |= {token: identity["token"], "generationTool": "spikeblocks"}
    root.set("description", identity["about"])
    structured = all(map(NAME.fullmatch, every))
    root.set("variableNamingConvention", "structured" if structured else "flat")
    if not is_three:
        root.set("numberOfEventIndicators", "0")
    kind = SubElement(root, "CoSimulation", modelIdentifier=identity["identifier"])
    state = "State" if is_three else "state"
    abilities = ["canHandleVariableCommunicationStepSize", f"canGetAndSetFMU{state}"]
    abilities += [f"canSerializeFMU{state}"]
    if is_three:
        kind.set("fixedInternalStepSize", repr(network.dt))
    else:
        abilities.append("canNotUseMemoryManagementFunctions")
        files = SubElement(kind, "SourceFiles")
        SubElement(files, "File", name=f"{identity['identifier']}_fmu.c")
    kind.attrib |= dict.fromkeys(abilities, "true")
    _units(root, [network.time_unit, *(each.unit for each in found)])
    SubElement(
        SubElement(root, "LogCategories"), "Category", name="logStatusError", description="failures"
    )
    until = network.ticks * network.dt
    times = {"startTime": "0.0", "stopTime": repr(until), "stepSize": repr(network.dt)}
    SubElement(root, "DefaultExperiment", times)
    _variables(SubElement(root, "ModelVariables"), is_three, network.time_unit, found)
    _structure(SubElement(root, "ModelStructure"), is_three, found)
    indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + tostring(root, encoding="unicode") + "\n"


def _structure(structure: Element, is_three: bool, found: Sequence[Variable]) -> None:
    """The results: by value reference, and with FMI 2.0 by place, from 1 on."""
    results = [i for i, each in enumerate(found, 1) if each.causality == "output"]
    for tag in ("Output", "InitialUnknown") if results else ():
        place = structure if is_three else SubElement(structure, f"{tag}s")
        for i in results:
            key, number = ("valueReference", i) if is_three else ("index", i + 1)
            SubElement(place, tag if is_three else "Unknown", {key: str(number)})


def _variables(place: Element, is_three: bool, time: str, found: Sequence[Variable]) -> None:
    begun = {"name": "time", "causality": "independent", "valueReference": "0"}
    begun |= {"variability": "continuous"}
    if is_three:
        SubElement(place, "Float64", begun | ({"unit": time} if time else {}))
    else:
        SubElement(SubElement(place, "ScalarVariable", begun), "Real", {"unit": time})
    for reference, each in enumerate(found, 1):
        own = {"name": each.name, "valueReference": str(reference)}
        own |= {"description": each.doc} if each.doc else {}
        own |= {"causality": each.causality, "variability": each.variability}
        if each.causality != "input":
            own["initial"] = "calculated" if each.start is None else "exact"
        number = {"unit": each.unit} if each.unit else {}
        for key, bound in (("min", each.low), ("max", each.high)):
            number |= {key: repr(bound)} if math.isfinite(bound) else {}
        if each.start is not None:
            number["start"] = " ".join(map(_written, each.start))
        if not is_three:
            SubElement(SubElement(place, "ScalarVariable", own), "Real", number)
            continue
        made = SubElement(place, "Float64", own | number)
        if each.count > 1:
            SubElement(made, "Dimension", start=str(each.count))


def _written(number: float) -> str:
    """A number in XML, which has names of its own for infinity."""
    return repr(number) if math.isfinite(number) else str(number).upper().replace("NAN", "NaN")


def _units(root: Element, units: Sequence[str]) -> None:
    """Definitions of units, with their dimensions where these are of the SI."""
    names = list(dict.fromkeys(filter(None, units)))
    place = SubElement(root, "UnitDefinitions") if names else root
    for name in names:
        made = SubElement(place, "Unit", name=name)
        powers = dimension(re.sub(r"\brad\b", ANGLE, name))
        known = BASE | {ANGLE: "rad"}
        if powers is not None and all(base in known for base, _ in powers):
            SubElement(made, "BaseUnit", {known[base]: str(n) for base, n in sorted(powers)})


def any_of(found: Sequence[Variable], causality: str) -> list[str]:
    """The names of the variables of one causality."""
    return [each.name for each in found if each.causality == causality]
