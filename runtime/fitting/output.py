"""A fit as a table and as JSON.

In: a :class:`Fit`. Out: what is printed, and ``fit.json``::

    arm.damping  0.3001  [0.2987, 0.3015]  of 0..1
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from runtime.files import own_folder, system_errors, write_whole
from runtime.fitting.solving import CONFIDENCE, Fit
from runtime.tables import Cell, Table, interval_cell, number_cell

STORED = "fit.json"


def summary(fit: Fit) -> str:
    """The numbers with their intervals, how well each signal is met, and notes."""
    rows = []
    for each, span in zip(fit.parameters, fit.model.ranges, strict=True):
        interval = interval_cell(each.low, each.high)
        if not math.isfinite(each.high - each.low):
            interval = Cell("not determined")
        rows.append([each.path, Cell(f"{each.value:.6g}", each.value), interval, span.written])
    head = ["number", "value", f"{CONFIDENCE:.0%} interval", "range"]
    parts = [Table.of(head, rows, numbers=[1]).text()]
    rows = []
    for series, rms in zip(fit.model.series, fit.rms, strict=True):
        spread = float(series.values.std())
        share = f"{rms / spread:.3g}" if spread else "-"
        rows.append([series.name, len(series.t), number_cell(rms, unit=series.unit), share])
    head = ["signal", "values", "rms of the difference", "of the data's deviation"]
    parts.append(Table.of(head, rows, numbers=[1, 3]).text())
    reached = sum(cost <= min(fit.starts) * 1.01 + 1e-20 for cost in fit.starts)
    parts.append(
        f"{fit.model.count} runs; {reached} of {len(fit.starts)} starts reached this minimum\n"
    )
    parts += [f"note: {note}\n" for note in fit.notes]
    changes = " ".join(f"--set {each.path}={each.value:.9g}" for each in fit.parameters)
    parts.append(f"the graph with these numbers: {changes}")
    return "\n".join(part.rstrip("\n") for part in parts) + "\n"


def as_plain(fit: Fit) -> dict[str, Any]:
    """The fit as plain values; an interval that the data do not determine is null."""
    return {
        "kind": "fit",
        "parameters": [
            {
                "path": each.path,
                "value": each.value,
                "low": each.low if math.isfinite(each.low) else None,
                "high": each.high if math.isfinite(each.high) else None,
                "range": span.written,
                "at_end": each.at_end,
            }
            for each, span in zip(fit.parameters, fit.model.ranges, strict=True)
        ],
        "confidence": CONFIDENCE,
        "signals": [
            {
                "run": series.run,
                "signal": series.address,
                "values": len(series.t),
                "rms": rms,
                "unit": series.unit,
            }
            for series, rms in zip(fit.model.series, fit.rms, strict=True)
        ],
        "runs": fit.model.count,
        "costs": list(fit.starts),
        "effective_values": fit.effective,
        "notes": list(fit.notes),
    }


def save_fit(fit: Fit, folder: Path) -> dict[str, Any]:
    """Write ``fit.json``; returns what is stored.

    Raises
    ------
    UsageError : they cannot be written.
    """
    stored = {**as_plain(fit), "folder": str(folder)}
    with system_errors(f"write '{folder}'"):
        write_whole(own_folder(folder) / STORED, json.dumps(stored, indent=2) + "\n")
    return stored
