"""What an FMU says of itself, read from its ``modelDescription.xml`` without running anything.

In goes a file, out come its variables by what they are for::

    read("tank.fmu").inputs   (Variable("valve", 1, "Float64", 1, unit="", start=0.0),)
"""

from __future__ import annotations

import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from xml.etree import ElementTree

from blocks.core import ParameterError, hint
from blocks.files import DAMAGED, archive, read
from blocks.limits import GIB, MIB, size

# Limits on what an FMU may ask for; docs/fmu.md shows them.
FMU, UNPACKED = 128 * MIB, GIB
TEXT, ENTRIES, ALL_NUMBERS = 32 * MIB, 1_000_000, 1_000_000
NUMBERS = ("Real", "Integer", "Boolean", "Enumeration", "Float64", "Float32")
_DAMAGED: tuple[type[Exception], ...] = (*DAMAGED, ElementTree.ParseError)
INTEGERS = tuple(f"{sign}Int{bits}" for sign in ("", "U") for bits in (8, 16, 32, 64))


@dataclass(frozen=True)
class Variable:
    """A variable of an FMU: a number, or an array of ``count`` numbers (FMI 3.0).

    kind : the type, as FMI names it. depends : whether it may depend on inputs directly.
    """

    name: str
    reference: int
    kind: str
    count: int
    causality: str
    unit: str = ""
    start: str = ""
    depends: bool = True


@dataclass(frozen=True)
class Description:
    """An FMU: its version (2 or 3), its variables, and what it can do.

    kinds : the attributes of its co-simulation and model exchange, by the element's name.
    states, indicators : numbers of continuous states and of event indicators.
    """

    version: int
    name: str
    token: str
    content: bytes = field(repr=False)
    variables: Mapping[str, Variable]
    kinds: Mapping[str, Mapping[str, str]]
    states: int
    indicators: int

    def of(self, causality: str) -> tuple[Variable, ...]:
        """The numeric variables of a causality, in their order."""
        every = self.variables.values()
        return tuple(v for v in every if v.causality == causality and v.kind in NUMBERS + INTEGERS)

    def can(self, kind: str, what: str) -> bool:
        """Whether it can do something, as ``canSerializeFMUState``; the versions differ in case."""
        found = {key.lower(): value for key, value in self.kinds[kind].items()}
        return found.get(what.lower()) in ("true", "1")

    def variable(self, name: str) -> Variable:
        """A variable by name.

        Raises
        ------
        ParameterError : there is none, or it is no number.
        """
        found = self.variables.get(name)
        if found is None or found.count != 1 or found.kind not in NUMBERS + INTEGERS:
            what = "is not one number" if found else "is not a variable of the FMU"
            suggestion = "" if found else hint(name, self.variables)
            raise ParameterError([("values", f"'{name}' {what}{suggestion}")])
        return found


def described(path: str) -> Description:
    """The description of a file; the same file is read once.

    Raises
    ------
    ParameterError : it cannot be read, or is no FMU of FMI 2.0 or 3.0.
    """
    file = Path(path)
    try:
        return _read(str(file.resolve()), file.stat().st_mtime_ns)
    except OSError as error:
        raise ParameterError([("file", f"cannot read '{path}': {error.strerror}")]) from None
    except _DAMAGED as error:
        message = f"'{file.name}' is not an FMU of FMI 2.0 or 3.0: {error}"
        raise ParameterError([("file", message)]) from None


class _Builder(ElementTree.TreeBuilder):
    """Refuses a document type, in which entities are defined that expand to any length."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise ValueError("its modelDescription.xml has a document type")


@lru_cache(maxsize=4)
def _read(path: str, stamp: int) -> Description:
    content = read(path, FMU)
    with archive(io.BytesIO(content), UNPACKED) as members:
        if members.getinfo("modelDescription.xml").file_size > TEXT:
            raise ValueError(f"its modelDescription.xml is larger than {size(TEXT)}")
        text = members.read("modelDescription.xml")
    # Counted before it is read: an element of four characters takes a hundred bytes of memory.
    if text.count(b"<") + text.count(b"=") > ENTRIES:
        message = f"more than {ENTRIES:,} elements and attributes"
        raise ValueError(f"its modelDescription.xml has {message}")
    root = ElementTree.fromstring(text, ElementTree.XMLParser(target=_Builder()))
    version = root.get("fmiVersion", "")
    if version[:2] not in ("2.", "3."):
        raise ValueError(f"its version is '{version}'")
    is_three = version[0] == "3"
    variables = _variables(root, is_three)
    by_reference = {str(each.reference): each for each in variables.values()}
    rates = root.findall("ModelStructure/ContinuousStateDerivative")
    states = sum(by_reference[each.get("valueReference", "")].count for each in rates)
    if not is_three:
        states = len(root.findall("ModelStructure/Derivatives/Unknown"))
    signs = len(root.findall("ModelStructure/EventIndicator"))
    names = ("CoSimulation", "ModelExchange")
    return Description(
        int(version[0]),
        root.get("modelName", ""),
        root.get("instantiationToken" if is_three else "guid", ""),
        content,
        variables,
        {name: dict(found.attrib) for name in names if (found := root.find(name)) is not None},
        states,
        signs if is_three else int(root.get("numberOfEventIndicators", "0")),
    )


def _variables(root: ElementTree.Element, is_three: bool) -> dict[str, Variable]:
    """All variables in order; an output without a listed dependency depends on no input."""
    listed = root.find("ModelVariables")
    every = [] if listed is None else list(listed)
    places = "Output" if is_three else "Outputs/Unknown"
    free = {
        found.get("valueReference" if is_three else "index")
        for found in root.findall(f"ModelStructure/{places}")
        if found.get("dependencies") == ""
    }
    made, total = {}, 0
    for index, each in enumerate(every, 1):
        kind = each if is_three else each[0]
        reference = each.get("valueReference", "")
        count = math.prod(int(part.get("start", "1")) for part in each.findall("Dimension"))
        key = reference if is_three else str(index)
        total += count
        if not 0 <= count <= total <= ALL_NUMBERS:
            raise ValueError(f"its variables have more than {ALL_NUMBERS:,} numbers")
        name = each.get("name", "")
        made[name] = Variable(
            *(name, int(reference), kind.tag, count, each.get("causality", "local")),
            *(kind.get("unit", ""), kind.get("start", ""), key not in free),
        )
    return made
