"""A comparison as one JSON object."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from runtime.compare.comparison import Compared, Comparison
from runtime.compare.documents import ABSENT, Difference
from runtime.compare.probes import Pair

SCHEMA_VERSION = 1
FEW = 12  # columns of a probe that are listed one by one


def as_data(comparison: Comparison, exact: bool, rtol: float, atol: float) -> dict[str, Any]:
    """Everything that was found as plain values that JSON can hold.

    Numbers that JSON has not stand as YAML writes them: ".inf", "-.inf", ".nan".
    """
    labels = comparison.labels
    found = {
        "schema_version": SCHEMA_VERSION,
        "kind": "comparison",
        "runs": [
            {
                "label": run.label,
                "folder": str(run.folder),
                **{key: run.result.manifest[key] for key in ("graph", "seed", "status", "ticks")},
            }
            for run in comparison.runs
        ],
        "graph": [_difference(labels, item) for item in comparison.graph],
        "circumstances": [_difference(labels, item) for item in comparison.circumstances],
        "metrics": {
            name: dict(zip(labels, values, strict=True))
            for name, values in comparison.metrics.items()
        },
        "against": labels[0],
        "probes": {
            other.run.label: _exact(other) if exact else _tolerated(other, rtol, atol)
            for other in comparison.others
        },
    }
    plain: dict[str, Any] = _plain(found)
    return plain


def _difference(labels: Sequence[str], item: Difference) -> dict[str, Any]:
    """A difference; a run that does not have the path is left out of its values."""
    pairs = zip(labels, item.values, strict=True)
    values = {label: value for label, value in pairs if value is not ABSENT}
    return {"path": item.path, "change": item.change, "values": values}


def _exact(other: Compared) -> dict[str, Any]:
    places = [
        {
            "probe": pair.name,
            **asdict(place),
            "rows": len(pair.t),
            "rows_differing": pair.differing,
        }
        for pair, place in other.places
    ]
    return {
        "identical": other.is_same,
        "first": places[0] if places else None,
        "differences": places,
        **_recorded(other),
    }


def _tolerated(other: Compared, rtol: float, atol: float) -> dict[str, Any]:
    probes = []
    for pair in other.pairs:
        columns = pair.columns(rtol, atol)
        worst = max(columns, key=lambda column: column.largest, default=None)
        listed = columns if len(columns) <= FEW else [worst]
        probes.append(
            {
                "probe": pair.name,
                "rows": len(pair.t),
                "within": not pair.fault and not any(column.beyond for column in columns),
                "columns": [asdict(column) for column in listed if column is not None],
            }
        )
    return {"rtol": rtol, "atol": atol, "probes": probes, **_recorded(other)}


def _recorded(other: Compared) -> dict[str, Any]:
    """What the two did not record alike."""
    partial = [pair for pair in other.pairs if not pair.is_whole]
    return {"missing": other.missing, "recorded_otherwise": [_partial(p) for p in partial]}


def _partial(pair: Pair) -> dict[str, Any]:
    return {
        "probe": pair.name,
        "rows": list(pair.rows),
        "shared_rows": len(pair.t),
        "fault": pair.fault or None,
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else ".inf" if value > 0 else "-.inf"
    return value
