"""When a probe has a row: ``every`` as it is written.

In: a number of base ticks, or ``{period: 500, offset: 499, mean: true}``. Out: the ticks between
two rows, 0 for the signal's own rate; the tick of the first row, None for that of the signal;
whether a row is a mean::

    sampling(node, "probes.x.every", problems)      # (500, 499, True)
"""

from __future__ import annotations

from runtime.document import Node, check_keys
from runtime.errors import Problems

EVERY_KEYS = ("period", "offset", "mean")


def sampling(node: Node | None, address: str, problems: Problems) -> tuple[int, int | None, bool]:
    """The period, the offset and whether a row is a mean; what is wrong is in ``problems``."""
    if node is None:
        return 0, None, False
    if not node.is_map:
        return _whole(node, address, 1, problems), None, False
    check_keys(node, EVERY_KEYS, address, problems, "key")
    period, offset, mean = map(node.get, EVERY_KEYS)
    if period is None:
        problems.add(node.where, address, "missing 'period', in base ticks")
        return 0, None, False
    if mean is not None and not isinstance(mean.value, bool):
        message = f"expected true or false, got {mean.describe()}"
        problems.add(mean.where, f"{address}.mean", message)
    every = _whole(period, f"{address}.period", 1, problems)
    is_mean = mean is not None and mean.value is True
    if offset is None:
        return every, max(every - 1, 0) if is_mean else None, is_mean
    first = _whole(offset, f"{address}.offset", 0, problems)
    if is_mean and first >= every > 0:
        # Its first row would leave out what is before the period that ends with it.
        message = f"expected less than the period of {every} ticks, got {first}"
        problems.add(offset.where, f"{address}.offset", message)
    return every, first, is_mean


def _whole(node: Node, address: str, least: int, problems: Problems) -> int:
    """A number of base ticks; 0 if it is none."""
    if not isinstance(node.value, int) or isinstance(node.value, bool) or node.value < least:
        message = f"expected a number of base ticks, {least} or more, got {node.describe()}"
        problems.add(node.where, address, message)
        return 0
    return node.value
