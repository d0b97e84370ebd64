"""The tables below the answers."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from runtime.experiments.design.variants import BASELINE
from tests.studies.ablation.judge import METRICS, Judged, Metric
from tests.studies.ablation.judge import controllers as controllers_of
from tests.studies.ablation.runs import CONFIGURATIONS, PRINTED, ROBUST, RULES, Configuration
from tests.studies.ablation.words import change, markdown, own

NAMES = {
    BASELINE: "LQR of the graph",
    "no feedforward": "LQR, no feedforward",
    "exact feedforward": "LQR, exact feedforward",
}
Tell = Callable[[Sequence[float | None]], str]


def worth(judged: Judged) -> list[str]:
    """What the adaptive part adds to each controller: a table for each case and metric."""
    return [
        f"**Case {case}: {metric.title}** [{metric.unit}]\n\n{_worth(judged, case, metric)}"
        for case, metrics in METRICS.items()
        for metric in metrics
    ]


def _worth(judged: Judged, case: str, metric: Metric) -> str:
    configurations = [found for found in CONFIGURATIONS if found.case == case]
    counted = COUNTED.get(metric.name, {})
    rows = []
    for configuration in configurations:
        for name, (adaptive, alone) in controllers_of(
            judged.results[configuration, PRINTED]
        ).items():
            cells = [configuration.label] if len(configurations) > 1 else []
            cells += [NAMES.get(name, name), _mean(judged, configuration, PRINTED, alone, metric)]
            i = METRICS[case].index(metric)
            cells += [change(judged(configuration, rule, adaptive, alone, i)) for rule in RULES]
            for counts, tell in counted.values():
                asked = ((PRINTED, alone), (PRINTED, adaptive), (ROBUST, adaptive))
                found = (judged.results[configuration, rule](v, counts) for rule, v in asked)
                cells.append(", ".join(map(tell, found)))
            rows.append(cells)
    first = ["configuration"] if len(configurations) > 1 else []
    return markdown([*first, "controller", "alone", *RULES, *counted], rows)


def _mean(
    judged: Judged, configuration: Configuration, rule: str, variant: str, metric: Metric
) -> str:
    runs = len(judged.results[configuration, rule].seeds)
    return own(judged.mean(configuration, rule, variant, metric), runs, metric)


def _closed(loops: Sequence[float | None]) -> str:
    return str(sum(value is not None and value >= 1.0 for value in loops))


def _touching(contacts: Sequence[float | None]) -> str:
    found = [value for value in contacts if value is not None]
    return f"{100 * sum(found) / len(found):.1f} %" if found else "-"


# Beside a metric: on how many seeds the loop was closed, and in what part of the time the body
# touched something; alone, as printed and with the robust rule.
COUNTED: dict[str, dict[str, tuple[str, Tell]]] = {
    "distance_mae": {"closed": ("loops", _closed), "contact": ("contacts", _touching)}
}
