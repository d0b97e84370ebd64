"""Faults that are known and not repaired yet, by a word for each, and what is not tried meanwhile.

An entry is taken out as soon as its fault is repaired; the fuzzers then reach what it kept them
away from. The page lists what is here.
"""

from __future__ import annotations

KNOWN: dict[str, str] = {}
