"""Parts that all reports share: numbers, figures, diagrams, graphs, provenance."""

from __future__ import annotations

import math
import re
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.files import read_text
from runtime.diagrams import TOO_LARGE, draw, read_picture, to_svg
from runtime.files import slug
from runtime.reports.svg import diagram_svg, figure_svg
from runtime.runs import RESOLVED
from runtime.tables import Html, Table, element, facts, join, scrolling
from runtime.terminal import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SCALE = 1.25  # pixels of a figure for each point: type of 9 points has 11 pixels
LEGIBLE = 0.62  # of a diagram's natural width: narrower, its text is too small to read
WIDE = 800.0  # pixels: a wider diagram extends beyond the column of text
BROAD = 1200.0  # pixels: a wider diagram is printed on its own page in landscape
LONGEST_GRAPH = 1_000_000  # characters that are shown: a page holds each several times


# From 1e-9 to 1e9: what each stands for.
PREFIXES = {-9: "n", -6: "µ", -3: "m", 3: "k", 6: "M", 9: "G"}
WITH_PREFIX = frozenset({"m", "s", "A", "V", "W", "N", "J", "Hz", "Pa", "F"})


def quantity(value: float, unit: str) -> str:
    """A number with its unit, which gets a prefix where that is shorter: 5.885 mm, 12.97 s."""
    power = math.floor(math.log10(abs(value)) / 3) * 3 if value and math.isfinite(value) else 0
    if unit in WITH_PREFIX and power in PREFIXES and not 0.1 <= abs(value) < 1e4:
        value, unit = value / 10.0**power, PREFIXES[power] + unit
    return f"{number(value).replace('-', '−')} {unit}".rstrip()


def plot(figure: Figure, name: str, caption: str, *, wide: bool = False) -> Html:
    """A figure with its caption; a wide one takes the full width of the page."""
    # All figures have the same scale, so that type has one size; a narrow screen shrinks them.
    width = SCALE * 72.0 * float(figure.get_figwidth())
    svg = figure_svg(figure, name, caption)
    drawing = Html(svg.replace('style="', f'style="width: {width:.0f}px; ', 1))
    frame = scrolling(drawing, caption, "plot full" if wide else "plot")
    return element("figure", frame, element("figcaption", caption), id=name)


def diagram_file(file: Path, name: str, label: str) -> Html:
    """A block diagram, drawn from its data in a folder; a note if there is none.

    The graph is not built, which would import its modules, and no drawing is embedded as it is.
    """
    try:
        drawing = to_svg(draw(read_picture(read_text(file))))
    except FileNotFoundError:
        message = f"This folder has no diagram: it is from an earlier version, or {TOO_LARGE}. "
        again = element("code", f"runtime draw {file.parent / RESOLVED}")
        more = " draws it, and imports the Python files that the graph names."
        return element("p", message, again, more, class_="soft")
    except (OSError, ValueError) as error:
        return element("p", f"The diagram cannot be read: {error}", class_="soft")
    return diagram_frame(drawing, name, label)


def diagram_frame(drawing: str, name: str, label: str) -> Html:
    """A diagram's SVG, scaled to the page as far as its text stays legible."""
    svg = diagram_svg(drawing, slug(name, "diagram"), label)
    box = re.search(r'viewBox="0 0 ([\d.]+) ', svg)
    width = float(box.group(1)) if box else 0.0
    how = f"min-width: {LEGIBLE * width:.0f}px; max-width: {width:.0f}px"
    styled = Html(svg.replace("<svg ", f'<svg style="{how}" ', 1))
    kind = "diagram" + " wide" * (width > WIDE) + " broad" * (width > BROAD)
    return scrolling(styled, label, kind)


def graph_file(file: Path, message: str) -> Html:
    """The text of a resolved graph, with the command that runs it."""
    try:
        text = read_text(file)
    except (OSError, ValueError) as error:
        return element("p", f"The graph cannot be read: {error}", class_="soft")
    return graph_text(text, file, message, " runs it.")


def graph_text(text: str, file: Path, message: str, purpose: str) -> Html:
    """The text of a graph, with the command that runs it and what for."""
    again = element("code", f"runtime run {file}")
    whole = "" if len(text) <= LONGEST_GRAPH else f" Its first {LONGEST_GRAPH:,} characters:"
    first = element("p", message, " ", again, purpose, whole, class_="soft")
    shown = element("pre", element("code", text[:LONGEST_GRAPH].rstrip()))
    return join(first, scrolling(shown, "resolved graph", "source"))


def command(argv: Any) -> Html:
    """A command line, quoted for a shell."""
    words = [str(word) for word in argv] if isinstance(argv, list) else []
    return element("code", shlex.join([Path(words[0]).name, *words[1:]])) if words else Html("")


def versions(packages: Any) -> Html:
    """Names and versions of packages."""
    known = packages if isinstance(packages, Mapping) else {}
    rows = [[str(name), str(version)] for name, version in known.items()]
    return Table.of(["package", "version"], rows).html("versions")


def moment(stamp: str) -> str:
    """The date and the time of day of an ISO time."""
    return stamp[:16].replace("T", " ")


def plan_provenance(folder: Path, plan: Mapping[str, Any]) -> Html:
    """The provenance of a sweep's or an ablation's results."""
    entry = plan.get("provenance")
    origin = entry if isinstance(entry, Mapping) else {}
    changes = origin.get("changes")
    more = [
        ("seeds", str(plan.get("seeds", ""))),
        ("changes", "; ".join(map(str, changes)) if isinstance(changes, list) else ""),
        ("sampling", _sampling(plan)),
        ("digest", str(plan.get("digest", ""))),
        ("folder", str(folder.resolve())),
    ]
    return provenance(origin, more)


def _sampling(plan: Mapping[str, Any]) -> str:
    """How the configurations of a sweep were chosen."""
    for method in ("random", "sobol"):
        if method in plan:
            return f"{plan[method]} configurations, {method}, seed {plan.get('sampling_seed', 0)}"
    return "all combinations" if plan.get("kind") == "sweep" else ""


def provenance(origin: Mapping[str, Any], more: Sequence[tuple[str, str]]) -> Html:
    """The provenance of results: command, source, commit, time, further facts, versions."""
    pairs = [
        ("command", command(origin.get("argv"))),
        ("source", str(origin.get("source") or "built in Python")),
        ("git commit", str(origin.get("git") or "none")),
        ("started", str(origin.get("started", ""))),
        *more,
    ]
    listed = facts([(name, value) for name, value in pairs if value], "list")
    return join(listed, element("h3", "Versions"), versions(origin.get("versions")))
