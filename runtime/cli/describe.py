"""Writes the generated pages and graphs/schema.json: ``python -m runtime.cli.describe``."""

from __future__ import annotations

import json
import re
from collections.abc import Container, Mapping
from pathlib import Path

from blocks.registry import BUILTIN
from runtime.cli.shipped import shipped
from runtime.descriptions import describe_markdown, option_text
from runtime.document import SHIPPED
from runtime.language import json_schema
from runtime.observation import (
    METRIC_KINDS,
    PLOT_KINDS,
    Figure,
    MetricKind,
    MetricOptions,
    PlotKind,
)

HEADER = """# Blocks

<!-- Made from the blocks' own declarations by `python -m runtime.cli.describe`; do not edit. -->

Every block also takes `dt` (s), its step: a whole multiple of `run.dt`, which is the default.
"""

OBSERVING = """# Plots and metrics

<!-- Made from their own declarations by `python -m runtime.cli.describe`; do not edit. -->

`of` names probes or addresses. Angles may be written in degrees, as in `90deg`.
"""

EVERY_PLOT = """A graph without the section `plots` draws each probe that changes: a `trajectory` of
a pose, a `raster` of spikes, a `heatmap` of many columns, and a `timeseries` of others.
`plots: {}` draws nothing. Every plot takes, besides its own options:
"""
COMMON_DOC = {
    "title": "`title` (a text): default: the name of the plot",
    "labels": "`labels` (texts): names of the lines, in their order",
}

GALLERY = """# Gallery

<!-- Made from the graphs' own first sentences by `python -m runtime.cli.describe`; do not edit. -->

Each is a file in `graphs/gallery/`; run one, or draw it:

    runtime run gallery/van_der_pol
    runtime draw gallery/drive_to_point
"""


PUBLISHED = """
## Published examples

Examples of other packages in our blocks, with their parameters. Those of `gallery/published` are
there for this alone; tests compare many with scipy's solution or a closed form, and run all.
"""


def gallery_page() -> str:
    """The text of docs/gallery.md."""
    lines = [GALLERY, "| graph | what it shows | blocks |", "|---|---|---|"]
    for each in shipped("gallery"):
        kinds = _types(each.path.read_text(encoding="utf-8"))
        lines.append(f"| `{each.name}` | {each.summary} | {kinds} |")
    lines += [PUBLISHED, "| example | of | graph | blocks |", "|---|---|---|---|"]
    found: list[str] = []
    for each in (*shipped("gallery"), *shipped("gallery/published")):
        text = each.path.read_text(encoding="utf-8")
        after = re.search(r"^# After (\S+\.py) of (\w+)", text, re.MULTILINE)
        if after is not None:
            name = f"{each.group}/{each.name}"
            found.append(f"| {after[1]} | {after[2]} | `{name}` | {_types(text)} |")
    return "\n".join([*lines, *sorted(found)]) + "\n"


def _types(text: str) -> str:
    """The types of the blocks of a graph."""
    return ", ".join(sorted(set(re.findall(r"type: (\w+)", text))))


def blocks_page() -> str:
    """The text of docs/blocks.md."""
    pages = [describe_markdown(cls) for cls in BUILTIN.values()]
    return HEADER + "\n" + "\n".join(pages).rstrip() + "\n"


def observing_page() -> str:
    """The text of docs/observing.md."""
    figure = {**COMMON_DOC, **{k: option_text(k, d) for k, d in Figure.declared.items()}}
    lines = [OBSERVING, "## Plots", "", EVERY_PLOT]
    lines += [f"* {text}" for text in figure.values()]
    lines += ["", *_kinds_table(PLOT_KINDS, "plot", hidden=figure)]
    common = list(MetricOptions.declared.items())
    lines += ["", "## Metrics", "", "Every metric takes, besides its own options:", ""]
    lines += [f"* {option_text(name, declared)}" for name, declared in common]
    lines += ["", *_kinds_table(METRIC_KINDS, "metric", hidden=dict(common))]
    return "\n".join(lines) + "\n"


def _kinds_table(
    kinds: Mapping[str, PlotKind | MetricKind], noun: str, hidden: Container[str] = ()
) -> list[str]:
    rows = [f"| {noun} | is | options |", "|---|---|---|"]
    for name, kind in kinds.items():
        own = [
            option_text(key, declared)
            for key, declared in kind.options.declared.items()
            if key not in hidden
        ]
        own += [f"`{key}` (a probe or an address)" for key in getattr(kind, "signals", ())]
        cells = (f"`{name}`", kind.doc, "; ".join(own))
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return rows


def schema_file() -> str:
    """The text of graphs/schema.json."""
    return json.dumps(json_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    docs = Path(__file__).parents[2] / "docs"
    (SHIPPED / "schema.json").write_text(schema_file(), encoding="utf-8")
    (docs / "blocks.md").write_text(blocks_page(), encoding="utf-8")
    (docs / "observing.md").write_text(observing_page(), encoding="utf-8")
    (docs / "gallery.md").write_text(gallery_page(), encoding="utf-8")
