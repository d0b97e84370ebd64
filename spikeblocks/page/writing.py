"""One HTML file that simulates a graph in the reader's browser, without a server or a network.

In goes a graph, out comes a page: the exported C as a WebAssembly module, the graph's plots drawn
while it runs, and sliders for some of its numbers.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import math
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from runtime.engine import Engine
from runtime.errors import UsageError
from runtime.export import (
    Exported,
    Layout,
    Units,
    about,
    header,
    make_layout,
    make_units,
    member_name,
    source,
)
from runtime.files import refuse_link, system_errors, write_files
from runtime.graph import Graph
from runtime.plan import Port
from runtime.reports import chart_script, chart_style
from spikeblocks.page.shown import Shown, shown
from spikeblocks.page.sliders import Slider, given, sliders, usual
from spikeblocks.page.wasm import module

ROWS = 4000  # of a whole run: more points than a plot has pixels
ASSETS = Path(__file__).parent
NAME = "simulation"


def export_page(
    graph: Graph,
    folder: str | Path,
    *,
    blocks: Sequence[str] = (),
    others: Sequence[str] = (),
    name: str = "",
    slider: Sequence[str] = (),
    ticks: int | None = None,
    float32: bool = False,
    hold: bool = False,
) -> Exported:
    """Write a page that simulates a graph.

    Parameters
    ----------
    name : of the file; the graph's title by default.
    slider : values that the reader may change, as ``fault.gain[1]=0..1``; by default, some of the
        blocks' parameters.

    Raises
    ------
    UsageError : something is asked for that a page does not have.
    GraphError : blocks cannot be exported; each is named with the reason.
    MissingExtraError : ziglang is not installed.
    """
    if blocks or others or float32 or hold or ticks is not None:
        raise UsageError(
            "--to html: a page has the whole graph; leave out other options than --slider"
        )
    network = graph.network
    layout = make_layout(graph, NAME, loose=True)
    outputs = layout.selection.outputs
    plots = shown(graph, outputs, _constants(graph))
    if not plots.plots:
        raise UsageError("--to html: the graph has no plot that a page can draw; add a timeseries")

    def prepare(changed: Graph) -> Units:
        return make_units(changed, NAME)

    made = sliders(graph, layout, prepare, slider or usual(graph, layout), strict=bool(slider))
    packed = gzip.compress(module(_c_text(layout, plots)), 9, mtime=0)
    text = _page(graph, _data(layout, plots, made), packed, plots)
    file = f"{name or member_name(network.title)}.html"
    with system_errors(f"write to '{folder}'"):
        place = Path(folder)
        refuse_link(place)
        write_files({place / file: text}, folders=True)
    report = _report(network.title, plots, made, len(text), len(packed))
    return Exported(place, (file,), report, (), tuple(map(".".join, outputs)))


def _report(title: str, plots: Shown, made: Sequence[Slider], size: int, module_size: int) -> str:
    """What the page has, and its size in bytes with that of its module."""
    lines = [f"{title}: {len(plots.plots)} plots, {len(made)} sliders"]
    lines += [f"  slider {s.label}: {s.numbers[0]:g} to {s.numbers[-1]:g}" for s in made]
    lines += [f"  not drawn in a page: {left_out}" for left_out in plots.left_out]
    lines.append(f"  {size / 1e3:.0f} kB, of which {module_size / 1e3:.0f} kB are the module")
    return "\n".join(lines) + "\n"


def _data(layout: Layout, plots: Shown, made: Sequence[Slider]) -> dict[str, Any]:
    """What the script of the page reads."""
    network = layout.selection.network
    return {
        **{"title": network.title, "dt": network.dt, "unit": network.time_unit},
        **{"until": network.ticks * network.dt, "ticks": network.ticks},
        "every": max(1, math.ceil(network.ticks / ROWS)),
        "columns": ["t", *(f"{block}.{port}[{i}]" for (block, port), i in plots.columns)],
        "plots": plots.plots,
        "sliders": [each.as_dict() for each in made],
        "inputs": given(layout),
        "parameters": max(1, sum(each.size for each in layout.parameters.values())),
        "stopped": layout.failures[("stopped",)][0],
    }


def _constants(graph: Graph) -> dict[Port, np.ndarray[Any, Any]]:
    """The values of all outputs that never change."""
    program = graph.program()
    engine = Engine(program, graph.network.seed)
    engine.prepare()
    calls = (call for call in program.plan.evaluations if call.gate.once)
    return {
        signal.key: np.asarray(engine.namespace[program.names.signals[signal.key]])
        for call in calls
        for signal in call.outputs
    }


def _c_text(layout: Layout, plots: Shown) -> str:
    """The controller with what a page calls."""
    copies = []
    for column, (port, index) in enumerate(plots.columns, 1):
        scalar = layout.kind(port).form == "scalar"
        item = layout.names[port] + (f"[{index}]" if not scalar else "")
        copies.append(f"        row[{column}] = out.{item};")
    glue = Template((ASSETS / "page.c").read_text(encoding="utf-8")).substitute(
        name=NAME,
        width=1 + len(plots.columns),
        dt=repr(layout.selection.network.dt),
        stopped=layout.failures[("stopped",)][0],
        copies="\n".join(copies),
    )
    text = source(layout, [layout.name], float32=False)
    return text.replace(f'#include "{NAME}.h"', header(layout, [layout.name], float32=False)) + glue


def _page(graph: Graph, data: dict[str, Any], packed: bytes, plots: Shown) -> str:
    """The text of the page."""

    def asset(file: str) -> str:
        return (ASSETS / file).read_text(encoding="utf-8")

    hint = (
        "Move a slider: the curves are computed again, here in this page. Dashed: the run before."
    )
    notes = f" Not drawn in a page: {', '.join(plots.left_out)}." if plots.left_out else ""
    picture = str(graph.diagram("svg"))
    picture = picture[picture.index("<svg") :]
    parts = {
        "title": escape(str(data["title"])),
        "lead": escape(hint + notes),
        "style": chart_style() + asset("page.css"),
        "diagram": "<details><summary>Block diagram</summary>"
        f'<div class="diagram">{picture}</div></details>',
        "about": escape(f"{about(graph)}."),
        "uplot": chart_script(),
        # "<!--" in a script would begin a comment that swallows the end of the element.
        "data": json.dumps(data, allow_nan=False).replace("<", "\\u003c"),
        "module": base64.b64encode(packed).decode("ascii"),
        "script": asset("page.js"),
    }
    # In one pass: a title may be "@script@".
    text = re.sub("@([a-z]+)@", lambda found: parts.get(found[1], found[0]), asset("page.html"))
    return text.replace("@policy@", _policy(text), 1)


def _policy(page: str) -> str:
    """A content security policy that lets nothing run but the page's own scripts."""
    scripts = re.findall("<script>(.*?)</script>", page, re.DOTALL)
    digests = (hashlib.sha256(text.encode()).digest() for text in scripts)
    hashes = " ".join(f"'sha256-{base64.b64encode(each).decode()}'" for each in digests)
    scripts_from = f"script-src {hashes} 'wasm-unsafe-eval'"
    return f"default-src 'none'; style-src 'unsafe-inline'; img-src data:; {scripts_from}"
