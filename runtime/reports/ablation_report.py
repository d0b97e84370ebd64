"""The report of an ablation: what each variant changes, and whether that is real."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.experiments.analysis import LEVEL
from runtime.experiments.analysis.ablation_plots import ablation_figure
from runtime.experiments.execution import DIAGRAMS, GRAPH, read_plan
from runtime.reports import pieces
from runtime.reports.ablation_data import read_ablation
from runtime.reports.html import Html, element, facts, grouped_table, join, table
from runtime.reports.page import page


def ablation_report(folder: Path) -> str:
    """The report of an ablation as an HTML document.

    Parameters
    ----------
    folder : of an ablation that is complete.

    Raises
    ------
    UsageError : it is not, or its files cannot be read.
    """
    found = read_ablation(folder)
    plan = read_plan(folder)
    sections = {
        "Differences": _differences(found),
        "Figures": _figure(folder, found),
        "Variants": _variants(found),
        "Diagrams": join(*_diagrams(folder, found)),
        "Graph": pieces.graph_file(folder / GRAPH, "The baseline, as it ran."),
        "Provenance": pieces.plan_provenance(folder, plan),
    }
    lead = f"Ablation of {found['graph']}: the baseline and {_count(found)} on the same seeds."
    made_by = f"Made by runtime report from {folder.resolve().name}."
    title = str(found["experiment"])
    return page("Ablation", title, lead, _facts(found, plan), sections, made_by)


def _count(found: Mapping[str, Any]) -> str:
    others = len(found["variants"]) - 1
    return f"{others} variant{'s' if others != 1 else ''}"


def _facts(found: Mapping[str, Any], plan: Mapping[str, Any]) -> Html:
    variants = found["variants"]
    failed = sum(variant["failed"] for variant in variants)
    message = element("span", str(failed), class_="bad") if failed else "none"
    return facts(
        [
            ("variants", str(len(variants))),
            ("seeds", str(plan.get("seeds", ""))),
            ("runs", str(sum(variant["runs"] for variant in variants))),
            ("failed runs", message),
            ("intervals", "95 %"),
            ("test", str(found["test"]).partition(" (")[0]),
        ]
    )


def _differences(found: Mapping[str, Any]) -> Html:
    head = ["variant", "seeds", "mean", "95 % interval", "difference", "95 % interval"]
    head += ["p, corrected", "distinguishable"]
    groups: dict[str, list[list[str]]] = {}
    for line in found["table"]:
        groups.setdefault(line["metric"], []).append(_line(line))
    told = element(
        "p",
        f"Differences are to the baseline, paired by seed ({found['test']}). A difference is "
        f"distinguishable where p < {LEVEL:.2g} after {found['correction']}'s correction for all "
        "comparisons of the table. n/N: n of N seeds have a value (for a difference, one in "
        "both), and means are over those; “in seeds” says that another share of them has one than "
        "under the baseline. “gone”: what the metric measures was taken out.",
        class_="soft small",
    )
    return join(grouped_table(head, groups, range(1, 7), label="differences"), told)


def _line(line: Mapping[str, Any]) -> list[str]:
    seeds = str(line["runs"]) if line["n"] == line["runs"] else f"{line['n']}/{line['runs']}"
    cells = [
        line["variant"],
        seeds,
        pieces.number(line["mean"]),
        pieces.interval(line["low"], line["high"]),
    ]
    apart = line["difference"]
    if apart is None:
        return [*cells, "", "", "", "" if line["recorded"] else "gone"]
    mean = pieces.number(apart["mean"], signed=True)
    if 0 < apart["n"] < line["runs"]:
        share = element("span", f" {apart['n']}/{line['runs']}", class_="soft")
        mean = join(mean, share)
    verdict = _verdict(apart)
    shown = element("strong", verdict) if verdict.startswith("yes") else verdict
    return [
        *cells,
        mean,
        pieces.interval(apart["low"], apart["high"], signed=True),
        pieces.probability(apart["p_adjusted"]),
        shown,
    ]


def _verdict(apart: Mapping[str, Any]) -> str:
    """Whether a difference is real, in a word or two."""
    if apart["p_presence"] is not None and apart["p_presence"] < LEVEL:
        return "yes, in seeds"
    if apart["n"] and apart["mean"] == 0.0 and apart["p"] == 1.0:
        return "equal"
    return {True: "yes", False: "no", None: "–"}[apart["distinguishable"]]


def _figure(folder: Path, found: Mapping[str, Any]) -> Html:
    caption = (
        "Metrics by variant: means with their intervals, a dot for each seed; hollow where the "
        "difference to the baseline is not distinguishable."
    )
    return pieces.plot(ablation_figure(folder), "figure-1", caption, wide=True)


def _variants(found: Mapping[str, Any]) -> Html:
    rows = []
    for variant in found["variants"]:
        reasons = "; ".join(f"{r['count']} × {r['reason']}" for r in variant["reasons"])
        message = "; ".join(variant["notes"])
        changes = "; ".join(variant["changes"]) or "none"
        rows.append([variant["name"], changes, str(variant["failed"]), reasons, message])
    head = ["variant", "changes", "failed", "reasons", "notes"]
    kept = [i for i in range(len(head)) if i < 3 or any(row[i] for row in rows)]
    shown = [[row[i] for i in kept] for row in rows]
    titles = [head[i] for i in kept]
    wraps = [i for i in range(len(titles)) if i not in (0, 2)]
    parts = [table(titles, shown, [2], label="variants", wraps=wraps)]
    if found["essential"]:
        parts.append(element("h3", "Essential blocks, which cannot be taken out alone"))
        essential = [[str(name), str(reason)] for name, reason in found["essential"].items()]
        parts.append(table(["block", "reason"], essential, label="essential blocks", wraps=[1]))
    return join(*parts)


def _diagrams(folder: Path, found: Mapping[str, Any]) -> Iterator[Html]:
    """The diagram of each variant, with what is gone greyed."""
    for variant in found["variants"]:
        name = str(variant["name"])
        yield element("h3", name)
        file = folder / DIAGRAMS / f"{variant['slug']}.json"
        yield pieces.diagram_file(file, f"diagram-{variant['slug']}", f"block diagram of {name}")
