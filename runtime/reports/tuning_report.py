"""The report of a tuning: its winners on the training and the held-out runs, and its figures."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.compare import text_of
from runtime.errors import UsageError
from runtime.experiments.analysis import SAME, SAME_RUNS
from runtime.experiments.execution import GRAPH, check_entries, read_plan
from runtime.experiments.tuning import (
    NOT_DISTINGUISHABLE,
    NOTHING,
    TUNING,
    Judgement,
    judgement_table,
)
from runtime.experiments.tuning.tuning_plots import tuning_figures
from runtime.files import MAYBE_NUMBER, check_form, read_json
from runtime.reports import pieces
from runtime.reports.findings import of_tuning
from runtime.reports.page import page
from runtime.runs import DIAGRAM
from runtime.tables import Html, Table, element, facts, join, number_cell
from runtime.terminal import with_unit

NONE = "No configuration satisfies the constraints."
FEW = 60  # configurations that are all listed
_MEAN = {"n": int, "mean": MAYBE_NUMBER, "low": MAYBE_NUMBER, "high": MAYBE_NUMBER}
_STORED = {
    "experiment": str,
    "graph": str,
    "status": str,
    "trials": int,
    "sampler": str,
    "runs": int,
    "held_out_runs": int,
    "vary": dict,
    "units": dict,
    "training": {"seeds": str, "conditions": dict},
    "held_out": {"seeds": str, "conditions": dict},
    "configurations": [{"number": int, "status": str, "metrics": dict}],
    "front": [int],
    "table": [{"configuration": int, "metric": str, "training": _MEAN, "held_out": _MEAN}],
}
CAPTIONS = {
    "history": "The trials in their order, and the best value so far.",
    "importance": "The share of a metric's variance that each factor explains alone.",
    "front": "All trials; the front on the training runs and on the held-out ones.",
    "slices": "Each trial along each factor.",
}


def tuning_report(folder: Path) -> str:
    """The report of a tuning as an HTML document.

    Parameters
    ----------
    folder : of a tuning, complete or interrupted.

    Raises
    ------
    UsageError : its files cannot be read.
    """
    stored = _read(folder)
    sections = {
        "Winners": _winners(stored),
        "Training beside held-out runs": _evaluations(stored),
        "Figures": join(*_figures(folder)),
        "Configurations": _configurations(stored),
        "Diagram": pieces.diagram_file(
            folder / DIAGRAM, "diagram", f"block diagram of {stored['graph']}"
        ),
        "Graph": pieces.graph_file(folder / GRAPH, "The graph before factors are set."),
        "Provenance": pieces.plan_provenance(folder, read_plan(folder)),
    }
    return page(
        "Tuning",
        stored["experiment"],
        _lead(stored),
        _facts(stored),
        sections,
        folder,
        of_tuning(stored),
    )


def _read(folder: Path) -> dict[str, Any]:
    try:
        stored = read_json(folder / TUNING)
        check_form(stored, _STORED)
        if stored.get("schema_version") != 1:
            check_entries(stored)
    except FileNotFoundError:
        message = "has no results yet; 'runtime tune' with --resume continues it"
        raise UsageError(f"'{folder}' {message}") from None
    except (OSError, ValueError) as error:
        raise UsageError(f"'{folder / TUNING}' is damaged: {error}") from None
    content: dict[str, Any] = stored
    return content


def _lead(stored: Mapping[str, Any]) -> str:
    ranges = [f"{path} = {v if isinstance(v, str) else text_of(v)}" for path, v in _vary(stored)]
    goals = [
        f"{goal} {', '.join(stored[goal])}" for goal in ("minimize", "maximize") if goal in stored
    ]
    return f"Tuning of {', '.join(ranges)}, to {' and '.join(goals)}."


def _vary(stored: Mapping[str, Any]) -> Iterable[tuple[str, Any]]:
    vary: dict[str, Any] = stored["vary"]
    return vary.items()


def _facts(stored: Mapping[str, Any]) -> Html:
    done = len(stored["configurations"]) - 1
    whole = stored["status"] == "complete"
    status = str(done) if whole else element("span", f"{done} of {stored['trials']}", class_="warn")
    constraints = stored.get("constraints") or {}
    limits = "; ".join(f"{name} {_words(bound)}" for name, bound in constraints.items())
    return facts(
        [
            ("trials", status),
            ("sampler", stored["sampler"]),
            ("training runs", str(stored["runs"])),
            ("held-out runs", str(stored["held_out_runs"])),
            ("constraints", limits or "none"),
            ("training seeds", stored["training"]["seeds"]),
            ("held-out seeds", stored["held_out"]["seeds"]),
        ]
    )


def _words(bound: Any) -> str:
    """A constraint in words: ``below 0.3``."""
    entries = bound.items() if isinstance(bound, Mapping) else ()
    return ", ".join(f"{key} {text_of(value)}" for key, value in entries) or text_of(bound)


def _winners(stored: Mapping[str, Any]) -> Html:
    if not stored["front"]:
        own = stored["configurations"][0].get("feasible")
        words = f"{NOTHING[0].upper()}{NOTHING[1:]}." if own else NONE
        return element("p", words, class_="warn")
    by_number = {one["number"]: one for one in stored["configurations"]}
    factors = list(stored["vary"])
    rows = [
        [str(number), *(text_of(by_number[number]["values"][path]) for path in factors)]
        for number in stored["front"]
    ]
    shown = Table.of(["configuration", *factors], rows, numbers=range(1, len(factors) + 1))
    winners = shown.html("winners")
    if stored["table"] and not stored.get("better", stored["front"]):
        is_open = "not distinguishable" in (stored.get("verdicts") or {}).values()
        words = NOT_DISTINGUISHABLE if is_open else NOTHING
        return join(winners, element("p", f"On the held-out runs, {words}.", class_="warn"))
    return winners


def _evaluations(stored: Mapping[str, Any]) -> Html:
    if not stored["table"]:
        return element("p", "The held-out runs have not been made.", class_="soft")
    judgements = list(map(Judgement.from_dict, stored["table"]))
    metrics = dict.fromkeys(line.metric for line in judgements)
    table = judgement_table(judgements, list(metrics), stored["units"], stored.get("never") or {})
    note = element(
        "p",
        "Baseline: the values as in the graph. Differences are from it on the same conditions, or "
        "of one condition on the same seeds (paired t, or signed ranks where values are skewed or "
        "runs failed, p by Benjamini-Hochberg; what is never reached, and a failed run, counts "
        "as worse than any value; in %: the typical ratio). Winners were chosen by the training "
        "runs, which therefore have no interval and no test. Overfit: training minus held-out. "
        f"{SAME}: {SAME_RUNS}.",
        class_="soft small",
    )
    return join(table.html("training and held-out runs"), note)


def _figures(folder: Path) -> Iterator[Html]:
    for i, (name, figure) in enumerate(tuning_figures(folder)):
        yield pieces.plot(figure, f"figure-{i + 1}", CAPTIONS[name], wide=True)


def _configurations(stored: Mapping[str, Any]) -> Html:
    factors = list(stored["vary"])
    metrics = list(stored["configurations"][0]["metrics"])
    configurations = stored["configurations"][1:]
    shown = configurations[-FEW:]
    rows = [
        [
            str(one["number"]),
            *(text_of(one["values"][path]) for path in factors),
            *(number_cell(one["metrics"].get(name)) for name in metrics),
            one["status"],
        ]
        for one in shown
    ]
    head = [
        "configuration",
        *factors,
        *(with_unit(name, stored["units"]) for name in metrics),
        "status",
    ]
    numbers = range(1, len(head) - 1)
    listing = Table.of(head, rows, numbers=numbers).html("configurations")
    if len(shown) == len(configurations):
        return listing
    return join(
        element("p", f"The last {FEW} of {len(configurations)}.", class_="soft small"), listing
    )
