"""The report of an ablation: the effect of each variant, and its significance.

In: the folder of an ablation that is complete. Out: an HTML page. Its table has what
``ablation.json`` says, after a check of every field that is shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from runtime.errors import UsageError
from runtime.experiments.analysis import WIDE, ComparisonLine, comparison_table, legend
from runtime.experiments.analysis.ablation_plots import ablation_figure, overall, read_facts
from runtime.experiments.execution import (
    DIAGRAMS,
    GRAPH,
    INDEX,
    TABLE,
    VARIANT,
    Columns,
    check_entries,
    read_plan,
    read_rows,
)
from runtime.files import MAYBE_NUMBER, check_form
from runtime.reports import pieces
from runtime.reports.findings import of_ablation
from runtime.reports.page import page
from runtime.tables import Html, Table, element, facts, join

_ESTIMATE = {"n": int, "mean": MAYBE_NUMBER, "low": MAYBE_NUMBER, "high": MAYBE_NUMBER}
DIFFERENCE = {
    **_ESTIMATE,
    "p": MAYBE_NUMBER,
    "p_adjusted": MAYBE_NUMBER,
    "p_presence": MAYBE_NUMBER,
    "distinguishable": (bool, type(None)),
}
LINE = {
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
    **{"seeds": [int], "metrics": [str], "variants": [_VARIANT], "table": [LINE]},
}


def ablation_report(folder: Path) -> str:
    """The report of an ablation as an HTML document.

    Parameters
    ----------
    folder : of an ablation that is complete.

    Raises
    ------
    UsageError : it is not complete, or its files cannot be read.
    """
    results = _read(folder)
    plan = read_plan(folder)
    sections = {
        "Differences": _differences(results),
        "Figures": _figure(folder),
        "Variants": _variants(results),
        "Diagrams": join(*_diagrams(folder, results)),
        "Graph": pieces.graph_file(folder / GRAPH, "The graph of the baseline."),
        "Provenance": pieces.plan_provenance(folder, plan),
    }
    lead = f"Ablation of {results['graph']}: the baseline and {_count(results)} on the same seeds."
    title = str(results["experiment"])
    return page(
        "Ablation", title, lead, _facts(results, plan), sections, folder, of_ablation(results)
    )


def _count(results: Mapping[str, Any]) -> str:
    others = len(results["variants"]) - 1
    return f"{others} variant{'s' if others != 1 else ''}"


def _facts(results: Mapping[str, Any], plan: Mapping[str, Any]) -> Html:
    variants = results["variants"]
    failed = sum(variant["failed"] for variant in variants)
    message = element("span", str(failed), class_="bad") if failed else "none"
    return facts(
        [
            ("variants", str(len(variants))),
            ("seeds", str(plan.get("seeds", ""))),
            ("runs", str(sum(variant["runs"] for variant in variants))),
            ("failed runs", message),
            ("intervals", "95 %"),
        ]
    )


def _differences(results: Mapping[str, Any]) -> Html:
    return differences(
        results, "variant", legend(lines_of(results), how=results["test"], has_halves=False)
    )


def lines_of(results: Mapping[str, Any]) -> list[ComparisonLine]:
    """The lines of a stored comparison."""
    return [ComparisonLine.from_dict(line) for line in results["table"]]


def differences(results: Mapping[str, Any], name: str, note: str) -> Html:
    """The lines of a comparison, metric by metric, and a note.

    Parameters
    ----------
    name : what is compared.
    """
    units, never = results.get("units") or {}, results.get("never") or {}
    table = comparison_table(lines_of(results), units, never).select(*WIDE)
    first, *others = table.columns
    table = replace(table, columns=[replace(first, title=name), *others])
    return join(table.html("differences"), element("p", note, class_="soft small"))


def _figure(folder: Path) -> Html:
    caption = (
        "Metrics by variant: means with their intervals, and a dot for each seed; hollow if the "
        "difference from the baseline is not significant."
    )
    return pieces.plot(ablation_figure(folder), "figure-1", caption, wide=True)


def _variants(results: Mapping[str, Any]) -> Html:
    rows = []
    for variant in results["variants"]:
        reasons = "; ".join(f"{r['count']} × {r['reason']}" for r in variant["reasons"])
        message = "; ".join(variant["notes"])
        changes = "; ".join(variant["changes"]) or "none"
        rows.append([variant["name"], changes, str(variant["failed"]), reasons, message])
    head = ["variant", "changes", "failed", "reasons", "notes"]
    columns = [i for i in range(len(head)) if i < 3 or any(row[i] for row in rows)]
    shown = [[row[i] for i in columns] for row in rows]
    titles = [head[i] for i in columns]
    wraps = [i for i in range(len(titles)) if i not in (0, 2)]
    parts = [Table.of(titles, shown, numbers=[2], long=wraps).html("variants")]
    if results["essential"]:
        parts.append(element("h3", "Essential blocks, which cannot be removed on their own"))
        essential = [[str(name), str(reason)] for name, reason in results["essential"].items()]
        parts.append(Table.of(["block", "reason"], essential, long=[1]).html("essential blocks"))
    return join(*parts)


def _diagrams(folder: Path, results: Mapping[str, Any]) -> Iterator[Html]:
    """The diagram of each variant, with removed blocks in grey."""
    for variant in results["variants"]:
        name = str(variant["name"])
        yield element("h3", name)
        file = folder / DIAGRAMS / f"{variant['slug']}.json"
        yield pieces.diagram_file(file, f"diagram-{variant['slug']}", f"block diagram of {name}")


def _read(folder: Path) -> dict[str, Any]:
    """The content of ``ablation.json``.

    Raises
    ------
    UsageError : the ablation is not complete, or its files are damaged.
    """
    path = folder / TABLE
    if not path.is_file():
        message = "it was interrupted or is still running; continue with 'runtime ablate --resume'"
        raise UsageError(f"'{folder}' has an ablation without results: {message}")
    facts = read_facts(folder)
    try:
        check_form(facts, _FACTS)
        for i, line in enumerate(facts["table"]):
            if line["difference"] is not None:
                check_form(line["difference"], DIFFERENCE, f"table[{i}].difference")
        _check_whole(facts)
        if facts.get("schema_version") != 1:
            check_entries(facts)
    except ValueError as error:
        raise UsageError(f"'{path}' is damaged: {error}") from None
    _check_index(folder, facts)
    return facts


def _check_whole(facts: dict[str, Any]) -> None:
    """Check that the table has a line for each metric and variant, and that slugs are names."""
    names = [variant["name"] for variant in facts["variants"]]
    expected = [(metric, name) for metric in facts["metrics"] for name in names]
    if [(line.metric, line.variant) for line in overall(facts)] != expected:
        raise ValueError("table: expected a line for each metric and variant, in their order")
    if not names or not facts["seeds"] or not facts["metrics"]:
        raise ValueError("expected at least one variant, seed and metric")
    for variant in facts["variants"]:
        if Path(variant["slug"]).name != variant["slug"]:
            raise ValueError(f"'{variant['slug']}' is not the name of a file")


def _check_index(folder: Path, facts: dict[str, Any]) -> None:
    path = folder / INDEX
    known = {variant["name"] for variant in facts["variants"]}
    factors = (VARIANT, *facts.get("factors", ()))
    for row in read_rows(path, Columns(factors, tuple(facts["metrics"]))):
        if row.cells[0] not in known:
            raise UsageError(
                f"'{path}' belongs to a different plan, which has a variant '{row.cells[0]}'"
            )
