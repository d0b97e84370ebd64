"""Sections of our docstrings as the field lists that Sphinx shows as tables."""

from __future__ import annotations

import re
from collections.abc import Iterator

FIELDS = {"Parameters": "param", "Raises": "raises", "Returns": "returns", "Yields": "yields"}
_ENTRY = re.compile(r"([A-Za-z_][\w.*]*(?:, [A-Za-z_][\w.*]*)*) : (.+)")


def with_fields(lines: list[str]) -> Iterator[str]:
    """The lines of a docstring, its sections as fields.

    An entry is ``name : text`` or ``name, other : text``, with further lines indented; in Returns
    and Yields it may be a text alone. A line that is none of these ends the section.
    """
    kind = ""
    i = 0
    while i < len(lines):
        line = lines[i]
        below = lines[i + 1] if i + 1 < len(lines) else ""
        if line in FIELDS and below and not below.strip("-"):
            kind = FIELDS[line]
            yield ""
            i += 2
            continue
        entry = _ENTRY.fullmatch(line) if kind else None
        if entry is not None and kind == "param":
            more = _continued(lines, i)
            for name in entry[1].split(", "):
                yield f":param {name}: {' '.join([entry[2], *more])}"
            i += 1 + len(more)
            continue
        if entry is not None:
            yield f":{kind} {entry[1]}: {entry[2]}"
        elif kind in ("returns", "yields") and line.strip() and not line.startswith(" "):
            more = _continued(lines, i)
            yield f":{kind}: {' '.join([line, *more])}"
            i += 1 + len(more)
            continue
        else:
            if kind and line.strip() and not line.startswith(" "):
                kind = ""
                yield ""
            yield line
        i += 1


def _continued(lines: list[str], i: int) -> list[str]:
    """The indented lines after a line, without their indentation."""
    found = []
    for line in lines[i + 1 :]:
        if not line.startswith(" "):
            break
        found.append(line.strip())
    return found
