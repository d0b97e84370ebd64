"""Titles of figures, with a subtitle that says what was run.

In: a run. Out: a title, and below it the graph, its changes and its seed, as in
"line_actuator_failure  ·  without snn_v  ·  seed 7".
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from runtime.document import Override
from runtime.plots.style import GREY, LETTER, run_end

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.text import Text

    from runtime.observation import RunData


TITLE_HEIGHT = 17.0  # points above an axes
LEFT_OF_AXES = 0.9  # inches, for the vertical axis' numbers and label


def set_title(axes: Axes, title: str, result: RunData) -> None:
    """Write a plot's title, and the subtitle of the run."""
    write_title(axes, title, subtitle(result))


def write_title(axes: Axes, title: str, subtitle: str) -> Text:
    """Write a title and a subtitle above an axes, and return the title."""
    text = axes.set_title(title, loc="left", pad=TITLE_HEIGHT)  # of three axes it is in the middle
    axes.annotate(
        subtitle,
        xy=(0.0, 1.0),
        xytext=(0.0, 6.0),
        xycoords="axes fraction",
        textcoords="offset points",
        fontsize=8.0,
        color=GREY,
        gid="subtitle",
    )
    return text


def separate_notes(figure: Figure) -> None:
    """Raise a note beside a subtitle to the height of the title, if the two may overlap.

    Widths are estimated, since measuring them would lay the figure out twice.
    """
    room = 72.0 * (float(figure.get_size_inches()[0]) - LEFT_OF_AXES)
    for axes in figure.axes:
        texts = [text for text in axes.texts if text.get_gid() and text.get_visible()]
        width = sum(LETTER * float(text.get_fontsize()) * len(text.get_text()) for text in texts)
        for note in texts if width > room and len(texts) > 1 else ():
            if note.get_gid() == "note":
                note.set_position((0.0, TITLE_HEIGHT))


def subtitle(result: RunData) -> str:
    """One line on the run: what :func:`facts` lists."""
    return "  ·  ".join(facts(result))


def facts(result: RunData) -> list[str]:
    """What was run: the graph, its changes, its seed, and where it ended if early."""
    removed: dict[str, str] = result.manifest.get("removed", {})
    overrides = [Override.parse(str(text)) for text in result.manifest.get("overrides", [])]
    parts = [result.title]
    for how, message in (("without", "without"), ("bypass", "bypassing")):
        names = [name for name, way in removed.items() if way == how]
        targets = [override.target for override in overrides if override.kind == how]
        if names:
            parts.append(f"{message} {_join_names(_by_part(names, targets))}")
    if conditions := _conditions(overrides):
        parts.append(_join_names([f"{o.kind} {o.target}" for o in conditions]))
    if "seed" in result.manifest:
        parts.append(f"seed {result.manifest['seed']}")
    status = result.manifest.get("status", "complete")
    if status != "complete":
        parts.append(f"{status} at {run_end(result):.4g} {result.time_unit}")
    return parts


def _conditions(overrides: Sequence[Override]) -> list[Override]:
    """The changes that lay a condition over the graph or put another block in a place."""
    changes = [o for o in overrides if o.kind in ("with", "replace")]
    return [replace(o, target=_stem(o)) for o in changes]


def _stem(change: Override) -> str:
    if change.kind == "replace":
        return f"{change.target}={change.value}"
    return re.sub(r"\.yaml$", "", change.target.rpartition("/")[2])


def _by_part(names: list[str], targets: list[str]) -> list[str]:
    """Names of blocks as the user gave them: a part in place of the blocks inside it."""
    groups: dict[str, None] = {}
    for name in names:
        # --without arm removes arm.pid, arm.plant, ...: the subtitle says "without arm".
        whole = (part for part in targets if name == part or name.startswith(f"{part}."))
        groups[next(whole, name)] = None
    return list(groups)


def _join_names(names: list[str], most: int = 3) -> str:
    rest = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + rest
