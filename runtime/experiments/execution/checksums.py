"""Checksums of the entries of a file, so that a report names what was changed after it was written.

In: a mapping that is going to be written, or was read. Out: the mapping with the CRC-32 of each of
its entries, or the entry that does not fit::

    {"seeds": "0..9"}  ->  {"seeds": "0..9", "checks": {"seeds": "6ee52d48"}}
    the same with "0..8"  ->  its entry 'seeds' was changed after it was written

One checksum of the whole file would be smaller, but could not say where to look. They are no
protection against someone who computes them again.
"""

from __future__ import annotations

import json
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from runtime.files import json_text, write_json

CHECKS = "checks"


def with_checks(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Entries with their checksums; a tuple counts as the list that a reader gets."""
    return {**entries, CHECKS: {key: _checksum(value) for key, value in entries.items()}}


def write_checked(path: Path, entries: Mapping[str, Any]) -> None:
    """Write a JSON file with checksums.

    Raises
    ------
    UsageError : it cannot be written.
    """
    write_json(path, with_checks(json.loads(json_text(entries))))  # it has null for infinity


def check_entries(entries: Mapping[str, Any]) -> None:
    """Check that entries are those that were written.

    Raises
    ------
    ValueError : an entry was changed, added or removed; the message names it.
    """
    known = entries.get(CHECKS)
    if not isinstance(known, Mapping):
        raise ValueError(f"its entry '{CHECKS}' is missing, or no mapping")
    for key in dict.fromkeys([*known, *(key for key in entries if key != CHECKS)]):
        if key not in entries:
            raise ValueError(f"its entry '{key}' is missing")
        if known.get(key) != _checksum(entries[key]):
            raise ValueError(f"its entry '{key}' was changed after it was written")


def _checksum(value: Any) -> str:
    # Of values, not of their text: a reader may write the file with other spaces or quotes.
    text = json.dumps(value, sort_keys=True, default=str)
    return f"{zlib.crc32(text.encode('utf-8', 'surrogatepass')):08x}"
