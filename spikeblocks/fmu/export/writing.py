"""A graph as an FMU for co-simulation, for FMI 2.0 or 3.0.

In goes a graph, out comes one file with the exported C around which ``model.c`` and ``fmi*.c`` put
the interface, the description of its variables, and a binary for this computer::

    lorenz.fmu    modelDescription.xml
                  binaries/x86_64-linux/lorenz.so
                  sources/lorenz.h, lorenz.c, lorenz_fmu.c, buildDescription.xml
                  documentation/index.html
"""

from __future__ import annotations

import io
import platform
import sys
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template

from runtime.errors import UsageError
from runtime.export import (
    Exported,
    Layout,
    about,
    check_name,
    comment,
    header,
    literal,
    make_layout,
    member_name,
    source,
)
from runtime.files import refuse_link, system_errors, write_files
from runtime.graph import Graph
from runtime.toolchain import Builder, TranslationUnit, available
from spikeblocks.fmu.export.description import Variable, any_of, description, variables

ASSETS = Path(__file__).parent
OWNERS = {"input": "INPUT", "output": "OUTPUT", "local": "OUTPUT", "parameter": "PARAMETER"}
STRUCTS = {"INPUT": "inputs", "OUTPUT": "outputs", "PARAMETER": "parameters"}
SYSTEMS = {"linux": ("linux", ".so"), "darwin": ("darwin", ".dylib"), "win32": ("windows", ".dll")}
WITHOUT_MACHINE = {"linux": "linux64", "darwin": "darwin64", "windows": "win64"}  # of FMI 2.0
MACHINES = {"amd64": "x86_64", "arm64": "aarch64"}
DATE = (1980, 1, 1, 0, 0, 0)  # the same graph gives the same file
BUILD = """<?xml version="1.0" encoding="UTF-8"?>
<fmiBuildDescription fmiVersion="3.0">
  <BuildConfiguration modelIdentifier="{name}">
    <SourceFileSet language="C99" compilerOptions="-ffp-contract=off">
      <SourceFile name="{name}_fmu.c"/>
    </SourceFileSet>
    <Library name="m" external="true"/>
  </BuildConfiguration>
</fmiBuildDescription>
"""


def export_fmu(
    graph: Graph,
    folder: str | Path,
    *,
    blocks: Sequence[str] = (),
    others: Sequence[str] = (),
    name: str = "",
    fmi: int = 3,
    ticks: int | None = None,
    float32: bool = False,
    hold: bool = False,
) -> Exported:
    """Write a graph as an FMU for co-simulation.

    Parameters
    ----------
    name : of the file and the model; the graph's title by default.
    fmi : the version of the interface, 2 or 3.

    Raises
    ------
    UsageError : something is asked for that an FMU does not have.
    GraphError : blocks cannot be exported; each is named with the reason.
    BuildError : the compiler does not accept the C.
    """
    if blocks or others or float32 or hold or ticks is not None:
        raise UsageError("--to fmu: an FMU has the whole graph; leave out other options than --fmi")
    network = graph.network
    name = name or member_name(network.title)
    check_name(name)
    layout = make_layout(graph, name)
    observation = graph.program().observation
    recorded = [signal for probe in observation.probes.values() for signal in probe.signals]
    found = variables(layout, recorded, arrays=fmi == 3)
    texts = _texts(layout, found, fmi, about(graph))
    files = {f"sources/{file}": text.encode() for file, text in texts.items()}
    identity = {"name": network.title, "identifier": name, "token": _token(fmi, layout)}
    xml = description(fmi, layout, identity | {"about": f"{about(graph)}."}, found)
    files["modelDescription.xml"] = xml.encode()
    if fmi == 3:
        files["sources/buildDescription.xml"] = BUILD.format(name=name).encode()
    page = "documentation/" + ("index.html" if fmi == 3 else "_main.html")
    files[page] = _documentation(graph).encode()
    place, notes = _platform(fmi), []
    if place and available():
        files[f"binaries/{place[0]}/{name}{place[1]}"] = _binary(name, texts)
    else:
        notes.append("no C compiler: the FMU has its sources, and no binary")
    with system_errors(f"write to '{folder}'"):
        refuse_link(target := Path(folder))
        write_files({target / f"{name}.fmu": _archive(files)}, folders=True)
    there = layout.selection.outputs
    missing = [s.address for s in recorded if s.is_state or (s.end.block, s.end.port) not in there]
    notes += [f"not a variable: {each}, a constant or a state" for each in dict.fromkeys(missing)]
    report = _report(network.title, fmi, found, sum(map(len, files.values())), notes)
    inputs, outputs = tuple(any_of(found, "input")), tuple(any_of(found, "output"))
    return Exported(target, (f"{name}.fmu",), report, inputs, outputs)


def _token(fmi: int, layout: Layout) -> str:
    """What says that a description and a binary belong together: a hash of the C."""
    texts = header(layout, [], False), source(layout, [], False)
    return "{" + str(uuid.uuid5(uuid.NAMESPACE_OID, "".join([str(fmi), *texts]))) + "}"


def _texts(layout: Layout, found: Sequence[Variable], fmi: int, says: str) -> dict[str, str]:
    """The sources."""
    name, title = layout.name, layout.selection.network.title
    return {
        f"{name}.h": header(layout, [title], False),
        f"{name}.c": source(layout, [title], False),
        f"{name}_fmu.c": _interface(layout, found, fmi, _token(fmi, layout), says),
    }


def _report(
    title: str, fmi: int, found: Sequence[Variable], size: int, notes: Sequence[str]
) -> str:
    """What the FMU has."""
    counts = {each: len(any_of(found, each)) for each in OWNERS}
    lines = [
        f"{title}: FMI {fmi}.0 for co-simulation",
        f"  {counts['input']} inputs, {counts['output']} outputs, {counts['local']} local "
        f"variables, {counts['parameter']} tunable parameters; {size / 1e3:.0f} kB unpacked",
        *(f"  {note}" for note in notes),
    ]
    return "\n".join(lines) + "\n"


def _interface(layout: Layout, found: Sequence[Variable], fmi: int, token: str, says: str) -> str:
    """The C of the interface."""
    rows = []
    for each in found:
        owner = OWNERS[each.causality]
        struct = f"struct {layout.name}_{STRUCTS[owner]}"
        at = f"offsetof({struct}, {each.member}) + {each.first} * sizeof(double)"
        rows.append(f"    {{{owner}, {at}, {each.count}}},")
    starts = [literal(x) for each in found if each.causality == "input" for x in each.start or ()]
    model = Template((ASSETS / "model.c").read_text(encoding="utf-8")).substitute(
        about=comment(says),
        name=layout.name,
        token=token,
        dt=repr(layout.selection.network.dt),
        variables="\n".join(rows),
        starts=", ".join(starts) or "0.0",
        stopped=layout.failures[("stopped",)][0],
    )
    return model + (ASSETS / f"fmi{fmi}.c").read_text(encoding="utf-8")


def _platform(fmi: int) -> tuple[str, str] | None:
    """The folder of binaries for this computer, and their ending; None if FMI names none."""
    known = SYSTEMS.get(sys.platform)
    if known is None:
        return None
    system, ending = known
    machine = MACHINES.get(platform.machine().lower(), platform.machine().lower())
    if fmi == 3:
        return f"{machine}-{system}", ending
    # FMI 2.0 has names for one kind of processor; others are named as FMI 3.0 does.
    place = WITHOUT_MACHINE[system] if machine == "x86_64" else f"{machine}-{system}"
    return place, ending


def _binary(name: str, texts: Mapping[str, str]) -> bytes:
    """The shared library, for any processor of this kind."""
    text = texts[f"{name}_fmu.c"].replace(f'#include "{name}.c"', texts[f"{name}.c"])
    text = text.replace(f'#include "{name}.h"', texts[f"{name}.h"])
    with Builder(portable=True) as builder:
        return builder.build([TranslationUnit(f"{name}_fmu", text)]).path.read_bytes()


def _documentation(graph: Graph) -> str:
    title, picture = escape(graph.network.title), str(graph.diagram("svg"))
    head = f'<!doctype html>\n<html lang="en"><meta charset="utf-8"><title>{title}</title>\n'
    picture = picture[picture.index("<svg") :]
    return f"{head}<h1>{title}</h1>\n{picture}\n<p>{escape(about(graph))}.</p>\n"


def _archive(files: Mapping[str, bytes]) -> bytes:
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, content in sorted(files.items()):
            archive.writestr(zipfile.ZipInfo(file, DATE), content, zipfile.ZIP_DEFLATED)
    return made.getvalue()
