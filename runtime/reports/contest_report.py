"""The report of a contest: who is best on the held-out runs, with which values, and how surely.

In: the folder of a contest that is complete. Out: an HTML page. Its tables have what
``contest.json`` says, after a check of every field that is shown.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.compare import text_of
from runtime.errors import UsageError
from runtime.experiments.analysis import legend
from runtime.experiments.execution import check_entries, read_plan
from runtime.experiments.tuning import CONTEST, HOW, ONCE, agreement
from runtime.experiments.tuning.contest_plots import contest_figure, read_contest
from runtime.files import check_form
from runtime.reports import pieces
from runtime.reports.ablation_report import DIFFERENCE, LINE, differences, lines_of
from runtime.reports.findings import of_contest
from runtime.reports.page import page
from runtime.runs import DIAGRAM
from runtime.tables import Html, Table, bullets, element, facts, join, number_cell
from runtime.terminal import with_unit

_TUNING = {
    **{"folder": str, "sampling_seed": int, "trials": int, "runs": int, "metrics": dict},
    **{"values": (dict, type(None)), "stopped": int, "without_value": int},
    **{"reasons": [{"reason": str, "count": int}], "violated": [str]},
}
_STORED = {
    **{"experiment": str, "graph": str, "metrics": [str], "contestants": dict, "units": dict},
    **{"training": str, "held_out": str, "paired_by": str, "correction": str},
    "constraints": [str],
    **{"trials": int, "budget": (int, type(None)), "table": [LINE]},
}


def contest_report(folder: Path) -> str:
    """The report of a contest as an HTML document.

    Parameters
    ----------
    folder : of a contest that is complete.

    Raises
    ------
    UsageError : its files cannot be read.
    """
    stored = _read(folder)
    names = ", ".join(stored["contestants"])
    limits = f", with {' and '.join(stored['constraints'])}" * bool(stored["constraints"])
    lead = (
        f"Contest of {names}: tuned with equal budgets{limits}, on {stored['training']}. "
        f"Held out: {stored['held_out']}."
    )
    tunings = [each for own in stored["contestants"].values() for each in own]
    sections = {
        "Differences": _differences(stored),
        "Figure": _figure(folder, stored),
        "Tuned values": join(*_values(stored)),
        "Failures": _failures(stored),
        "Diagrams": join(*_diagrams(folder, stored)),
        "Provenance": pieces.plan_provenance(folder, read_plan(folder / tunings[0]["folder"])),
    }
    title = stored["experiment"]
    return page("Contest", title, lead, _facts(stored), sections, folder, of_contest(stored))


def _read(folder: Path) -> dict[str, Any]:
    """The content of ``contest.json``.

    Raises
    ------
    UsageError : it is damaged, or of an earlier version.
    """
    stored = read_contest(folder)
    try:
        check_form(stored, _STORED)
        check_entries(stored)
        for name, own in stored["contestants"].items():
            check_form(own, [_TUNING], f"contestants.{name}")
        for i, line in enumerate(stored["table"]):
            if line["difference"] is not None:
                check_form(line["difference"], DIFFERENCE, f"table[{i}].difference")
    except ValueError as error:
        again = "'runtime contest' with --resume writes it again"
        raise UsageError(f"'{folder / CONTEST}' is damaged: {error}; {again}") from None
    return stored


def _facts(stored: Mapping[str, Any]) -> Html:
    contestants = stored["contestants"].values()
    budget = stored["budget"]
    failed = sum(
        reason["count"] for own in contestants for each in own for reason in each["reasons"]
    )
    return facts(
        [
            ("contestants", str(len(contestants))),
            ("tunings of each", str(len(next(iter(contestants))))),
            ("budget", f"{stored['trials']} trials" if budget is None else f"{budget} runs"),
            ("failed runs", element("span", str(failed), class_="bad") if failed else "none"),
        ]
    )


def _differences(stored: Mapping[str, Any]) -> Html:
    first, unit = next(iter(stored["contestants"])), stored["paired_by"]
    paired = f"{first}, or to the one named, on the same {unit}"
    is_once = any(len(own) == 1 and own[0]["values"] for own in stored["contestants"].values())
    note = legend(lines_of(stored), paired=paired, how=HOW, has_halves=False)
    note += f"\n{ONCE[0].upper()}{ONCE[1:]}." * is_once
    return differences(stored, "contestant", note)


def _figure(folder: Path, stored: Mapping[str, Any]) -> Html:
    first = next(iter(stored["contestants"]))
    caption = (
        f"Metrics by contestant on the held-out {stored['paired_by']}s: means with 95 % intervals, "
        f"and a dot for each tuning; hollow if the difference from {first} is not significant."
    )
    return pieces.plot(contest_figure(folder, "screen"), "figure-1", caption, wide=True)


def _values(stored: Mapping[str, Any]) -> Iterator[Html]:
    """What won in each tuning, and by how much the tunings differ."""
    metrics = stored["metrics"]
    head = ["contestant", "sampling seed", "trials", "stopped early", "runs"]
    head += [*(with_unit(name, stored["units"]) for name in metrics), "values"]
    rows = []
    for name, own in stored["contestants"].items():
        for each in own:
            values = (each["values"] or {}).items()
            shown = ", ".join(f"{path} = {text_of(value)}" for path, value in values)
            counts = [each[key] for key in ("sampling_seed", "trials", "stopped", "runs")]
            scores = [number_cell(each["metrics"].get(metric)) for metric in metrics]
            limits = "".join(f"; not {constraint}" for constraint in each["violated"])
            rows.append([name, *map(str, counts), *scores, (shown or "its own") + limits])
    last = len(head) - 1
    yield Table.of(head, rows, numbers=range(1, last), long=[last]).html("tuned values")
    note = "Chosen on the training runs; the metrics are of the held-out runs of each tuning."
    if stored["constraints"]:
        note += " “not effort below 0.3”: the held-out runs violate that constraint."
    yield element("p", note, class_="soft small")
    ranges = list(agreement(stored))
    if ranges:
        yield element("h3", "How far tunings agree")
        yield bullets(ranges)


def _failures(stored: Mapping[str, Any]) -> Html:
    """Why runs failed, contestant by contestant."""
    rows = [
        [name, str(each["sampling_seed"]), str(reason["count"]), reason["reason"]]
        for name, own in stored["contestants"].items()
        for each in own
        for reason in each["reasons"]
    ]
    if not rows:
        return Html("")
    head = ["contestant", "sampling seed", "runs", "reason"]
    return Table.of(head, rows, numbers=[1, 2], long=[3]).html("failures")


def _diagrams(folder: Path, stored: Mapping[str, Any]) -> Iterator[Html]:
    for name, own in stored["contestants"].items():
        yield element("h3", name)
        file = folder / Path(own[0]["folder"]).name / DIAGRAM
        yield pieces.diagram_file(file, f"diagram-{own[0]['folder']}", f"block diagram of {name}")
