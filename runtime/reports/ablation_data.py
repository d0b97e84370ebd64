"""An ablation read back from its folder, checked so far that it can be reported on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from runtime.errors import UsageError
from runtime.experiments.analysis.ablation_plots import read_facts
from runtime.experiments.execution import INDEX, TABLE, Columns, read_rows
from runtime.reports.schema import MAYBE_NUMBER, check

_ESTIMATE = {"n": int, "mean": MAYBE_NUMBER, "low": MAYBE_NUMBER, "high": MAYBE_NUMBER}
_DIFFERENCE = {
    **_ESTIMATE,
    "p": MAYBE_NUMBER,
    "p_adjusted": MAYBE_NUMBER,
    "p_presence": MAYBE_NUMBER,
    "distinguishable": (bool, type(None)),
}
_LINE = {
    **_ESTIMATE,
    **{"variant": str, "metric": str, "runs": int, "recorded": bool},
    "difference": (dict, type(None)),
}
_VARIANT = {
    **{"name": str, "slug": str, "changes": [str], "notes": [str], "runs": int, "failed": int},
    "reasons": [{"reason": str, "count": int}],
}
_FACTS = {
    **{"experiment": str, "graph": str, "test": str, "correction": str, "essential": dict},
    **{"seeds": [int], "metrics": [str], "variants": [_VARIANT], "table": [_LINE]},
}


def read_ablation(folder: Path) -> dict[str, Any]:
    """What ``ablation.json`` holds.

    Raises
    ------
    UsageError : the ablation did not come to its end, or its files are damaged.
    """
    path = folder / TABLE
    if not path.is_file():
        message = (
            "it was interrupted, or is still running; 'runtime ablate --resume' goes on with it"
        )
        raise UsageError(f"'{folder}' holds an ablation without results: {message}")
    facts = read_facts(folder)
    try:
        check(facts, _FACTS)
        for i, line in enumerate(facts["table"]):
            if line["difference"] is not None:
                check(line["difference"], _DIFFERENCE, f"table[{i}].difference")
        _check_whole(facts)
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    _check_index(folder, facts)
    return facts


def _check_whole(facts: dict[str, Any]) -> None:
    """The table has a line for each metric and variant, and variants name files of their own."""
    names = [variant["name"] for variant in facts["variants"]]
    expected = [(metric, name) for metric in facts["metrics"] for name in names]
    if [(line["metric"], line["variant"]) for line in facts["table"]] != expected:
        raise ValueError("table: expected a line for each metric and variant, in their order")
    if not names or not facts["seeds"] or not facts["metrics"]:
        raise ValueError("expected a variant, a seed and a metric at least")
    for variant in facts["variants"]:
        if Path(variant["slug"]).name != variant["slug"]:
            raise ValueError(f"'{variant['slug']}' is no name of a file")


def _check_index(folder: Path, facts: dict[str, Any]) -> None:
    path = folder / INDEX
    known = {variant["name"] for variant in facts["variants"]}
    for row in read_rows(path, Columns(("variant",), tuple(facts["metrics"]))):
        if row.cells[0] not in known:
            raise UsageError(f"'{path}' is of another plan: no variant '{row.cells[0]}' in it")
