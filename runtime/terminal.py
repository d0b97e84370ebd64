"""The one door to the terminal: every line that a verb prints goes through here.

Names, texts and exceptions can come from files that somebody else wrote. What would move the
cursor, change colours or reorder letters is shown as an escape, never carried out.
"""

from __future__ import annotations

import sys
from typing import Any, TextIO

from runtime.files import json_text


def printable(text: str) -> str:
    r"""A text in which only line feeds and printable characters are left.

    Control characters (C0, DEL, C1), bidirectional overrides, the line separators U+0085, U+2028
    and U+2029, and lone surrogates become escapes such as ``\x1b``.
    """
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c == "\n" else repr(c)[1:-1] for c in text)


def show(text: object = "") -> None:
    """Print a result on stdout."""
    _write(sys.stdout, f"{printable(str(text))}\n")


def tell(text: object) -> None:
    """Print a note or an error on stderr."""
    _write(sys.stderr, f"{printable(str(text))}\n")


def draw(text: str) -> None:
    """Write a text with its own cursor movements on stderr; what is foreign in it is escaped."""
    _write(sys.stderr, text)
    sys.stderr.flush()


def show_json(value: Any) -> None:
    """Print one JSON object in ASCII on stdout."""
    # json leaves DEL as it is.
    text = json_text(value).replace("\x7f", "\\u007f")
    _write(sys.stdout, f"{text}\n")


def _write(stream: TextIO, text: str) -> None:
    """Write a text; characters that the stream's encoding lacks become escapes."""
    encoding = getattr(stream, "encoding", None) or "utf-8"
    stream.write(text.encode(encoding, "backslashreplace").decode(encoding))
