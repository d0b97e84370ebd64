"""The committed experiments; verdicts and page on numbers whose answers are known."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import runtime
from runtime.document.loader import SHIPPED
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.design.variants import BASELINE, GraphVariant
from tests.studies.ablation import runs
from tests.studies.ablation.conclusions import ALL, FED, INTEGRATOR, SPEED, TURN
from tests.studies.ablation.judge import (
    ALONE,
    APART,
    AS_WELL,
    BARE,
    EQUAL,
    FAST,
    FAST_INTEGRATOR,
    HELPS,
    HURTS,
    METRICS,
    MORE,
    NOT_SIGNIFICANT,
    PARTS,
    TUNED,
    WORSE,
    Judged,
    controllers,
)
from tests.studies.ablation.page import page
from tests.studies.ablation.runs import (
    CONFIGURATIONS,
    PRINTED,
    ROBUST,
    RULES,
    Configuration,
    Measured,
)

# The studies of other papers are tested beside their graphs, in tests/gallery.
OTHERS = {path.stem for path in (SHIPPED / "gallery" / "papers").glob("*.yaml")}
EXPERIMENTS = sorted(
    path for path in (SHIPPED / "experiments").glob("*.yaml") if path.stem not in OTHERS
)
LINE, SINE, IDEAL = CONFIGURATIONS[:3]
SEEDS = tuple(range(20))
# The mean error of a variant, by configuration and rule.
Error = Callable[[Configuration, str, str], float]


@pytest.mark.parametrize("file", EXPERIMENTS, ids=lambda file: file.stem)
def test_every_experiment_is_part_of_the_study(file: Path) -> None:
    used = {configuration.file(rule) for configuration in CONFIGURATIONS for rule in RULES}
    assert file.stem in used


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    "configuration", CONFIGURATIONS, ids=lambda configuration: configuration.label
)
@pytest.mark.slow
def test_all_variants_build_and_can_be_compared(configuration: Configuration, rule: str) -> None:
    experiment = runs.read(configuration, rule)
    graphs = {variant.name: variant.graph for variant in experiment.variants}
    parts = set(PARTS) if rule == PRINTED else {*PARTS} - {SPEED, TURN}
    assert {ALONE, BARE, *parts, TUNED, TUNED + APART} <= set(graphs)
    for name, graph in graphs.items():
        network = graph.check().network
        assert network.entries, name
        is_without = name.endswith(APART) or name == ALONE
        assert is_without != any(block.startswith("adaptive.") for block in network.entries), name
        if name.endswith(APART):
            assert name.removesuffix(APART) in graphs
    rates = {}
    for name in (BARE.removesuffix(APART), INTEGRATOR, FAST, FAST_INTEGRATOR):
        learner: Any = graphs[name].network.entries["adaptive.snn_omega"].block
        rates[name] = learner.learning_rate
    assert rates[BARE.removesuffix(APART)] == rates[INTEGRATOR]
    assert rates[FAST] == rates[FAST_INTEGRATOR] == pytest.approx(2.0 * rates[INTEGRATOR])
    # The gains of the graphs were chosen on seeds 0 to 9.
    assert experiment.seeds is not None
    assert min(experiment.seeds) > 9
    assert len(experiment.seeds) == len(SEEDS)
    if configuration.condition:
        plain = runs.read(Configuration(configuration.case, "", configuration.experiment), rule)
        found = {v.name: v.graph.to_dict() for v in plain.variants}
        assert all(graph.to_dict() != found[name] for name, graph in graphs.items())


# A tuning of tests/studies/settings, and the variant that has its settings.
COMPARED = {
    "LQR": TUNED,
    "LQR, feedforward tuned": FED,
    "PathPID": "PID",
    "PurePursuit": "PurePursuit",
    "Stanley": "Stanley",
}
PLACES = {"params.q_y": "lqr.0", "params.q_theta": "lqr.2"}


@cache
def experiment(configuration: Configuration, rule: str) -> tuple[GraphVariant, ...]:
    return tuple(runs.read(configuration, rule).variants)


@pytest.mark.slow
def test_settings_of_the_trackers_are_those_that_were_found() -> None:
    found = yaml.safe_load((Path(__file__).parent / "settings" / "found.yaml").read_text())
    tasks = {"line": LINE, "sine": SINE, "gentle": IDEAL}
    wanted = [(task, name) for task in tasks for name in found[task]]
    assert len(wanted) == 4 * len(tasks) + 1
    for (task, name), rule in itertools.product(wanted, RULES):
        graph = next(v.graph for v in experiment(tasks[task], rule) if v.name == COMPARED[name])
        blocks = graph.to_dict()["blocks"]
        for path, value in found[task][name].items():
            block, key = PLACES.get(path, path).split(".")
            held = blocks[block]["q"][int(key)] if key.isdigit() else blocks[block][key]
            assert held == value, (name, task, rule, path)


@cache
def variants_of(experiment: str, rule: str) -> list[str]:
    """All names, the baseline's first."""
    return [
        BASELINE,
        *(v.name for v in runs.read(Configuration("", "", experiment), rule).variants),
    ]


def made_up(
    error: Error, spread: float = 0.02, seed: int = 1
) -> dict[tuple[Configuration, str], Measured]:
    """Numbers in place of runs: each with noise of its own, in part of the mean."""
    rng = np.random.default_rng(seed)
    results = {}
    for configuration in CONFIGURATIONS:
        for rule in RULES:
            values = {
                name: {
                    metric.name: list(
                        error(configuration, rule, name)
                        * (1.0 + spread * rng.standard_normal(len(SEEDS)))
                    )
                    for metric in METRICS[configuration.case]
                }
                | {"loops": [1.2] * len(SEEDS), "contacts": [0.0] * len(SEEDS)}
                for name in variants_of(configuration.experiment, rule)
            }
            results[configuration, rule] = Measured(values, SEEDS)
    return results


@pytest.fixture(scope="module")
def judged() -> Judged:
    """As printed it halves the error in A, doubles it in B; nothing else matters much."""

    def error(configuration: Configuration, rule: str, name: str) -> float:
        if rule == PRINTED and name == BASELINE:
            return {"A": 0.5, "B": 2.0}.get(configuration.case, 1.0)
        if rule == ROBUST and name == "integrator":
            return {"A": 1.3, "B": 1.03}.get(configuration.case, 1.0)
        return 1.0

    return Judged(made_up(error))


@pytest.mark.slow
def test_verdicts_are_those_of_the_numbers(judged: Judged) -> None:
    found = judged(LINE, PRINTED, BASELINE, ALONE)
    assert found.verdict == HELPS
    assert found.share[0] == pytest.approx(-0.5, abs=0.03)
    assert found.share[1] < -0.5 < found.share[2]
    assert judged(SINE, PRINTED, BASELINE, ALONE).verdict == HURTS
    assert judged(IDEAL, PRINTED, BASELINE, ALONE).verdict == NOT_SIGNIFICANT
    # Progress along the path: who cuts the bends makes more of it, so it is no merit.
    assert METRICS["B"][1].name == "distance"
    assert judged(SINE, PRINTED, BASELINE, ALONE, 1).verdict == MORE


def test_what_stands_in_is_held_against_a_margin(judged: Judged) -> None:
    assert judged(LINE, ROBUST, "integrator", BASELINE).stands_in == WORSE
    # Significantly different from what it replaces, but by 3 %.
    small = judged(SINE, ROBUST, "integrator", BASELINE)
    assert (small.verdict, small.stands_in) == (HURTS, AS_WELL)


def test_not_significant_is_not_as_well() -> None:
    """With much noise, equal means are neither significantly different nor shown to be alike."""
    noisy = Judged(made_up(lambda *_: 1.0, spread=0.5))
    found = [e for e in noisy.effects.values() if e.asked.variant == INTEGRATOR]
    assert {e.stands_in for e in found} == {NOT_SIGNIFICANT}


def test_without_an_effect_few_are_found() -> None:
    """The correction holds the share of false finds down: 0.05 alone would find about 17."""
    nothing = Judged(made_up(lambda *_: 1.0, spread=0.1, seed=3))
    assert len(nothing.effects) > 300
    assert sum(e.is_significant for e in nothing.effects.values()) <= 2


def test_equal_but_for_rounding_is_equal() -> None:
    results = made_up(lambda *_: 1.0)
    values = results[LINE, PRINTED].values
    values["no feedforward"]["position_mae"] = list(
        values["no feedforward, not adaptive"]["position_mae"]
    )
    values["no feedforward"]["position_mae"][3] += 1e-15  # type: ignore[operator]
    effect = Judged(results)(LINE, PRINTED, "no feedforward", BARE)
    assert (effect.verdict, effect.stands_in) == (EQUAL, AS_WELL)


def test_a_value_on_more_seeds_is_better_even_if_later() -> None:
    results = made_up(lambda *_: 10.0)
    values = results[LINE, PRINTED].values
    values[ALONE]["converged_at"][:] = [math.inf] * 18 + [5.0, 5.1]
    effect = Judged(results)(LINE, PRINTED, BASELINE, ALONE, 1)
    assert (effect.own.n, effect.base.n, effect.apart.n) == (20, 2, 2)
    # In most pairs the other side never converges: no finite number is the typical difference.
    assert effect.apart.mean == -math.inf
    assert effect.verdict == HELPS


def test_the_page_says_what_the_numbers_say(judged: Judged) -> None:
    text = page(judged, judged)
    first = next(line for line in text.splitlines() if line.startswith("1. "))
    helped = judged(LINE, PRINTED, BASELINE, ALONE).share[0]
    assert f"**helps** in A (−{abs(100 * helped):.0f} % [" in first
    assert "**hurts** in B (+" in first
    assert first.index(NOT_SIGNIFICANT) < first.index("C ideal")
    assert "0 of the" in text  # no verdict differs from that of the same test
    assert "nan" not in text
    # Every table is whole: a row for each question, and for each controller and metric.
    for table in re.findall(r"(?:^\|.*\n)+", text, re.M):
        assert len({row.count("|") for row in table.splitlines()}) == 1
    rows = sum(line.startswith("|") for line in text.splitlines())
    both = sum(len(controllers(judged.results[s, PRINTED])) for s in CONFIGURATIONS) * 2
    tables = 1 + sum(map(len, METRICS.values()))
    assert rows == 2 * tables + both + len(ALL)


def test_a_run_that_failed_is_listed() -> None:
    results = made_up(lambda *_: 1.0)
    bad = results[LINE, PRINTED]
    bad.values[ALONE]["position_mae"][4] = math.inf
    results[LINE, PRINTED] = Measured(
        bad.values, SEEDS, ("line: no adaptive part, seed 4: it fell",)
    )
    judged = Judged(results)
    text = page(judged, judged)
    assert "* line: no adaptive part, seed 4: it fell" in text
    assert "(19 of 20)" in text


def test_measured_is_what_the_graph_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Through files, workers and index, and again from the folder without running anything."""
    (tmp_path / "line.yaml").write_text(
        "experiment: line\ngraph: line_actuator_failure\nseeds: 20..21\nuntil: 0.5\n"
        "variants: {no adaptive part: {without: adaptive}}\n"
    )
    monkeypatch.setattr(runs, "EXPERIMENTS", tmp_path)
    found = runs.measure(LINE, PRINTED, tmp_path, engine="python")
    assert found.seeds == (20, 21)
    graph = runtime.load("line_actuator_failure").set("run.until", 0.5)
    for name, variant in ((BASELINE, graph), (ALONE, graph.without("adaptive"))):
        direct = [variant.run(seed=seed).metrics["position_mae"] for seed in (20, 21)]
        assert found(name, "position_mae") == direct

    def refused(*_: object) -> None:
        raise AssertionError("it was run again")

    monkeypatch.setattr(runs.RunOptions, "make_pool", refused)
    assert runs.measure(LINE, PRINTED, tmp_path, engine="python") == found
    with pytest.raises(runtime.UsageError, match="belongs to a different plan"):
        runs.measure(LINE, PRINTED, tmp_path, Seeds(((1, 2),)), "python")
