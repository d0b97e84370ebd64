"""Pictures that pages get when the site is built: bars, plots of each kind, the paper's figures.

In: the text of a page. Out: the text with pictures, each of what the page says or of a run::

    |  | per tick |                      <div class="bars">... 56.3 µs ▇▇▇▇ </div>
    | Python engine | 56.3 µs |   ->     and the table
"""

from __future__ import annotations

import hashlib
import html
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from pictures import of_run

import runtime
from runtime.cli.shipped import RUNNABLE, shipped
from runtime.engine import python_seconds
from runtime.files import slug
from runtime.observation import PLOT_KINDS

ROOT = Path(__file__).resolve().parent.parent
LONGEST = 10.0  # estimated seconds of a run under the Python engine
# What each figure of the paper shows, and the claims about it (docs/reproduction.md).
FIGURES = {
    "figure_1_framework": "1: the framework, as the block diagram of the graph that runs",
    "figure_2_network": "2: the network that learns, as a block diagram",
    "figure_3_lif_neuron": "3: one LIF neuron under two pulses of current",
    "figure_4_line_trajectory": "4: case A, the trajectory onto the line (A3, A4)",
    "figure_5_line_errors": "5: case A, errors of position and heading (A1, A2, A4)",
    "figure_6_line_adaptive_command": "6: case A, the command of the neurons (A5)",
    "figure_7_sine_trajectory": "7: case B, the trajectory along the sine (B3)",
    "figure_8_sine_errors": "8: case B, errors of position and heading (B1, B2, B4)",
    "figure_9_wall_following": "9: case C, along the walls of the room with half of the turn rate "
    "lost (C1a, C1b, C1c)",
}
_TABLE = re.compile(r"\|  \| per (?:tick|call|step) \|.*\n\|.*\n((?:\|.*\n)+)")
_TIME = re.compile(r"([\d.,]+) (ns|µs|ms|s)\b")
_SECONDS = {"ns": 1e-9, "µs": 1e-6, "ms": 1e-3, "s": 1.0}


def with_bars(text: str) -> str:
    """A page with bars above each table of times, as long as the times of its first column."""
    return _TABLE.sub(lambda table: f"{_bars(table[1])}\n{table[0]}", text)


def _bars(rows: str) -> str:
    times = []
    for row in rows.splitlines():
        name, shown = (cell.strip() for cell in row.split("|")[1:3])
        found = _TIME.match(shown)
        if found is not None:
            seconds = float(found[1].replace(",", "")) * _SECONDS[found[2]]
            times.append((name, found[0], seconds))
    longest = max((seconds for _, _, seconds in times), default=0.0)
    lines = [
        f'<span>{html.escape(name)}</span><b style="--share:{seconds / longest:.4f}">{shown}</b>'
        for name, shown, seconds in times
    ]
    return "\n".join(["```{raw} html", '<div class="bars">', *lines, "</div>", "```", ""])


def plots(folder: Path) -> str:
    """A section with a picture of each kind of plot, from the shortest run that draws one."""
    parts = ["\n## How they look\n"]
    shortest = _shortest()
    for kind in PLOT_KINDS:
        if kind not in shortest:
            continue
        _, name, plot, title = shortest[kind]
        picture = of_run(f"runtime run {name}", slug(plot, "plot"), "")
        digest = _digest(runtime.load(name).to_dict(), picture.made)
        target = folder / f"plot-{kind}-{digest}.png"
        if not target.exists():
            picture.make(target)
        about = f"Plot of kind {kind}: {title}"
        parts.append(f"### {kind}\n\n![{about}](generated/{target.name})\n")
        parts.append(f"`runtime run {name}` draws it as `{plot}`.\n")
    return "\n".join(parts)


def _shortest() -> dict[str, tuple[float, str, str, str]]:
    """By kind of plot, the shipped graph with the shortest run: time, name, plot and its title."""
    found: dict[str, tuple[float, str, str, str]] = {}
    for group in RUNNABLE:
        for each in shipped(group):
            name = each.name if group == "graphs" else f"{group}/{each.name}"
            try:
                graph = runtime.load(name)
                seconds = python_seconds(graph.network)
            except runtime.MissingExtraError:
                continue
            for plot in graph.observation.all_plots:
                title = str(plot.options.get("title") or plot.name.replace("_", " "))
                if seconds < found.get(plot.kind, (LONGEST,))[0]:
                    found[plot.kind] = seconds, name, plot.name, title
    return found


def figures(folder: Path) -> str:
    """A section with our figure for each of the paper's, made by examples/paper_figures.py."""
    patterns = ("examples/paper_*", "graphs/*.yaml")
    sources = [path for pattern in patterns for path in sorted(ROOT.glob(pattern))]
    digest = _digest([path.read_text(encoding="utf-8") for path in sources])
    made = folder / f"paper-{digest}"
    if len(list(made.glob("*.svg"))) < len(FIGURES):
        command = [sys.executable, str(ROOT / "examples" / "paper_figures.py"), str(made), "svg"]
        done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
        if done.returncode:
            raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return "\n".join(["\n## The figures\n", *_figures(made.name)])


def _figures(folder: str) -> Iterator[str]:
    yield "Ours alone, with the seeds of the graphs; the claims are in the table below.\n"
    for name, about in FIGURES.items():
        yield f"![Figure {about}](generated/{folder}/{name}.svg)\n"
        yield f"*Figure {about}.*\n"


def _digest(*parts: object) -> str:
    return hashlib.sha256(repr(parts).encode()).hexdigest()[:12]
