"""Reports of sweeps and ablations show the statistics of their indexes."""

from __future__ import annotations

import csv
import json
import re
import shutil
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from runtime.errors import UsageError
from runtime.files import check_form
from runtime.reports import report
from tests.browser import elements, find, load, measure, rows
from tests.conftest import Run
from tests.runtime.experiments.graphs import MODULE

SEEDS = 4
GRAPH = """
graph: draw
run: {dt: 0.01, until: 0.05}
blocks:
  draw: {type: Draw, module: own.py, level: 1.0}
  twice: {type: Gain, gain: 2.0}
  half: {type: Gain, gain: 0.5}
  sum: {type: Sum}
wires:
  twice: {input: draw.out}
  half: {input: twice.out}
  sum: {terms: [draw.out, half.out]}
metrics:
  drawn: {kind: final, of: draw.out}
  total: {kind: final, of: sum.out}
  above_two: {kind: first_time, of: draw.out, level: 2.0}
"""
CONTEST = """
experiment: gains
graph: draw.yaml
minimize: total
constraints: {drawn: {above: -100}}
trials: 3
repeats: 2
training: {seeds: 0..1}
held_out: {seeds: 10..15, conditions: {a: {}}}
contestants:
  gain: {vary: {half.gain: 0.4..1.9}}
  alone: {without: half}
  <b>fails</b>: {set: {draw.how: raise}}
"""


@pytest.fixture(scope="module")
def folders(run_in: Run, tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """An ablation, and sweeps over one factor and over three, half of whose trials fail."""
    root = tmp_path_factory.mktemp("experiments")
    (root / "own.py").write_text(MODULE)
    (root / "draw.yaml").write_text(GRAPH)

    def run(*arguments: str) -> None:
        done = run_in(root, *arguments, "--no-plots", "-q", "-j", "1")
        assert done.returncode == 0, done.stderr

    seeds = ("--seeds", f"0..{SEEDS - 1}")
    run("ablate", "draw.yaml", *seeds, "--bypass", "twice", "--without", "half")
    level = "draw.level=-1..2:3"
    run("sweep", "draw.yaml", *seeds, "--vary", level, "--name", "one", "--maximize", "total")
    others = ("--vary", "half.gain=[0.5, 1]", "--vary", "draw.how=[fine, raise]")
    run("sweep", "draw.yaml", *seeds, "--vary", level, *others, "--name", "three")
    found = {name: root / "sweeps" / name for name in ("one", "three")}
    if find_spec("optuna"):
        goals = ("--minimize", "drawn", "--maximize", "total", "--held-out", "10..12")
        run("tune", "draw.yaml", *seeds, "--vary", "draw.level=0..5", *goals, "--trials", "6")
        found["tuning"] = root / "tunings" / "draw"
        (root / "gains.yaml").write_text(CONTEST)
        run("contest", "gains.yaml")
        found["contest"] = root / "contests" / "gains"
    return {**found, "ablation": root / "ablations" / "draw"}


@pytest.fixture(scope="module")
def pages(folders: dict[str, Path]) -> dict[str, Path]:
    written = {}
    for name, folder in folders.items():
        written[name] = folder.parent / f"{name}.html"
        written[name].write_text(report(folder).html, encoding="utf-8")
    return written


def _index(folder: Path) -> list[dict[str, str]]:
    with (folder / "index.csv").open(newline="") as lines:
        return sorted(csv.DictReader(lines), key=lambda row: int(row["trial"]))


def _number(text: str) -> float:
    """A number as a report shows it."""
    return float(text.replace("−", "-"))


def _interval(text: str) -> list[float]:
    return [_number(end) for end in text.strip("[]").split(", ")]


@pytest.mark.slow
def test_pages_load_without_messages_and_fit_a_phone(pages: dict[str, Path]) -> None:
    for page in (pages["ablation"], pages["three"]):
        loaded = load(page)
        assert loaded.console == []
        assert not find(loaded.html, "script")
    found = measure(pages["ablation"], 360)
    assert found["width"] <= 360
    assert found["wide"] == []


@pytest.mark.slow
def test_the_table_of_an_ablation_agrees_with_its_index(
    folders: dict[str, Path], pages: dict[str, Path]
) -> None:
    index = _index(folders["ablation"])
    names = ["baseline", "bypass twice", "without half"]
    values = {
        name: np.array([float(row["total"]) for row in index if row["variant"] == name])
        for name in names
    }
    html = load(pages["ablation"]).html
    table = [row for row in rows(html, "differences") if len(row) > 1]
    assert [row[0] for row in table] == names * 3
    for row in table[3:6]:
        mine = values[row[0]]
        low, high = stats.t.interval(0.95, SEEDS - 1, mine.mean(), stats.sem(mine))
        assert row[1] == str(SEEDS)
        assert _number(row[2]) == pytest.approx(mine.mean(), rel=1e-3)
        assert _interval(row[3]) == pytest.approx([low, high], rel=1e-3)
        apart = mine - values["baseline"]
        if row[0] == "baseline":
            assert row[4:] == ["", "", "", ""]
            continue
        low, high = stats.t.interval(0.95, SEEDS - 1, apart.mean(), stats.sem(apart))
        assert _number(row[4]) == pytest.approx(apart.mean(), rel=1e-3)
        assert _interval(row[5]) == pytest.approx([low, high], rel=1e-3)
    # The blocks after it do not affect it.
    assert {row[7] for row in table[1:3]} == {"equal"}
    groups = [e.text for e in find(html, "th", scope="rowgroup")]
    assert groups == ["drawn", "total", "above_two [s]"]


@pytest.mark.slow
def test_an_ablation_shows_its_figure_and_a_diagram_for_each_variant(
    pages: dict[str, Path],
) -> None:
    every = elements(load(pages["ablation"]).html)
    figure = [e for e in every if e.inside("figure", id="figure-1")]
    message = {e.text.strip() for e in figure if e.tag == "text"}
    assert {"drawn", "total", "above_two [s]", "baseline", "bypass twice"} <= message
    shown = [e for e in every if e.inside("section", id="diagrams")]
    titles = [e.text for e in shown if e.tag == "h3"]
    assert titles == ["baseline", "bypass twice", "without half"]
    greyed = [e for e in shown if e.attributes.get("data-kind") == "removed block"]
    assert [e.attributes["data-name"] for e in greyed] == ["twice", "half"]
    ids = [e.attributes["id"] for e in every if "id" in e.attributes]
    assert len(ids) == len(set(ids))


def test_the_tables_of_a_sweep_agree_with_its_index(
    folders: dict[str, Path], pages: dict[str, Path]
) -> None:
    index = _index(folders["one"])
    html = load(pages["one"]).html
    means = {
        level: np.mean([float(r["total"]) for r in index if float(r["draw.level"]) == level])
        for level in (-1.0, 0.5, 2.0)
    }
    best = rows(html, "best configurations")
    assert [float(row[0]) for row in best] == sorted(means, key=lambda v: -means[v])
    heads = [e.text for e in find(html, "th", scope="col")]
    # The objective comes first.
    assert heads[:4] == ["draw.level", "ok", "total", "drawn"]
    every = rows(html, "all configurations")
    assert [float(row[0]) for row in every] == sorted(means)
    for row in every:  # the best ones have no interval
        mine = [float(r["total"]) for r in index if float(r["draw.level"]) == float(row[0])]
        low, high = stats.t.interval(0.95, SEEDS - 1, np.mean(mine), stats.sem(mine))
        assert row[1] == f"{SEEDS}/{SEEDS}"
        assert _number(row[2]) == pytest.approx(means[float(row[0])], rel=1e-3)
        assert _interval(row[3]) == pytest.approx([low, high], rel=1e-3)
    facts = dict(zip(*[[e.text for e in find(html, tag)] for tag in ("dt", "dd")], strict=True))
    assert (facts["trials"], facts["configurations"], facts["seeds"]) == ("12", "3", "0..3")


def test_failed_trials_are_counted_by_reason(pages: dict[str, Path]) -> None:
    html = pages["three"].read_text(encoding="utf-8")
    (lead,) = find(html, "p", class_="lead")
    assert lead.text.endswith("draw.how = [fine, raise], to minimize drawn.")
    assert rows(html, "trials by status") == [["failed", "24"], ["ok", "24"]]
    reasons = rows(html, "reasons")
    assert all("it broke, on purpose" in reason for reason, _ in reasons)
    assert sum(int(count) for _, count in reasons) == 24
    every = rows(html, "all configurations")
    assert len(every) == 12
    assert [row[3] for row in every if row[2] == "raise"] == [f"0/{SEEDS}"] * 6
    assert {row[4] for row in every if row[2] == "raise"} == {"failed, 0 of 4"}


def test_figures_of_a_sweep_depend_on_its_number_of_factors(pages: dict[str, Path]) -> None:
    one, three = (pages[name].read_text(encoding="utf-8") for name in ("one", "three"))
    (caption,) = find(one, "figcaption")
    assert "over the factor" in caption.text
    captions = [e.text for e in find(three, "figcaption")]
    assert [text.split(":")[1].split(",")[0] for text in captions] == [
        *(" drawn", " total", " above_two"),
    ]


def test_a_sweep_that_is_not_complete_is_reported_up_to_where_it_ended(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    folder = Path(shutil.copytree(folders["one"], tmp_path / "one"))
    lines = (folder / "index.csv").read_text().splitlines(keepends=True)
    (folder / "index.csv").write_text("".join(lines[:6]))
    (folder / "summary.json").unlink()
    html = report(folder).html
    facts = dict(zip(*[[e.text for e in find(html, tag)] for tag in ("dt", "dd")], strict=True))
    assert facts["trials"] == "5 of 12"
    assert facts["wall time"] == "unknown"
    (folder / "index.csv").write_text(lines[0])
    assert "0 of 12" in report(folder).html


def test_an_ablation_without_results_is_refused(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["ablation"], tmp_path / "x"))
    facts = json.loads((folder / "ablation.json").read_text())
    for change, message in (
        ({"table": facts["table"][1:]}, "expected a line for each metric and variant"),
        ({"seeds": ["x"]}, r"seeds\[0\]: expected a number, got 'x'"),
        ({"variants": [{**facts["variants"][0], "slug": "../x"}]}, "expected a line|not the name"),
        ({"metrics": None}, "metrics: expected a list, got 'None'"),
    ):
        (folder / "ablation.json").write_text(json.dumps({**facts, **change}))
        with pytest.raises(UsageError, match=f"ablation.json' is damaged: .*({message})"):
            report(folder)
    (folder / "ablation.json").unlink()
    with pytest.raises(UsageError, match="without results.*--resume"):
        report(folder)
    with pytest.raises(UsageError, match="did you mean '.*/x'"):
        report(tmp_path)


def test_a_missing_diagram_is_replaced_by_a_note(folders: dict[str, Path], tmp_path: Path) -> None:
    folder = Path(shutil.copytree(folders["ablation"], tmp_path / "x"))
    drawn = sorted((folder / "diagrams").glob("*.json"))
    drawn[0].unlink()
    drawn[1].write_text("{")
    html = report(folder).html
    assert len(re.findall("The diagram cannot be read", html)) == 1
    assert len(re.findall("This folder has no diagram", html)) == 1


@pytest.mark.parametrize(
    ("kind", "file", "old", "new", "entry"),
    [
        ("one", "plan.yaml", "maximize: total", "maximize: drawn", "maximize"),
        ("one", "plan.yaml", "\nseeds: ", "\nseeds: 9,", "seeds"),
        ("one", "plan.yaml", "\ntotal: ", "\ntotal: 1", "total"),
        ("ablation", "plan.yaml", "bypass", "without", "variants"),
        ("ablation", "ablation.json", '"mean": ', '"mean": 1', "table"),
        ("tuning", "plan.yaml", "\nover: mean", "\nover: worst", "over"),
        ("tuning", "tuning.json", '"n": ', '"n": 1', "table"),
        ("tuning", "tuning.json", '"status": "complete"', '"status": "interrupted"', "status"),
    ],
)
def test_an_entry_that_was_changed_later_is_named(
    folders: dict[str, Path], tmp_path: Path, kind: str, file: str, old: str, new: str, entry: str
) -> None:
    """Each of these would be a valid file with another number in it; its digest still fits."""
    if kind not in folders:
        pytest.skip("needs pip install -e '.[tune]'")
    folder = Path(shutil.copytree(folders[kind], tmp_path / "x"))
    path = folder / file
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    before = {each: each.read_bytes() for each in folder.rglob("*") if each.is_file()}
    message = f"{file}' is damaged: its entry '{entry}' was changed after it was written"
    with pytest.raises(UsageError, match=message):
        report(folder)
    assert {each: each.read_bytes() for each in folder.rglob("*") if each.is_file()} == before


def test_forms_of_plain_data() -> None:
    form = {"a": [{"b": (int, type(None))}], "c": float, "d": bool}
    check_form({"a": [{"b": 1}, {"b": None, "x": 0}], "c": 0.5, "d": True}, form)
    for value, message in (
        ([], "top level: expected an object"),
        ({"a": [], "c": 0.5}, "d is missing"),
        ({"a": [{"b": True}], "c": 0.5, "d": True}, r"a\[0\].b: expected a number or null"),
        ({"a": [{"b": 10**400}], "c": 0.5, "d": True}, r"a\[0\].b: expected"),
        ({"a": [], "c": "x", "d": True}, "c: expected a number, got 'x'"),
        ({"a": [], "c": 0.5, "d": 1}, "d: expected true or false"),
    ):
        with pytest.raises(ValueError, match=message):
            check_form(value, form)


@pytest.mark.skipif(not find_spec("optuna"), reason="needs pip install -e '.[tune]'")
def test_the_tables_of_a_tuning_agree_with_its_results(
    folders: dict[str, Path], pages: dict[str, Path]
) -> None:
    stored = json.loads((folders["tuning"] / "tuning.json").read_text())
    html = pages["tuning"].read_text()
    winners = rows(html, "winners")
    assert [int(row[0]) for row in winners] == stored["front"]
    # Metric by metric, as on a terminal.
    metrics = [line["metric"] for line in stored["table"]]
    table = sorted(stored["table"], key=lambda line: metrics.index(line["metric"]))
    for line, shown in zip(table, rows(html, "training and held-out runs"), strict=True):
        assert shown[1] == (str(line["configuration"]) if line["configuration"] else "baseline")
        for column, runs in ((2, "training"), (6, "held_out")):
            assert _number(shown[column]) == pytest.approx(line[runs]["mean"], rel=1e-3)
            ends = [line[runs]["low"], line[runs]["high"]]
            if line["configuration"] and runs == "training":  # which have chosen it
                assert ends == [None, None] and shown[column + 1] == "–"
            else:
                assert _interval(shown[column + 1]) == pytest.approx(ends, rel=1e-3)
        assert _number(shown[-1]) == pytest.approx(line["optimism"], rel=1e-3)
    assert len(rows(html, "configurations")) == 6
    captions = [e.text for e in find(html, "figcaption")]
    assert len(captions) == 4


@pytest.mark.skipif(not find_spec("optuna"), reason="needs pip install -e '.[tune]'")
def test_a_tuning_without_results_and_a_damaged_one(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    folder = tmp_path / "draw"
    shutil.copytree(folders["tuning"], folder)
    (folder / "tuning.json").write_text('{"experiment": 3}')
    with pytest.raises(UsageError, match=r"tuning.json' is damaged: experiment: expected a string"):
        report(folder)
    (folder / "tuning.json").unlink()
    with pytest.raises(UsageError, match="has no results yet; 'runtime tune' with --resume"):
        report(folder)


@pytest.mark.skipif(not find_spec("optuna"), reason="needs pip install -e '.[tune]'")
def test_the_tables_of_a_contest_agree_with_its_results(
    folders: dict[str, Path], pages: dict[str, Path]
) -> None:
    stored = json.loads((folders["contest"] / "contest.json").read_text())
    html = pages["contest"].read_text()
    assert stored["constraints"] == ["drawn above -100"]  # once, though each contestant has it
    assert " with drawn above -100, on seeds 0..1" in html
    shown = [row for row in rows(html, "differences") if len(row) > 1]
    assert len(shown) == len(stored["table"]) == 8
    for row, line in zip(shown, stored["table"], strict=True):
        reference = line["reference"]
        assert row[0] == f"{line['variant']} - {reference}" if reference else line["variant"]
        if line["n"]:
            assert _number(row[2]) == pytest.approx(line["mean"], rel=1e-3)
        assert row[-1] == (line["difference"]["verdict"] if reference else "")
    tuned = rows(html, "tuned values")
    assert [row[0] for row in tuned] == ["gain", "gain", "alone", "alone", *["<b>fails</b>"] * 2]
    own = [each for tunings in stored["contestants"].values() for each in tunings]
    assert [int(row[4]) for row in tuned] == [each["runs"] for each in own]
    assert tuned[-1][-1] == "its own"
    failures = rows(html, "failures")
    assert {row[0] for row in failures} == {"<b>fails</b>"}
    assert all(int(row[2]) == 2 + 6 for row in failures)  # of each tuning: training, held out
    scores = [each["metrics"]["total"] for each in stored["contestants"]["gain"]]
    found = [e.text for e in elements(html) if e.tag == "li"]
    expected = f"gain: total of 2 tunings from {min(scores):.4g} to {max(scores):.4g}"
    assert len(found) == 1 and found[0].startswith(expected)
    figure = [e for e in elements(html) if e.inside("figure", id="figure-1")]
    words = {e.text.strip() for e in figure if e.tag == "text"}
    assert {"gain", "alone", "failed, 0 of 6 ▸"} <= words
    assert find(html, "figcaption")[0].text.startswith("Metrics by contestant")


@pytest.mark.skipif(not find_spec("optuna"), reason="needs pip install -e '.[tune]'")
def test_a_contest_that_was_changed_later_is_refused(
    folders: dict[str, Path], tmp_path: Path
) -> None:
    path = tmp_path / "contest.json"
    text = (folders["contest"] / "contest.json").read_text()
    path.write_text(text.replace('"trials": 3', '"trials": 30'))
    with pytest.raises(UsageError, match=r"was changed after it was written; 'runtime contest'"):
        report(path)
    path.write_text("{}")
    with pytest.raises(UsageError, match=r"contest.json' is damaged: experiment is missing"):
        report(tmp_path)
    with pytest.raises(UsageError, match="did you mean"):
        report(folders["contest"].parent)
