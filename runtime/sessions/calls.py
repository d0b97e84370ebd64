"""Calls of a session: one at a time, and none that an interrupt leaves half done without a word.

In: a method. Out: the same method, refused while another call is inside::

    session.step(100)       in one thread
    session.read("x")       in another one, meanwhile: UsageError
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from functools import wraps
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

import numpy as np

from blocks.core import Block, BlockContext, ParameterError
from runtime.errors import NotCopiedError, SimulationError, UsageError

_P = ParamSpec("_P")
_T = TypeVar("_T")
# What an interrupt can leave half done; a run says itself whether it was within a tick.
CHANGING = ("write", "set", "wire", "without", "bypass", "replace", "overlay", "become", "restore")


class Exclusive(Protocol):
    """What has calls that are inside one at a time; ``_inside`` is held by that one."""

    _inside: threading.Lock
    _failed: SimulationError | None

    def _tear(self, block: str = "") -> None:
        """Let every call say that an interrupt left the state half changed."""


_E = TypeVar("_E", bound=Exclusive)


def alone(
    method: Callable[Concatenate[_E, _P], _T],
) -> Callable[Concatenate[_E, _P], _T]:
    """A method that is refused while another call is inside.

    An interrupt leaves a session that a method was changing failed.
    """

    @wraps(method)
    def call(session: _E, /, *given: _P.args, **named: _P.kwargs) -> _T:
        if not session._inside.acquire(blocking=False):
            raise UsageError(
                f"{method.__name__}: another call of this session has not returned; call it from "
                "one thread at a time, and from no block"
            )
        try:
            return method(session, *given, **named)
        except KeyboardInterrupt:
            if method.__name__ in CHANGING and session._failed is None:
                session._tear()
            raise
        finally:
            session._inside.release()

    return call


def plain(value: Any) -> Any:
    """A copy of an argument as YAML has it: numbers of Python, lists and mappings."""
    if type(value) is float:
        return value
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def is_numeric(value: Any) -> bool:
    """Whether a value is a number or an array, and no text that is read first, such as 30deg."""
    try:
        return np.asarray(value).dtype.kind in "bif"
    except ValueError:  # lists of different lengths
        return False


def copied(call: Callable[[], _T]) -> _T:
    """What a call returns that copies memory of blocks."""
    try:
        return call()
    except NotCopiedError as error:
        raise UsageError(str(error)) from None


def block_with(block: Block, parameter: str, value: Any, context: BlockContext) -> Block | None:
    """A block with another value of a parameter; None if it is not allowed there."""
    try:
        made = type(block)(**{**block.parameters(), parameter: value})
        made.validate_in(context)
    except ParameterError:
        return None
    return made
