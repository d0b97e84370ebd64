"""What code of others raised, in words: a user's file or class, or an installed package.

In: an exception, of any class. Out: one text with the place in the user's code::

    try:
        ...
    except BaseException as error:
        message = raised_text(error)     # "SystemExit: 3 (own.py:12)"; Ctrl-C goes on as it is
"""

from __future__ import annotations

import os
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
LONGEST = 2000  # characters


def raised_text(error: BaseException, with_place: bool = True) -> str:
    """The class and text of an exception, and where it was raised.

    Raises
    ------
    KeyboardInterrupt : it is one: the user's, and nothing that code of others says.
    """
    if isinstance(error, KeyboardInterrupt):
        raise error
    text = text_of(error) + _suggestion(error)
    place = raised_at(error) if with_place else ""
    return f"{type(error).__name__}{f': {text}' if text else ''}{f' ({place})' if place else ''}"


def text_of(error: BaseException) -> str:
    """``str(error)``, which an own class may have made to raise anything."""
    try:
        return str(error)[:LONGEST]
    except KeyboardInterrupt:
        raise
    except BaseException:  # noqa: BLE001 -- a class of others may raise anything
        return "its text cannot be had, since __str__ fails"


def _suggestion(error: BaseException) -> str:
    """The attribute that a misspelt one of an object is close to: ", did you mean 'tau'?"."""
    if not isinstance(error, AttributeError) or error.name is None:
        return ""
    from difflib import get_close_matches

    try:
        known = [name for name in dir(error.obj) if not name.startswith("_")]
    except Exception:  # noqa: BLE001 -- __dir__ of a class of others may raise anything
        return ""
    near = get_close_matches(error.name, known, 1)
    return f", did you mean '{near[0]}'?" if near else ""


def raised_at(error: BaseException) -> str:
    """``file.py:12``, where an exception was raised: in the user's own code if it passed there.

    An error that our code raises, because of what a user's block did, is then blamed on the line
    that did it. '' if the exception passed through no file.
    """
    if (place := getattr(error, "raised_at", None)) is not None:
        return str(place)  # in another process
    from sysconfig import get_paths
    from traceback import extract_tb

    # '<plan>' and '<string>' are generated text: no file that a user could open.
    frames = [f for f in extract_tb(error.__traceback__) if not f.filename.startswith("<")]
    ours = tuple(f"{ROOT / package}{os.sep}" for package in ("blocks", "runtime"))
    others = (*ours, *(f"{get_paths()[key]}{os.sep}" for key in ("stdlib", "purelib", "platlib")))
    own = [f for f in frames if not f.filename.startswith(others)]
    # In this order: the user's own file, a package that it calls, this project (whose bug it then
    # is).
    own = own or [f for f in frames if not f.filename.startswith(ours)] or frames
    if not own:
        return ""
    path = Path(own[-1].filename)
    path = path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
    return f"{path}:{own[-1].lineno}"
