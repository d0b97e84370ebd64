"""Parts of messages: of names, what was probably meant or what there is; of held signals.

A wrong name and the known ones go in, the end of a sentence comes out::

    hint("neurns", ["neurons", "radius"])      # ", did you mean 'neurons'?"
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np
import numpy.typing as npt

from blocks.messages import Message, Replace

# Suggestions: the least similarity (0 to 1), the number of names that are compared in full, the
# length that is compared, and the number of classes in which letters are counted.
ALIKE, CANDIDATES, LONGEST, LETTERS = 0.6, 32, 100, 64


def alternatives(names: Iterable[str]) -> str:
    """The names that there are, for the end of a message without a :func:`hint`."""
    return f"; it has {', '.join(names) or 'none'}"


def hint(name: Any, known: Iterable[str], also: Mapping[str, str] | None = None) -> str:
    """``, did you mean 'neurons'?`` or nothing.

    ``also`` maps words that others use to one of the known names.
    """
    near = similar(name, known, also)
    return f", did you mean '{near}'?" if near else ""


def misspelt(
    kind: str,
    text: str,
    name: Any,
    known: Iterable[str],
    otherwise: str = "",
    also: Mapping[str, str] | None = None,
) -> Message:
    """A message about a name that does not exist: ``text`` and what was probably meant.

    ``otherwise`` ends the sentence where no name is similar; ``also`` as above.
    """
    near = similar(name, known, also)
    if not near:
        return Message(text + otherwise, kind)
    return Message(f"{text}, did you mean '{near}'?", kind, [Replace(near, str(name))])


def unknown_parameter(name: str, known: Iterable[str]) -> Message:
    """The message about a parameter that a block does not have."""
    known = list(known)
    otherwise = alternatives(known)
    return misspelt("unknown-parameter", "unknown parameter", name, known, otherwise)


def similar(name: Any, known: Iterable[str], also: Mapping[str, str] | None = None) -> str:
    """The known name that was probably meant; ``""`` if none is similar. ``also`` as above."""
    folded = {entry.lower(): entry for entry in known}
    written = str(name).lower()[:LONGEST]
    if (ours := (also or {}).get(written)) in folded:
        return str(ours)
    close = difflib.get_close_matches(written, _likely(written, tuple(folded)), n=1, cutoff=ALIKE)
    return folded[close[0]] if close else ""


def _likely(name: str, known: tuple[str, ...]) -> list[str]:
    """The names that share most letters with one; all of them if there are few.

    The number of shared letters bounds difflib's ratio, which is expensive to compute.
    """
    if len(known) <= CANDIDATES:
        return [entry for entry in known if len(entry) <= LONGEST]
    counts, lengths = _letters(known)
    shared = np.minimum(counts, _letter_counts((name,))).sum(axis=1)
    bounds = 2.0 * shared / np.maximum(1, lengths + len(name))
    first = np.argsort(-bounds, kind="stable")[:CANDIDATES]
    return [known[i] for i in first if bounds[i] >= ALIKE and lengths[i] <= LONGEST]


@lru_cache(8)
def _letters(known: tuple[str, ...]) -> tuple[npt.NDArray[np.int16], npt.NDArray[np.int64]]:
    """How often each letter occurs in each name, and how long the names are."""
    return _letter_counts(known), np.array([len(entry) for entry in known])


def _letter_counts(names: tuple[str, ...]) -> npt.NDArray[np.int16]:
    counts = np.zeros((len(names), LETTERS), dtype=np.int16)
    for row, name in zip(counts, names, strict=True):
        for letter in name[:LONGEST]:
            row[ord(letter) % LETTERS] += 1
    return counts


def rate_note(what: str, step: float, used: float, way_out: str) -> str:
    """The note for a signal that is held and counted as new."""
    times = step / used
    return (
        f"{what} is new every {step:g} s, and is used every {used:g} s: what is held counts as "
        f"{times:.3g} measurements; {way_out}"
    )
