"""Faults that are known and not repaired yet, by a word for each, and what is not tried meanwhile.

An entry is taken out as soon as its fault is repaired; the fuzzers then reach what it kept them
away from. The page lists what is here.
"""

from __future__ import annotations

KNOWN: dict[str, str] = {
    "control characters": "that names and texts reach the terminal without control characters",
    "infinity": "that no metric puts Infinity into the output of --json",
    "names": "command lines with names that are too long or not UTF-8",
    "links": "links inside of a folder that is read",
    "kernels": "subclasses that override a method that has a form in loops",
    "caches": "damages of a compile cache other than missing files",
}
