"""``runtime sweep`` through the real console script."""

from __future__ import annotations

import csv
import json
import os
import re
import resource
import shutil
from collections.abc import Callable
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest

import runtime
from runtime.document.node import parse_yaml
from runtime.experiments.design.experiment import read_experiment
from runtime.experiments.design.request import Request
from runtime.experiments.execution.folder import read_plan
from runtime.experiments.execution.index import Columns, Index
from runtime.experiments.execution.plan import sweep_plan
from runtime.runs import program
from tests.compilers import needs_compiler
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

TWO = ("sweep", "draw.yaml", "-j", "2")


def rows(folder: Path) -> list[dict[str, str]]:
    """The rows of an index in the order of their trials, without their wall time."""
    with (folder / "index.csv").open(newline="") as lines:
        found = list(csv.DictReader(lines))
    for row in found:
        assert float(row.pop("wall_s")) >= 0.0
    return sorted(found, key=lambda row: int(row["trial"]))


def test_a_grid_with_seeds_has_a_row_per_trial(cli: Run, draw: Path, tmp_path: Path) -> None:
    vary = ("--vary", "draw.level=[0.5, 1.5]", "--vary", "params.gain=1..3:3")
    done = cli(*TWO, *vary, "--seeds", "3..4")
    assert done.returncode == 0, done.stderr
    found = rows(tmp_path / "sweeps" / "draw")
    expected = [
        (level, gain, seed) for level in (0.5, 1.5) for gain in (1.0, 2.0, 3.0) for seed in (3, 4)
    ]
    assert [int(row["trial"]) for row in found] == list(range(12))
    assert [
        (float(row["draw.level"]), float(row["params.gain"]), int(row["seed"])) for row in found
    ] == expected
    for row, (level, gain, seed) in zip(found, expected, strict=True):
        out = level + normal(seed)
        assert float(row["drawn"]) == out
        assert float(row["total"]) == out + 0.5 * (gain * out)
        assert row["above_two"] == ("0.0" if out > 2.0 else "")
        assert (row["status"], row["reason"]) == ("ok", "")
    assert (tmp_path / "sweeps" / "draw" / "plots" / "maps.png").read_bytes()[1:4] == b"PNG"
    # The interval of the best of six would not cover its mean.
    assert "smallest drawn, mean over seeds:" in done.stdout and "[" not in done.stdout
    assert "chosen among 6 by these runs" in done.stdout


def test_seeds_alone_are_a_sweep(here: Run, draw: Path, tmp_path: Path) -> None:
    done = here(*TWO, "--seeds", "0..7", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert (summary["factors"], summary["plots"]) == ([], [])
    [best] = summary["best"]
    assert best["n"] == 8
    assert best["mean"] == pytest.approx(1.0 + sum(map(normal, range(8))) / 8)
    assert [row["seed"] for row in rows(tmp_path / "sweeps" / "draw")] == list("01234567")


@needs_compiler
def test_all_trials_have_one_engine() -> None:
    # Compilation does not pay off for two short trials; it does for as many as would take minutes.
    experiment = read_experiment("line_actuator_failure", lambda g: g.set("run.until", 2.0))
    for seeds, engine in (("0..1", "python"), ("0..9999999", "compiled")):
        plan = sweep_plan(Request.of({"seeds": seeds}).apply_to(experiment))
        assert parse_yaml(plan.bundle.text, "g").plain()["run"]["engine"] == engine
    asked = read_experiment("line_actuator_failure", lambda g: g.set("run.engine", "python"))
    plan = sweep_plan(Request.of({"seeds": "0..9999999"}).apply_to(asked))
    assert parse_yaml(plan.bundle.text, "g").plain()["run"]["engine"] == "python"


def test_the_plan_is_an_experiment_that_gives_the_same_rows(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    first = here(*TWO, "--vary", "draw.level=0..1", "--random", "4", "--seeds", "0,5", "--no-plots")
    assert first.returncode == 0, first.stderr
    plan = parse_yaml((tmp_path / "sweeps/draw/plan.yaml").read_text(), "plan").plain()
    assert plan["vary"] == {"draw.level": "0..1"}
    assert (plan["random"], plan["sampling_seed"], plan["total"]) == (4, 0, 8)
    again = here("sweep", "sweeps/draw/plan.yaml", "--name", "again", "--no-plots", "-j", "2")
    assert again.returncode == 0, again.stderr
    assert rows(tmp_path / "sweeps" / "again") == rows(tmp_path / "sweeps" / "draw")


EXPERIMENT = """
experiment: levels
graph: draw.yaml
without: [half]
seeds: 0..1
vary:
  draw.level: [1, 2, 3]
maximize: drawn
"""


def test_an_experiment_file_from_any_folder(cli: Run, draw: Path, tmp_path: Path) -> None:
    (tmp_path / "levels.yaml").write_text(EXPERIMENT)
    (tmp_path / "elsewhere").mkdir()
    done = cli("sweep", "../levels.yaml", "--json", "-j", "2", cwd=tmp_path / "elsewhere")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["counts"] == {"ok": 6}
    assert summary["objective"] == {"metric": "drawn", "goal": "maximize"}
    mean = (normal(0) + normal(1)) / 2
    assert [best["values"] for best in summary["best"]] == [
        {"draw.level": "3"},
        {"draw.level": "2"},
        {"draw.level": "1"},
    ]
    assert summary["best"][0]["mean"] == pytest.approx(3.0 + mean)
    # t(0.975, 1) = 12.7062; the standard error of two values is half their distance.
    half = 12.7062047 * abs(normal(0) - normal(1)) / 2
    assert summary["best"][0]["high"] == pytest.approx(3.0 + mean + half)
    folder = tmp_path / "elsewhere" / "sweeps" / "levels"
    written = json.loads((folder / "summary.json").read_text())
    assert {**written, "plots": summary["plots"]} == summary
    assert [Path(plot).name for plot in summary["plots"]] == ["curves.png"]
    # Without 'half' the sum is the drawn number alone.
    assert all(row["total"] == row["drawn"] for row in rows(folder))


@pytest.mark.slow
def test_an_error_of_a_trial_is_in_its_row(here: Run, draw: Path, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    done = here(
        *(*TWO, "--json", "--no-plots", "--set", f"draw.mark={mark}"),
        *("--vary", "draw.how=[raise, nan, die, die once, slow, fine]", "--timeout", "3"),
        *("--vary", "draw.count=[7]"),
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["counts"] == {"ok": 2, "failed": 2, "lost": 1, "timeout": 1}
    found = {row["draw.how"]: row for row in rows(tmp_path / "sweeps" / "draw")}
    # The location in the user's code, without the worker's folder.
    message = r".*tick 0 \(t = 0 s\): RuntimeError: it broke, on purpose \([a-z_]+\.py:[0-9]+\)"
    assert re.fullmatch(message, found["raise"]["reason"])
    assert "output 'out' is not finite: nan" in found["nan"]["reason"]
    assert found["die"]["status"] == "lost"
    assert found["die"]["reason"] == (
        "its worker died 3 times, the last time: its process was killed by SIGKILL; "
        "if memory ran out, use fewer workers with --jobs"
    )
    assert (found['"die once"']["status"], mark.exists()) == ("ok", True)
    assert found["slow"]["status"] == "timeout"
    assert found["slow"]["reason"].startswith("stopped after 3 s")
    assert float(found["fine"]["drawn"]) == 8.0 + normal(0)
    for how in ("raise", "nan", "die", "slow"):
        assert found[how]["drawn"] == found[how]["total"] == ""


@pytest.mark.parametrize("at", ["start", "first", "later"])
def test_any_exception_of_a_block_makes_its_trial_fail(
    here: Run, draw: Path, tmp_path: Path, at: str
) -> None:
    kinds = ["KeyboardInterrupt", "SystemExit", "GeneratorExit", "BaseException"]
    done = here(
        *(*TWO, "--json", "--no-plots", "--set", f"draw.at={at}", "--keep", "all"),
        *("--vary", f"draw.raises=['', {', '.join(kinds)}]"),
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["counts"] == {"ok": 1, "failed": 4}
    found = {row["draw.raises"]: row for row in rows(tmp_path / "sweeps" / "draw")}
    for kind in kinds:
        row = found[kind]
        assert (row["status"], row["drawn"]) == ("failed", "")
        assert kind in row["reason"]
        assert f"tick {3 if at == 'later' else 0}" in row["reason"]
    assert float(found['""']["drawn"]) == 1.0 + normal(0)
    assert kept(tmp_path / "sweeps" / "draw") == [f"{number:06d}" for number in range(5)]


def test_a_block_that_exits_ends_a_run_as_a_failure(here: Run, draw: Path) -> None:
    done = here("run", "draw.yaml", "--set", "draw.raises=SystemExit", "--set", "draw.at=later")
    assert done.returncode == 3
    assert "block 'draw' at tick 3 (t = 0.03 s): SystemExit: on purpose" in done.stderr
    [folder] = draw.with_name("runs").glob("draw/2*")
    assert runtime.open(folder).ticks == 3


EXIT = "    def {}(self, *_):\n        raise SystemExit(0)\n"


@pytest.mark.parametrize(
    "added", ["raise SystemExit(0)", EXIT.format("validate"), EXIT.format("validate_in")]
)
def test_own_code_cannot_end_the_program(here: Run, draw: Path, added: str) -> None:
    module = draw.with_name("own.py")
    module.write_text(f"{module.read_text()}\n{added}")
    for verb in ("run", "sweep"):
        done = here(verb, "draw.yaml", *(["--seeds", "0..1"] if verb == "sweep" else []))
        assert done.returncode == 2
        assert "draw.yaml:6:" in done.stderr


def test_texts_of_blocks_are_short_and_no_formulas(here: Run, draw: Path, tmp_path: Path) -> None:
    vary = ("--vary", "draw.how=[long, '=1+1', '@x', fine]", "--vary", "draw.level=[-1, 2]")
    done = here(*TWO, "--no-plots", *vary)
    assert done.returncode == 0, done.stderr
    found = rows(tmp_path / "sweeps" / "draw")
    assert all(len(row["reason"]) < 2100 for row in found)
    assert found[0]["reason"].endswith("characters)")
    assert {row["draw.how"][0] for row in found}.isdisjoint("=+-@")
    assert {row["draw.level"] for row in found} == {"-1", "2"}
    again = here(*TWO, "--no-plots", *vary, "--resume")
    assert again.returncode == 0, again.stderr


def test_links_lead_nowhere(here: Run, draw: Path, tmp_path: Path) -> None:
    sweep = (*TWO, "--no-plots", "--vary", "draw.level=[1, 2]", "--keep", "best:1", "--resume")
    assert here(*sweep).returncode == 0
    folder, outside = tmp_path / "sweeps" / "draw", tmp_path / "outside"
    for name in ("trials", "index.csv", "summary.json", ".summary.json.partial", "trials/000007"):
        inside = folder / name
        there = inside.exists()
        if there:
            inside.rename(outside)
        else:
            outside.mkdir()
        (outside / "000001").mkdir(exist_ok=True) if outside.is_dir() else None
        inside.symlink_to(outside)
        before = sorted(outside.rglob("*")) if outside.is_dir() else outside.read_bytes()
        done = here(*sweep)
        assert done.returncode == 2
        assert f"'sweeps/draw/{name}' is a link" in done.stderr
        assert before == (sorted(outside.rglob("*")) if outside.is_dir() else outside.read_bytes())
        inside.unlink()
        if there:
            outside.rename(inside)
        else:
            shutil.rmtree(outside)


def test_folders_of_other_names_are_kept(here: Run, draw: Path, tmp_path: Path) -> None:
    sweep = (*TWO, "--no-plots", "--vary", "draw.level=[1, 2]", "--keep", "best:1", "--resume")
    assert here(*sweep).returncode == 0
    stray = tmp_path / "sweeps" / "draw" / "trials" / "0abc"
    stray.touch()
    done = here(*sweep)
    assert (done.returncode, stray.exists()) == (0, True), done.stderr


@pytest.mark.slow
def test_a_sweep_needs_little_of_the_system(cli: Run, draw: Path, tmp_path: Path) -> None:
    deep = tmp_path / ("d" * 100)
    deep.mkdir()
    done = cli(
        *("sweep", "draw.yaml", "--no-plots", "-j", "200", "--timeout", "1e10", "--json"),
        *("--vary", "draw.level=0..1:150"),
        env={**os.environ, "TMPDIR": str(deep)},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)),
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["counts"] == {"ok": 150}
    assert not list(deep.iterdir())


def test_a_sweep_without_any_number_ends_with_3(here: Run, draw: Path) -> None:
    done = here(*TWO, "--vary", "draw.how=[raise, nan]")
    assert done.returncode == 3
    assert "1 x block 'draw' at tick 0" in done.stderr


def test_values_that_do_not_go_together_are_rows(here: Run, draw: Path, tmp_path: Path) -> None:
    done = here(
        *(*TWO, "--no-plots", "--vary", "draw.level=[0, 90]"),
        *("--vary", "bypass=[[], [twice]]", "--vary", "without=[[], [twice, half]]"),
    )
    assert done.returncode == 0, done.stderr
    found = rows(tmp_path / "sweeps" / "draw")
    invalid = [row for row in found if row["status"] == "invalid"]
    assert [(row["bypass"], row["without"]) for row in invalid] == [
        ("[twice]", "[twice, half]"),
        ("[twice]", "[twice, half]"),
    ]
    assert "'twice' is in 'without' as well" in invalid[0]["reason"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ([], "there is nothing to vary; add --vary PATH=VALUES, or more --seeds"),
        (["--seeds", "0..3", "--random", "4"], "there is nothing to sample for --random"),
        (["--vary", "draw.levl=[1]"], "unknown parameter, did you mean 'level'?"),
        (["--vary", "drw.level=[1]"], "there is no 'drw' in the graph, did you mean 'draw'?"),
        (["--vary", "params.nosuch=[1]"], "params.nosuch: $nosuch is not used"),
        (["--vary", "draw.level=[1, x]"], "--vary draw.level=[1, x]: blocks.draw.level: expected"),
        (["--vary", "draw.level=0..200:3"], "expected a number at most 100, got 200.0"),
        (["--vary", "draw.count=0..1:3"], "expected an integer, got 0.0"),
        (["--vary", "draw.level=5..1:3"], "the range is empty: 5 is not below 1"),
        (["--vary", "draw.level"], "--vary draw.level: expected PATH=VALUES"),
        (["--vary", "draw.level=0..1"], "draw.level=0..1: how many values? Write 0..1:5"),
        (["--vary", "draw.level=[1]", "--vary", "blocks.draw.level=[2]"], "is varied twice"),
        (["--vary", "run.seed=[1]"], "the seed is not a factor; seeds are varied by 'seeds'"),
        (
            ["--vary", "draw.level=[1]", "--seeds", "x"],
            "expected seeds such as 0..9, 3 or 0,4,7..9",
        ),
        (["--vary", "draw.level=[1]", "--seeds", "5..1"], "5..1 is empty"),
        (["--vary", "draw.level=[1]", "--minimize", "drwn"], "did you mean 'drawn'?"),
        (["--vary", "draw.level=[1]", "--keep", "some"], "expected all, failed, best:N or none"),
        (["--vary", "draw.level=[1]", "--keep", "best:0"], "expected all, failed, best:N or none"),
        (["--vary", "draw.level=[1]", "-j", "0"], "expected an integer from 1 to 4096"),
        (["--vary", "draw.level=[1]", "--timeout", "-1"], "expected a number above 0"),
        (["--vary", "draw.level=0..1", "--sobol", "0"], "--sobol 0: expected an integer from 1 to"),
        (["--vary", "draw.level=[1]", "--name", "a/b"], "--name a/b: expected letters, digits"),
        (
            ["--vary", "draw.level=[1]", "--set", "metrics.seed={kind: final, of: draw.out}"],
            "'seed'",
        ),
    ],
)
def test_errors_are_reported_before_anything_runs(
    here: Run, draw: Path, arguments: list[str], message: str
) -> None:
    done = here("sweep", "draw.yaml", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stdout == ""
    assert not draw.with_name("sweeps").exists()


BROKEN = """
experiment: a/b
graf: draw.yaml
graph: draw.yaml
seeds: -3
vary:
  draw.level: 3..1:2
  draw.cont: [1]
random: 0
minimize: drwn
set: {draw.level: x}
"""


def test_an_experiment_file_tells_all_its_mistakes_with_their_places(here: Run, draw: Path) -> None:
    draw.with_name("bad.yaml").write_text(BROKEN.replace("set: {draw.level: x}\n", ""))
    done = here("sweep", "bad.yaml")
    assert done.returncode == 2
    for message in (
        "bad.yaml:2:13: experiment: expected a name of letters",
        "bad.yaml:3:1: graf: unknown key, did you mean 'graph'?",
        "bad.yaml:5:8: seeds: expected seeds such as",
        "bad.yaml:7:15: vary.draw.level: '3..1:2': the range is empty",
        "bad.yaml:8:3: blocks.draw.cont: unknown parameter, did you mean 'count'?",
        "bad.yaml:9:9: random: expected an integer from 1",
        "bad.yaml:10:11: minimize: the graph has no metric 'drwn', did you mean 'drawn'?",
    ):
        assert message in done.stderr
    draw.with_name("bad.yaml").write_text(BROKEN)
    done = here("sweep", "bad.yaml")
    assert "bad.yaml:11:19: blocks.draw.level: expected a number" in done.stderr


def test_a_folder_is_never_mixed_up(here: Run, draw: Path, tmp_path: Path) -> None:
    sweep = (*TWO, "--no-plots", "--vary", "draw.level=[1, 2]")
    assert here(*sweep).returncode == 0
    before = (tmp_path / "sweeps/draw/index.csv").read_bytes()
    for arguments, message in (
        (sweep, "'sweeps/draw' exists already; --resume continues it"),
        ((*sweep, "--seeds", "0..3", "--resume"), "differs in seeds: 0 there, 0..3 here"),
        ((*sweep, "--until", "0.1", "--resume"), "differs in the graph"),
        ((*TWO, "--vary", "draw.level=[1]", "--resume"), "{'draw.level': [1]} here"),
        ((*TWO, "--vary", "draw.level=[1]"), "--name NAME begins another sweep beside it"),
    ):
        done = here(*arguments)
        assert done.returncode == 2
        assert message in done.stderr
    (tmp_path / "own.py").write_text((tmp_path / "own.py").read_text() + "\n")
    assert "differs in the graph" in here(*sweep, "--resume").stderr
    assert (tmp_path / "sweeps/draw/index.csv").read_bytes() == before


def test_a_folder_of_schema_1_is_continued_and_reported(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    """In it, plan.yaml says points and made, and the index and the run folders point."""
    sweep = (*TWO, "--vary", "draw.level=[1, 2, 3]", "--keep", "all", "--no-plots")
    assert here(*sweep).returncode == 0
    folder = tmp_path / "sweeps" / "draw"
    whole = (folder / "index.csv").read_text()
    plan = (folder / "plan.yaml").read_text()
    for new, old in (
        *(("schema_version: 2", "schema_version: 1"), ("\ntotal:", "\npoints:")),
        *(("\nprovenance:", "\nmade:"), ("\nchecks:", "\n# checks:")),
    ):
        assert new in plan
        plan = plan.replace(new, old)
    (folder / "plan.yaml").write_text(plan)
    lines = whole.replace("trial,", "point,", 1).splitlines(keepends=True)
    (folder / "index.csv").write_text("".join(lines[:2]))
    (folder / "trials").rename(folder / "points")
    shutil.rmtree(folder / "points" / "000002")
    assert here("report", "sweeps/draw").returncode == 0
    page = (folder / "report.html").read_text()
    assert "1 of 3" in page and "git commit" in page
    (folder / "index.csv").write_text("".join(lines[:2]) + lines[2][:7])  # cut by a kill
    done = here(*sweep, "--resume")
    assert done.returncode == 0, done.stderr
    found = (folder / "index.csv").read_text().splitlines()
    assert found[0].startswith("point,")
    without_duration = [line.rpartition(",")[0] for line in whole.splitlines()]
    assert [line.rpartition(",")[0] for line in sorted(found[1:])] == sorted(without_duration[1:])
    assert len(list((folder / "points").iterdir())) == 3 and not (folder / "trials").exists()
    done = here("sweep", "sweeps/draw/plan.yaml", "--name", "again", "--no-plots", *sweep[2:])
    assert done.returncode == 0


def test_a_damaged_plan_is_written_again_by_its_own_command(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    sweep = (*TWO, "--vary", "draw.level=[1, 2]", "--no-plots")
    assert here(*sweep).returncode == 0
    plan = tmp_path / "sweeps" / "draw" / "plan.yaml"
    whole = plan.read_text()
    plan.write_text(whole.replace("\ntotal: 2", "\ntotal: 3"))
    refused = here("report", "sweeps/draw")
    assert refused.returncode == 2
    assert "plan.yaml' is damaged: its entry 'total' was changed after it was" in refused.stderr
    assert here(*sweep, "--resume").returncode == 0
    found, expected = (parse_yaml(text, "plan").plain() for text in (plan.read_text(), whole))
    assert {**found, "provenance": 0, "checks": 0} == {**expected, "provenance": 0, "checks": 0}
    assert here("report", "sweeps/draw").returncode == 0


def test_the_index_of_another_plan_is_refused(here: Run, draw: Path, tmp_path: Path) -> None:
    for name, values in (("a", "[1, 2]"), ("b", "[2, 1]")):
        done = here(*TWO, "--no-plots", "--vary", f"draw.level={values}", "--name", name)
        assert done.returncode == 0
    other = (tmp_path / "sweeps/a/index.csv").read_bytes()
    (tmp_path / "sweeps/b/index.csv").write_bytes(other)
    done = here(*TWO, "--vary", "draw.level=[2, 1]", "--name", "b", "--resume")
    assert done.returncode == 2
    assert "'sweeps/b/index.csv' belongs to a different plan: its trial" in done.stderr
    assert (tmp_path / "sweeps/b/index.csv").read_bytes() == other


def kept(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "trials").glob("*"))


@pytest.mark.parametrize(
    ("keep", "numbers"),
    [
        ("all", ["000000", "000001", "000002", "000003"]),
        ("failed", ["000000", "000001"]),
        ("best:1", ["000003"]),
    ],
)
def test_keep(here: Run, draw: Path, tmp_path: Path, keep: str, numbers: list[str]) -> None:
    # Points 0 and 1 raise; of the others, 3 is the smaller.
    vary = ("--vary", "draw.how=[raise, fine]", "--vary", "draw.level=[-5, -9]")
    done = here(*TWO, "--no-plots", *vary, "--keep", keep)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "sweeps" / "draw"
    assert kept(folder) == numbers
    result = runtime.open(folder / "trials" / numbers[-1])
    assert result.status == ("failed" if keep == "failed" else "complete")
    if keep != "failed":
        assert result.metrics["drawn"] == -9.0 + normal(0)
        # The folder can be run again by itself, with its user block.
        again = here(
            "run", "--no-plots", f"sweeps/draw/trials/{numbers[-1]}/graph.resolved.yaml", "--json"
        )
        assert json.loads(again.stdout)["metrics"] == result.metrics


def test_a_bar_and_the_best_so_far_on_a_terminal(
    terminal: Callable[..., bytes], draw: Path
) -> None:
    seen = terminal(*TWO, "--vary", "draw.level=0..1:12", "--no-plots")
    assert "█".encode() in seen
    assert b" left" in seen
    assert f"best drawn {normal(0):.4g} at draw.level=0.0".encode() in seen


def test_a_seed_of_a_sweep_is_a_seed_of_a_run(here: Run, tmp_path: Path) -> None:
    sweep = ("sweep", "sine_estimation_error", "--until", "0.3", "--no-plots", "-j", "2")
    done = here(*sweep, "--vary", "lqr.q=[[0.05, 0.05, 0.05], [1, 1, 1]]", "--seeds", "4..6")
    assert done.returncode == 0, done.stderr
    graph = runtime.load("sine_estimation_error").set("run.until", 0.3)
    for row in rows(tmp_path / "sweeps" / "sine_estimation_error"):
        q = parse_yaml(row["lqr.q"], "q").plain()
        metrics = graph.set("lqr.q", q).run(seed=int(row["seed"])).metrics
        for name, value in metrics.items():
            # "never settled" is the worst value, not a missing one.
            never = "inf" if name in graph.check().observation.metric_never else ""
            assert row[name] == (never if value is None else repr(value))


def test_rows_of_two_programs_are_not_mixed_unless_it_is_asked_for(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    sweep = (*TWO, "--no-plots", "--vary", "draw.level=[1, 2]")
    assert here(*sweep).returncode == 0
    folder = tmp_path / "sweeps" / "draw"
    index, starts = folder / "index.csv", folder / "starts.jsonl"
    whole = index.read_text()
    record = json.loads(starts.read_text())
    assert record["program"] == str(program())
    starts.write_text(starts.read_text().replace(program().fingerprint, "0123456789ab"))
    # Nothing is left to run, so that nothing is mixed.
    assert here(*sweep, "--resume").returncode == 0

    index.write_text("".join(whole.splitlines(keepends=True)[:2]))
    done = here(*sweep, "--resume")
    assert done.returncode == 2
    assert "'spikeblocks 0.1.0 (0123456789ab)'; this is" in done.stderr
    assert f"'{program()}'" in done.stderr and "--mixed" in done.stderr
    assert len(rows(folder)) == 1
    starts.unlink()
    done = here(*sweep, "--resume")
    assert done.returncode == 2 and "one that left no record" in done.stderr
    assert here(*sweep, "--resume", "--mixed").returncode == 0
    assert len(rows(folder)) == 2


def test_trials_of_some_statuses_run_again(here: Run, draw: Path, tmp_path: Path) -> None:
    mark = tmp_path / "mark"
    sweep = (
        *TWO,
        "--no-plots",
        "--vary",
        "draw.how=[fine, die once]",
        "--set",
        f"draw.mark={mark}",
    )
    folder = tmp_path / "sweeps" / "draw"
    assert here(*sweep).returncode == 0
    expected = rows(folder)
    index = folder / "index.csv"
    path = (index, Columns(("draw.how",), tuple(read_plan(folder)["metrics"])))
    with closing(Index(*path)) as opened:
        found = list(opened.rows())
    index.unlink()
    Index.create(*path)
    with closing(Index(*path)) as opened:
        opened.append(found[0])
        opened.append(replace(found[1], status="lost", reason="its worker died"))
    assert here(*sweep, "--resume").returncode == 0
    assert rows(folder) == expected

    done = here(*sweep, "--resume", "--again", "lots")
    assert done.returncode == 2 and "did you mean 'lost'?" in done.stderr
