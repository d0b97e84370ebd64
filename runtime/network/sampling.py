"""The step and the offset of a block: on which ticks it takes part.

In: ``dt`` and ``offset`` as a block writes them, in s. Out: both in base ticks (steps of
``run.dt``)::

    run: {dt: 0.001}      {type: PID, dt: 0.01, offset: 0.002}      every 10, from tick 2 on
"""

from __future__ import annotations

from blocks.core import Block
from blocks.messages import Message, Replace
from runtime.document import MAX_TICKS, Node, seconds
from runtime.errors import Problems
from runtime.network.network import Network


def sampling(
    node: Node, cls: type[Block], network: Network, address: str, problems: Problems
) -> tuple[int, int]:
    """How many base ticks lie between two ticks of a block, and how many before its first one."""
    every = _ticks(node.get("dt"), network, f"{address}.dt", problems)
    # Of a Sine and its like, the offset is that of the signal.
    offset = None if "offset" in cls.spec.params else node.get("offset")
    if offset is None or offset.value in (0, 0.0):
        return every, 0
    first = _ticks(offset, network, f"{address}.offset", problems)
    if not first < every:
        step = every * network.dt
        message = f"expected less than the block's dt = {step:g} {network.time_unit}"
        problems.add(offset.where, f"{address}.offset", f"{message}, got {offset.describe()}")
        return every, 0
    return every, first


def _ticks(node: Node | None, network: Network, address: str, problems: Problems) -> int:
    """A time in base ticks; 1 if there is none, or a wrong one."""
    value = None if node is None else seconds(node, address, problems)
    if node is None or value is None:
        return 1
    base, unit = network.dt, network.time_unit
    ratio = value / base
    # 0.3 / 0.1 is 2.9999999999999996: whole numbers up to rounding count.
    whole = round(ratio) if ratio < MAX_TICKS else 0
    if whole < 1 or abs(ratio - whole) > 1e-6:
        near = max(1, whole) * base
        message = f"{value:g} {unit} is not a multiple of run.dt = {base:g} {unit}; "
        message += f"the nearest is {near:g}"
        fixes = [Replace(f"{near:g}", title=f"Replace by {near:g}")]
        problems.add(node.where, address, Message(message, "invalid-value", fixes))
        return 1
    return whole
