"""Titles of figures, with a subtitle that says what was run."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from runtime.document import Override
from runtime.plots.style import GREY, run_end

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from runtime.observation import RunData


def set_title(axes: Axes, title: str, result: RunData) -> None:
    """Write a plot's title, and the subtitle of the run."""
    write_title(axes, title, subtitle(result))


def write_title(axes: Axes, title: str, subtitle: str) -> None:
    """Write a title and a subtitle above an axes."""
    axes.set_title(title, pad=17.0)
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


def subtitle(result: RunData) -> str:
    """One line on the run: the graph, its changes, its seed, and where it ended if early."""
    removed: dict[str, str] = result.manifest.get("removed", {})
    overrides = [Override.parse(str(text)) for text in result.manifest.get("overrides", [])]
    parts = [result.title]
    for how, message in (("without", "without"), ("bypass", "bypassing")):
        names = [name for name, way in removed.items() if way == how]
        given = [override.target for override in overrides if override.kind == how]
        if names:
            parts.append(f"{message} {_listed(_grouped(names, given))}")
    parts += [_listed([f"{o.kind} {o.target}" for o in laid])] if (laid := _laid(overrides)) else []
    if "seed" in result.manifest:
        parts.append(f"seed {result.manifest['seed']}")
    status = result.manifest.get("status", "complete")
    if status != "complete":
        parts.append(f"{status} at {run_end(result):.4g} s")
    return "  ·  ".join(parts)


def _laid(overrides: Sequence[Override]) -> list[Override]:
    """The changes that lay a condition over the graph or put another block in a place."""
    named = [o for o in overrides if o.kind in ("with", "replace")]
    return [replace(o, target=_stem(o)) for o in named]


def _stem(change: Override) -> str:
    if change.kind == "replace":
        return f"{change.target}={change.value}"
    return re.sub(r"\.yaml$", "", change.target.rpartition("/")[2])


def _grouped(names: list[str], given: list[str]) -> list[str]:
    """Names of blocks as the user gave them: a part in place of the blocks inside it."""
    found: dict[str, None] = {}
    for name in names:
        whole = (part for part in given if name == part or name.startswith(f"{part}."))
        found[next(whole, name)] = None
    return list(found)


def _listed(names: list[str], most: int = 3) -> str:
    left = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + left
