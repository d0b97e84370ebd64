"""What compiled runs of one program share: kernels, the plan's text, its function."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any
from weakref import WeakKeyDictionary

from blocks.core import BlockState
from runtime.engine.compiled import cache
from runtime.engine.compiled.emit import CompiledEmitter, CompiledText, fields_name
from runtime.engine.compiled.kernels import Kernels, make_kernels
from runtime.engine.program import Program


@dataclass(frozen=True)
class Template:
    """A program's compiled text.

    ``owners`` says for each of the text's arguments that is a block's fields which block it is.
    """

    kernels: Kernels
    text: CompiledText
    function: Callable[..., tuple[Any, ...]]
    owners: dict[str, str]


# The text that compiled runs of a program took last; it may not fit the next seed.
_latest: WeakKeyDictionary[Program, Template] = WeakKeyDictionary()


def template(
    program: Program, states: Mapping[str, BlockState], note: Callable[[str], None]
) -> Template:
    """The template of a program: the one it has, if it fits these states, or another one.

    Parameters
    ----------
    states : after ``start``.
    note : called with a line of text when something is compiled, and so takes a while.
    """
    known = _latest.get(program)
    entries = program.network.entries
    if known is not None and all(
        kernel.fits(entries[name].made, states[name])
        for name, kernel in known.kernels.compiled.items()
    ):
        return known
    kernels = make_kernels(program.network, states, note)
    for name in sorted(kernels.broken):
        note(f"block '{name}' is called from Python: {kernels.refused[name]}")
    emitter = CompiledEmitter(program.plan, list(program.recordings), kernels.compiled)
    text = emitter.compiled()
    owners = {fields_name(program.plan, name): name for name in kernels.compiled}
    made = Template(kernels, text, cache.module("plan", text.text).run, owners)
    _latest[program] = made
    return made
