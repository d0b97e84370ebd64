"""What an address in the file refers to: a block, an output with its type and rate, a state.

In: a scope and "pid.command". Out: an :class:`AddressTarget`: Scalar, 100 Hz, written in line 12.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from blocks.core import SignalType
from runtime.document import rate_text
from runtime.errors import Where
from runtime.language.model import Model
from runtime.network import AddressError, Endpoint, NetworkEntry, Scope, component_type, find


@dataclass(frozen=True)
class AddressTarget:
    """What an address refers to.

    end : the block and port in the whole graph. entry : the block. type : of the signal, if known.
    dt : the step of the block, in ``time_unit``. where : where the block is written.
    """

    end: Endpoint
    entry: NetworkEntry | None
    type: SignalType | None
    dt: float
    where: Where
    time_unit: str

    @property
    def rate(self) -> str:
        """How often the signal changes, in words."""
        return rate_text(self.dt, self.time_unit) if self.dt else ""


def target_of(model: Model, scope: Scope | None, text: str) -> AddressTarget | None:
    """What an address written in a scope refers to; None if that does not exist."""
    network = model.network
    if network is None or scope is None or not text:
        return None
    try:
        end = find(scope, text).end
    except AddressError:
        return None
    entry = network.entries.get(end.block) or network.removed_entries.get(end.block)
    if entry is None:
        return None
    kind = network.types.get((end.block, end.port))
    # A type is inferred from all wires. Where that failed, as in a graph with errors, the port's
    # declared type is better than none.
    if kind is None:
        declaration = entry.cls.spec.outputs.get(end.port)
        kind = (
            declaration.type if declaration and isinstance(declaration.type, SignalType) else None
        )
    if kind is not None and end.component:
        kind = component_type(kind, end)
    return AddressTarget(
        end, entry, kind, network.dt * entry.every, entry.node.key, network.time_unit
    )


def line_at(model: Model, where: Where) -> str:
    """The line of a position, of this text or of another file; '' if it cannot be read."""
    if not where.line:
        return ""
    if Path(where.file) == model.path:
        source: str | None = model.text.source
    else:
        source = model.surroundings.text(Path(where.file))
    lines = (source or "").splitlines()
    return lines[where.line - 1].strip() if where.line <= len(lines) else ""
