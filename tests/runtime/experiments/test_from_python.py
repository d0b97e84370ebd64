"""Sweeps and ablations from Python: tables of the same numbers as single runs."""

from __future__ import annotations

import gc
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import runtime
from runtime.document import parse_yaml
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal


def test_a_sweep_has_the_numbers_of_single_runs(draw: Path) -> None:
    graph = runtime.load(draw)
    levels, seeds = np.linspace(0.0, 2.0, 3), range(3)
    table = runtime.sweep(graph, {"draw.level": levels}, seeds=seeds, maximize="drawn", jobs=2)
    assert table.factors == ("draw.level",)
    assert [trial.values["draw.level"] for trial in table.trials] == [
        *(level for level in levels for _ in seeds),
    ]
    for found, level in zip(table.configurations, levels, strict=True):
        values = [level + normal(seed) for seed in seeds]
        assert found.metrics["drawn"].mean == pytest.approx(np.mean(values), rel=1e-12)
        low, _ = stats.t.interval(0.95, 2, np.mean(values), stats.sem(values))
        assert found.metrics["drawn"].low == pytest.approx(low, rel=1e-9)
        single = graph.set("draw.level", level).run(seed=1).metrics
        [same] = [t for t in table.trials if t.seed == 1 and t.values["draw.level"] == level]
        assert same.metrics == single
    assert table.best is not None
    assert table.best.values == {"draw.level": 2.0}
    frame = table.to_dataframe()
    assert list(frame.columns) == [
        *("draw.level", "seed", "status", "drawn", "total", "above_two"),
    ]
    assert frame["drawn"].tolist() == [trial.metrics["drawn"] for trial in table.trials]
    assert frame.attrs["units"] == {"above_two": "s"}
    text = repr(table)
    assert "sweep draw: 3 configurations x 3 seeds: 9 ok" in text
    assert "above_two [s]" in text
    assert "largest drawn: " in text
    assert max(map(len, text.splitlines())) <= 80


def test_an_ablation_has_the_differences_of_single_runs(draw: Path) -> None:
    graph = runtime.load(draw)
    table = runtime.ablate(graph, {"no half": graph.without("half")}, seeds="0..2", jobs=2)
    assert table.variants == ("baseline", "no half")
    found = table.line("no half", "total")
    # The sum loses half of twice the number.
    apart = [-normal(seed) - 1.0 for seed in range(3)]
    assert found.difference is not None
    assert found.difference.mean == pytest.approx(np.mean(apart), rel=1e-12)
    assert found.difference.p == pytest.approx(stats.ttest_1samp(apart, 0.0).pvalue, rel=1e-9)
    assert "no half" in repr(table)
    assert len(table.to_dataframe()) == 6
    with pytest.raises(KeyError, match=r"variants: baseline, no half; metrics: drawn, total"):
        table.line("no half", "totl")
    every = runtime.ablate(draw, seeds=1, jobs=2)
    assert set(every.variants) == {"baseline", "bypass twice", "bypass half", "without sum"}
    assert "draw" in every.essential


def test_a_notebook_shows_tables_and_figures(draw: Path) -> None:
    class Tags(HTMLParser):
        """Counts tags, and checks that they are closed."""

        def __init__(self) -> None:
            super().__init__()
            self.open: list[str] = []
            self.seen: list[str] = []

        def handle_starttag(self, tag: str, attrs: object) -> None:
            self.seen.append(tag)
            if tag != "img":
                self.open.append(tag)

        def handle_endtag(self, tag: str) -> None:
            assert self.open.pop() == tag

    graph = runtime.load(draw)
    swept = runtime.sweep(graph, {"draw.level": [0.0, "<b>", 1.0][::2]}, seeds=2, jobs=1)
    ablated = runtime.ablate(graph, {"<i>half</i>": graph.without("half")}, seeds="0,1", jobs=1)
    for table in (swept, ablated):
        tags = Tags()
        tags.feed(table._repr_html_())
        assert tags.open == []
        assert tags.seen.count("table") == 1
        assert tags.seen.count("img") == len(table.plot()) == 1
        assert "i" not in tags.seen


def test_a_folder_of_ones_own_is_continued(draw: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    factors = {"draw.level": [0.0, 1.0]}
    first = runtime.sweep(draw, factors, seeds="0,1", folder=folder, jobs=2)
    index = (folder / "index.csv").read_text()
    (folder / "index.csv").write_text("".join(index.splitlines(keepends=True)[:3]))
    with pytest.raises(runtime.UsageError, match="exists already; resume=True continues it"):
        runtime.sweep(draw, factors, seeds="0,1", folder=folder)
    again = runtime.sweep(draw, factors, seeds="0,1", folder=folder, resume=True, jobs=2)
    assert [t.metrics for t in again.trials] == [t.metrics for t in first.trials]
    with pytest.raises(runtime.UsageError, match="belongs to a different plan"):
        runtime.sweep(draw, factors, seeds="0,2", folder=folder, resume=True)


def test_a_call_and_a_command_make_the_same_plan(here: Run, draw: Path, tmp_path: Path) -> None:
    """Equal digests: of the same graphs, factors, seeds and metrics; and the same rows."""
    graph = runtime.load(draw)
    quiet = ("--no-plots", "-q", "-j", "1", "--name", "command")
    range_ = "0..2"
    sampled = ("--vary", f"draw.level={range_}", "--sobol", "4", "--sampling-seed", "3")
    assert here("sweep", "draw.yaml", *sampled, "--seeds", "0..1", *quiet).returncode == 0
    runtime.sweep(
        *(graph, {"draw.level": range_}),
        **{"sobol": 4, "sampling_seed": 3, "seeds": "0..1", "jobs": 1},
        folder=tmp_path / "sweeps" / "call",
    )
    assert here("ablate", "draw.yaml", "--bypass", "half", "--seeds", "3", *quiet).returncode == 0
    variants = {"bypass half": graph.bypass("half")}
    folder = tmp_path / "ablations" / "call"
    runtime.ablate(graph, variants, seeds=3, jobs=1, folder=folder)
    for kind in ("sweeps", "ablations"):
        plans, rows = [], []
        for name in ("command", "call"):
            text = (tmp_path / kind / name / "plan.yaml").read_text()
            plans.append(parse_yaml(text, "plan").plain()["digest"])
            lines = (tmp_path / kind / name / "index.csv").read_text().splitlines()
            rows.append([line.rpartition(",")[0] for line in lines[1:]])  # without the duration
        assert plans[0] == plans[1]
        assert sorted(rows[0]) == sorted(rows[1])


@pytest.mark.parametrize(
    ("options", "arguments", "message"),
    [
        (("--sobol", "0"), {"sobol": 0}, "expected an integer from 1 to 1000000000, got 0"),
        (("--sampling-seed", "-1"), {"sampling_seed": -1}, "expected an integer from 0 to"),
        (("--seeds", "3..1"), {"seeds": "3..1"}, "expected seeds such as .*; 3..1 is empty"),
        (("--minimize", "drwn"), {"minimize": "drwn"}, "no metric 'drwn', did you mean 'drawn'"),
        (("--keep", "best:0"), {"keep": "best:0"}, "expected all, failed, best:N or none"),
    ],
)
def test_a_call_and_a_command_are_refused_by_the_same_message(
    here: Run, draw: Path, options: tuple[str, ...], arguments: dict[str, Any], message: str
) -> None:
    done = here("sweep", "draw.yaml", "--vary", "draw.level=[0, 1]", *options)
    assert done.returncode == 2
    assert re.search(message, done.stderr), done.stderr
    with pytest.raises(runtime.SpikeblocksError, match=message):
        runtime.sweep(draw, {"draw.level": [0, 1]}, **arguments)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"trials": 0}, "trials: expected an integer from 1 to 1000000, got 0"),
        ({"batch": -1}, "batch: expected an integer from 1 to 4096, got -1"),
        ({"sampler": "best"}, "sampler: expected one of tpe, nsga2, sobol, random, got"),
        ({"over": "median"}, "over: expected one of mean, worst, got"),
        ({"constraints": ["drawn under 3"]}, "constraints: expected a constraint as 'effort below"),
        ({"constraints": {"drawn": {"under": 3}}}, "under"),
    ],
)
def test_a_tuning_that_cannot_work_is_refused(
    draw: Path, arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(runtime.SpikeblocksError, match=message):
        runtime.tune(draw, {"draw.level": "0..1"}, **arguments)


def test_a_temporary_folder_goes_with_its_table(draw: Path) -> None:
    table = runtime.sweep(draw, seeds="0,1", jobs=1)
    folder = table.folder
    assert (folder / "index.csv").is_file()
    del table
    gc.collect()
    assert not folder.parent.exists()


def test_failed_trials_are_rows(draw: Path) -> None:
    table = runtime.sweep(draw, {"draw.how": ["fine", "raise"]}, seeds="0,1", jobs=2)
    assert [trial.status for trial in table.trials] == ["ok", "ok", "failed", "failed"]
    assert table.configurations[1].metrics["drawn"].n == 0
    assert "2 failed, 2 ok" in repr(table)
    assert "2 x " in repr(table)
    assert "0/2" in repr(table)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda g: runtime.sweep(g), "there is nothing to vary"),
        (lambda g: runtime.sweep(g, {"draw.levl": [1]}), "unknown parameter, did you mean 'level'"),
        (lambda g: runtime.sweep(g, {"draw.level": "0..1"}), "how many values"),
        (lambda g: runtime.sweep(g, {"draw.level": []}), "vary: draw.level: an empty list"),
        (lambda g: runtime.sweep(g, seeds="x"), "expected seeds such as"),
        (lambda g: runtime.sweep(g, seeds="0,1", minimize="nope"), "no metric 'nope'"),
        (lambda g: runtime.sweep(g, seeds=2, random=1, sobol=1), "keep one"),
        (lambda g: runtime.ablate(g, {"baseline": g}), "duplicate variant 'baseline'"),
        (lambda g: runtime.ablate(g.set("metrics", {})), "no metrics to compare"),
    ],
)
def test_a_call_that_cannot_work_is_refused(draw: Path, call: object, message: str) -> None:
    assert callable(call)
    with pytest.raises(runtime.SpikeblocksError, match=message):
        call(runtime.load(draw))
