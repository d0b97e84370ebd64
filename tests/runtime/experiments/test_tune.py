"""``runtime tune``: what it finds, how it judges, and that equal seeds give equal trials."""

from __future__ import annotations

import json
import math
import os
import random
import signal
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

import runtime
from runtime.document import parse_yaml
from runtime.errors import GraphError, Problems, UsageError
from runtime.experiments.design import (
    Constraint,
    GraphVariant,
    Objective,
    RunSet,
    Seeds,
    TuningSettings,
    own_value,
    parse_factor,
    read_experiment,
)
from runtime.experiments.execution import Row
from runtime.experiments.tuning import tuning_plan
from runtime.experiments.tuning.optimizer import Optimizer
from runtime.experiments.tuning.scores import Candidate, Scorer, front
from runtime.experiments.tuning.tuning_plots import importance
from tests.conftest import Run
from tests.extras import install_line
from tests.runtime.experiments.graphs import normal
from tests.runtime.experiments.test_survival import kill_after

TUNE = ("tune", "draw.yaml", "--vary", "draw.level=0..10", "--seeds", "0..2", "-j", "1")
QUIET = ("--held-out", "10..12", "--no-plots", "-q")


def rows(folder: Path, name: str = "index.csv") -> list[list[str]]:
    """An index without times, in the order of the plan."""
    lines = (folder / name).read_text().splitlines()
    return sorted((line.split(",")[:-1] for line in lines[1:]), key=lambda row: int(row[0]))


def stored(folder: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((folder / "tuning.json").read_text())
    return found


def table(found: dict[str, Any], metric: str) -> dict[int, dict[str, Any]]:
    """The lines of a metric by configuration."""
    return {line["configuration"]: line for line in found["table"] if line["metric"] == metric}


class TestTheCommand:
    def test_it_finds_the_smallest_and_says_what_it_is_worth(
        self, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        """drawn = level + N(seed): differences are those of the level, optimism that of noise."""
        # Differences that are all equal are tested by their signs, which takes six.
        runs = ("--seeds", "0..5", "--held-out", "10..15")
        done = here(*TUNE, "--trials", "24", *QUIET, *runs)
        assert done.returncode == 0, done.stderr
        found = stored(tmp_path / "tunings" / "draw")
        (winner,) = found["front"]
        level = found["configurations"][winner]["values"]["draw.level"]
        tried = [one["values"]["draw.level"] for one in found["configurations"][1:]]
        assert level == min(tried) < 1.0
        lines = table(found, "drawn")
        for kind in ("training", "held_out"):
            apart = lines[winner][kind]["difference"]
            assert apart["mean"] == pytest.approx(level - 1.0)
        assert apart["p"] == pytest.approx(2 / 2**6) and apart["distinguishable"]
        assert found["better"] == [winner]
        # The training runs have chosen it: neither a test nor an interval of them means anything.
        chosen = lines[winner]["training"]
        assert chosen["low"] is None and chosen["difference"]["p"] is None
        assert lines[0]["training"]["low"] is not None
        noise = np.mean(list(map(normal, range(6)))) - np.mean(list(map(normal, range(10, 16))))
        assert lines[winner]["optimism"] == pytest.approx(noise)
        assert lines[0]["training"]["mean"] == pytest.approx(
            1.0 + np.mean(list(map(normal, range(6))))
        )
        assert "overfit" in done.stdout and f"draw.level={level:g}" in done.stdout

    def test_half_of_the_others_stop_a_configuration(
        self, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        """With equal noise, what is worse with one seed is worse with all: the winner is kept."""
        assert here(*TUNE, "--trials", "24", *QUIET).returncode == 0
        whole = here(*TUNE, "--trials", "24", *QUIET, "--no-stopping", "--name", "whole")
        assert whole.returncode == 0
        stopped, full = (stored(tmp_path / "tunings" / name) for name in ("draw", "whole"))
        assert stopped["counts"]["stopped"] > 0 and stopped["runs"] < full["runs"]
        assert full["counts"] == {"complete": 24} and full["runs"] == 25 * 3
        for one in stopped["configurations"]:
            assert one["runs"] == (3 if one["status"] == "complete" else one["runs"] or 0)

    @pytest.mark.parametrize("sampler", ["tpe", "nsga2", "sobol", "random"])
    @pytest.mark.slow
    def test_the_same_seed_gives_the_same_trials_with_any_workers(
        self, here: Run, draw: Path, tmp_path: Path, sampler: str
    ) -> None:
        found = []
        for name, jobs, seed in (("a", "1", "3"), ("b", "2", "3"), ("c", "1", "4")):
            done = here(
                *(*TUNE, "--trials", "10", *QUIET, "--sampler", sampler, "-j", jobs),
                *("--sampling-seed", seed, "--name", name),
            )
            assert done.returncode == 0, done.stderr
            found.append(rows(tmp_path / "tunings" / name))
        assert found[0] == found[1] != found[2]

    def test_constraints_hold_for_the_winner(self, here: Run, draw: Path, tmp_path: Path) -> None:
        done = here(*TUNE, "--trials", "30", *QUIET, "--constrain", "total above 6")
        assert done.returncode == 0, done.stderr
        found = stored(tmp_path / "tunings" / "draw")
        (winner,) = found["front"]
        tried = found["configurations"]
        assert tried[winner]["metrics"]["total"] > 6.0
        feasible = [o["metrics"]["drawn"] for o in tried[1:] if o["metrics"]["total"] > 6.0]
        assert tried[winner]["metrics"]["drawn"] == min(feasible)

    def test_constraints_that_nothing_satisfies(self, here: Run, draw: Path) -> None:
        done = here(*TUNE, "--trials", "4", *QUIET, "--constrain", "total above 600")
        assert done.returncode == 3
        assert "no configuration satisfies the constraints; the closest, " in done.stdout

    def test_two_objectives_give_a_front_and_pictures(
        self, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        """Less of one is less of the other: every configuration is on the front."""
        done = here(
            *(*TUNE, "--trials", "8", "--held-out", "10..12", "--minimize", "drawn"),
            *("--maximize", "total", "--no-stopping", "--json"),
        )
        assert done.returncode == 0, done.stderr
        found = json.loads(done.stdout)
        assert len(found["front"]) == 5
        drawn = [found["configurations"][n]["metrics"]["drawn"] for n in found["front"]]
        assert drawn == sorted(drawn)
        names = {Path(path).name for path in found["plots"]}
        assert names == {"history.png", "importance.png", "front.png", "slices.png"}

    def test_conditions_are_named_and_paired(self, here: Run, draw: Path, tmp_path: Path) -> None:
        (tmp_path / "exp.yaml").write_text(
            "experiment: conditions\ngraph: draw.yaml\nvary: {draw.level: '-5..5'}\n"
            "minimize: drawn\ntrials: 6\nover: worst\n"
            "training: {seeds: 0..1, conditions: {low: {}, high: {set: {draw.count: 5}}}}\n"
            "held_out: {seeds: 4, conditions: {other: {set: {draw.count: 7}}}}\n"
        )
        done = here("tune", "exp.yaml", "--no-plots", "-q", "-j", "1")
        assert done.returncode == 0, done.stderr
        folder = tmp_path / "tunings" / "conditions"
        found = stored(folder)
        own = table(found, "drawn")[0]
        # The worst condition is 'high': 1 + 5 + the noise; all runs together are 2.5 lower.
        noise = np.mean([normal(0), normal(1)])
        assert own["training"]["over"] == pytest.approx(6.0 + noise)
        assert own["training"]["mean"] == pytest.approx(3.5 + noise)
        assert own["held_out"]["over"] == pytest.approx(8.0 + normal(4))
        assert {row[2] for row in rows(folder)} == {"low", "high"}
        again = here("tune", str(folder / "plan.yaml"), "--name", "again", "--no-plots", "-q")
        assert again.returncode == 0, again.stderr
        assert rows(folder) == rows(tmp_path / "tunings" / "again")

    def test_a_configuration_that_fails_is_no_winner(
        self, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        done = here(
            *("tune", "draw.yaml", "--vary", "draw.how=[fine, raise]", "--seeds", "0..1"),
            *("--vary", "draw.level=[-1.0, -2.0]"),  # better than its own 1.0
            *("-j", "1", "--trials", "6", "--sampler", "random", *QUIET),
        )
        assert done.returncode == 0, done.stderr
        found = stored(tmp_path / "tunings" / "draw")
        assert found["counts"]["no value"] >= 1
        assert found["configurations"][found["front"][0]]["values"]["draw.how"] == "fine"


class TestSurvival:
    @pytest.mark.slow
    def test_killed_and_resumed_is_never_killed(
        self, script: Path, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        moments = random.Random(5)
        command = [*TUNE, "--trials", "12", *QUIET, "--set", "draw.how=brief", "--resume"]
        folder = tmp_path / "tunings" / "draw"
        kills = 0
        for target in (0, 6, 20):
            with subprocess.Popen(
                [script, *command], cwd=tmp_path, start_new_session=True
            ) as process:
                kills += kill_after(process, folder / "index.csv", target, moments.uniform(0, 0.02))
        assert kills >= 2
        done = here(*command)
        assert done.returncode == 0, done.stderr
        whole = here(*command, "--name", "whole")
        assert whole.returncode == 0, whole.stderr
        for name in ("index.csv", "held_out.csv"):
            assert rows(folder, name) == rows(tmp_path / "tunings" / "whole", name)

    @pytest.mark.slow
    def test_ctrl_c_keeps_what_is_done_and_resume_completes_it(
        self, script: Path, here: Run, draw: Path, tmp_path: Path
    ) -> None:
        command = [*TUNE, "--trials", "12", *QUIET, "--set", "draw.how=brief"]
        folder = tmp_path / "tunings" / "draw"
        quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        with subprocess.Popen(
            [script, *command], cwd=tmp_path, start_new_session=True, **quiet
        ) as process:
            while not (folder / "index.csv").exists() or len(rows(folder)) < 4:
                assert process.poll() is None
            os.killpg(process.pid, signal.SIGINT)
            message = process.communicate()[1].decode()
        assert process.returncode == 130
        assert "Traceback" not in message
        assert stored(folder)["status"] == "interrupted"
        assert 4 <= len(rows(folder)) < 36
        done = here(*command, "--resume")
        assert done.returncode == 0, done.stderr
        assert here(*command, "--name", "whole").returncode == 0
        assert stored(folder)["status"] == "complete"
        assert stored(folder)["front"] == stored(tmp_path / "tunings" / "whole")["front"]
        assert rows(folder) == rows(tmp_path / "tunings" / "whole")

    def test_a_folder_is_continued_only_by_its_own_plan(self, here: Run, draw: Path) -> None:
        assert here(*TUNE, "--trials", "4", *QUIET).returncode == 0
        again = here(*TUNE, "--trials", "4", *QUIET)
        assert again.returncode == 2 and "--resume continues it" in again.stderr
        other = here(*TUNE, "--trials", "3", *QUIET, "--resume")
        assert other.returncode == 2 and "trials: 4 there, 3 here" in other.stderr
        assert here(*TUNE, "--trials", "4", *QUIET, "--resume").returncode == 0

    def test_more_trials_continue_fewer(self, here: Run, draw: Path, tmp_path: Path) -> None:
        folder, whole = (tmp_path / "tunings" / name for name in ("draw", "whole"))
        assert here(*TUNE, "--trials", "6", *QUIET).returncode == 0
        few = (folder / "index.csv").read_text()
        more = here(*TUNE, "--trials", "12", *QUIET, "--resume")
        assert more.returncode == 0, more.stderr
        assert (folder / "index.csv").read_text().startswith(few)
        assert here(*TUNE, "--trials", "12", *QUIET, "--name", "whole").returncode == 0
        for name in ("index.csv", "held_out.csv"):
            assert rows(folder, name) == rows(whole, name)
        assert stored(folder)["table"] == stored(whole)["table"]


class TestWriting:
    def test_a_graph_keeps_its_comments(self, here: Run, draw: Path) -> None:
        text = draw.read_text().replace("level: 1.0}", "level: 1.0}   # to be found")
        draw.write_text(f"# A comment\n{text}")
        done = here(
            *(*TUNE, "--vary", "params.gain=1..2", "--trials", "24", *QUIET, "--write"),
            *("--held-out", "10..15"),
        )
        assert done.returncode == 0, done.stderr
        best = stored(draw.parent / "tunings" / "draw")
        values = best["configurations"][best["front"][0]]["values"]
        after = draw.read_text()
        assert after.startswith("# A comment\n") and "# to be found" in after
        level, gain = (values[name] for name in ("draw.level", "params.gain"))
        assert after == f"# A comment\n{text}".replace("level: 1.0", f"level: {level}").replace(
            "params: {gain: 2.0}", f"params: {{gain: {gain}}}"
        )
        graph = runtime.load(draw)
        assert graph.network.entries["draw"].block.value("level") == values["draw.level"]
        assert graph.network.entries["twice"].block.value("gain") == values["params.gain"]

    def test_an_experiment_gets_entries_of_set(self, here: Run, draw: Path, tmp_path: Path) -> None:
        path = tmp_path / "exp.yaml"
        path.write_text(
            "# Mine\nexperiment: mine\ngraph: draw.yaml  # beside it\nset:\n"
            "  params.gain: 3.0  # stays\nvary: {draw.level: '-5..5'}\ntrials: 4\n"
        )
        runs = ("tune", "exp.yaml", "-j", "1", "--seeds", "0", *QUIET)
        done = here(*runs, "--write")
        # Three held-out seeds cannot show anything.
        assert done.returncode == 1 and "draw.level:" not in path.read_text().partition("vary")[0]
        assert "not distinguishable from the graph's own values" in done.stdout
        assert "--force writes it nevertheless" in done.stderr
        done = here(*runs, "--write", "--force", "--resume")
        assert done.returncode == 0, done.stderr
        best = stored(tmp_path / "tunings" / "mine")
        level = best["configurations"][best["front"][0]]["values"]["draw.level"]
        after = path.read_text()
        assert "# Mine" in after and "# beside it" in after and "3.0  # stays" in after
        assert f"  draw.level: {level}" in after

    def test_what_is_shipped_is_not_written(self, here: Run, tmp_path: Path) -> None:
        done = here("tune", "starters/tracking", "--vary", "lqr.v_r=0.5..1", "--write", *QUIET)
        assert done.returncode == 2 and "copy it first" in done.stderr
        assert not (tmp_path / "tunings").exists()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--vary", "draw.nope=0..1"), "nope"),
        (("--minimize", "drwn"), "did you mean 'drawn'?"),
        (("--constrain", "drawn under 3"), "expected a constraint as 'effort below 0.3'"),
        (("--constrain", "nope below 3"), "the graph has no metric 'nope'"),
        (
            ("--set", "metrics={}", "--minimize", "drawn"),
            "it has none; add one, as in metrics: {drawn: {kind: max_abs, of: out}}",
        ),
        (("--held-out", "2..4"), "condition 'nominal' with seed 2 is both in training and held"),
        (("--vary", "blocks.draw.level=0..1"), "is varied twice"),
        (("--name", "a/b"), "--name a/b: expected letters"),
    ],
)
def test_bad_requests(here: Run, draw: Path, options: tuple[str, ...], message: str) -> None:
    done = here(*TUNE, "--no-plots", "-q", *options)
    assert done.returncode == 2
    assert message in done.stderr


def test_nothing_to_tune(here: Run, draw: Path) -> None:
    done = here("tune", "draw.yaml")
    assert done.returncode == 2 and "there is nothing to tune; add --vary" in done.stderr


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ("sampler: best", "expected one of tpe, nsga2, sobol, random, got"),
        ("trials: 0", "expected an integer from 1 to"),
        ("constraints: {drawn: 3}", "expected below or above"),
        ("constraints: {drawn: {below: x}}", "expected a number, got"),
        ("training: 3", "expected seeds and conditions"),
        ("training: {seed: 3}", "seed"),
        ("held_out: {conditions: {a: {sett: {}}}}", "sett"),
    ],
)
def test_bad_entries(here: Run, draw: Path, tmp_path: Path, entry: str, message: str) -> None:
    path = tmp_path / "exp.yaml"
    path.write_text(f"experiment: e\ngraph: draw.yaml\nvary: {{draw.level: '0..1'}}\n{entry}\n")
    done = here("tune", "exp.yaml")
    assert done.returncode == 2
    assert "exp.yaml:4" in done.stderr and message in done.stderr


def test_without_the_extra_only_the_pip_line_is_printed(
    cli: Run, draw: Path, tmp_path: Path
) -> None:
    package = tmp_path / "hidden" / "optuna"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("raise ImportError('not here')")
    env = {**os.environ, "PYTHONPATH": str(package.parent)}
    done = cli("tune", str(draw), "--vary", "draw.level=0..1", env=env)
    assert done.returncode == 4
    line = install_line("tune")
    assert done.stderr == f"runtime tune needs an optional extra: {line}\n"


def test_from_python(draw: Path, tmp_path: Path) -> None:
    graph = runtime.load(draw)
    found = runtime.tune(
        graph,
        {"draw.level": "-5..5"},
        minimize="drawn",
        constraints={"drawn": {"above": -1000, "below": 1e3}},
        trials=8,
        seeds=range(2),
        conditions={f"plus {i}": graph.set("draw.count", i) for i in range(6)},
        held_out="10..11",
        jobs=1,
        folder=tmp_path / "found",
    )
    assert found.best["draw.level"] == min(
        one.values[0] for one in found.configurations[1:] if one.values
    )
    assert {line.metric for line in found.judgements} == {"drawn"}
    assert "overfit" in str(found)
    assert "constraints: drawn above -1000, drawn below 1000" in str(found)
    assert (tmp_path / "found" / "tuning.json").exists()
    with pytest.raises(UsageError, match="both in training and held out"):
        runtime.tune(graph, {"draw.level": "0..10"}, seeds="0..3", held_out="3..4")
    with pytest.raises(GraphError, match="no metric 'x'"):
        runtime.tune(graph, {"draw.level": "0..10"}, minimize="x")


# The error is |v - target|: the best value is known, and the seed changes nothing.
KNOWN = """
graph: known
run: {dt: 0.01, until: 0.05}
params: {v: 0.5, target: 0.5}
blocks:
  value: {type: Constant, value: $v}
  target: {type: Constant, value: $target}
  error: {type: Sum, signs: [1, -1]}
wires:
  error: {terms: [value.value, target.value]}
metrics:
  error: {kind: max_abs, of: error.out}
  settled: {kind: settling_time, of: error.out, band: 0.2, hold: 0.0}
"""
KNOWN_TUNE = ("--trials", "8", "-j", "1", "--no-plots", "-q", "--write")


# The error is another number for each value and seed, with the same distribution for all values.
NOISE = """
graph: noise
run: {dt: 0.01, until: 0.02}
params: {p: 0.5}
blocks:
  seen: {type: RandomWalk, density: 1.0e-12}
  error: {type: Function, expression: "2 + sin(1e6*p*(1 + 1e6*u[0]))/2", constants: {p: $p}}
wires: {error: {u: seen.out}}
metrics: {error: {kind: final, of: error.out}}
"""


class TestNoise:
    """Where nothing differs, the winner of the training runs is luck."""

    def test_a_lucky_winner_is_not_distinguishable_and_not_written(
        self, here: Run, tmp_path: Path
    ) -> None:
        path = tmp_path / "noise.yaml"
        path.write_text(NOISE)
        tune = ("tune", "noise.yaml", "--vary", "params.p=0..1", "--trials", "12", "-j", "1")
        done = here(*tune, "--held-out", "100..119", "--no-plots", "-q", "--write")
        assert done.returncode == 1 and path.read_text() == NOISE
        assert "on the held-out runs, not distinguishable from the graph's own" in done.stdout
        assert "written nothing: the winner is not distinguishable" in done.stderr
        found = stored(tmp_path / "tunings" / "noise")
        assert found["better"] == [] and set(found["verdicts"].values()) == {"not distinguishable"}
        report = here("report", "tunings/noise")
        assert report.returncode == 0, report.stderr
        page = (tmp_path / "tunings" / "noise" / "report.html").read_text()
        assert "not distinguishable from the graph" in page
        done = here("tune", "noise.yaml", "--vary", "params.p=0..1", "--force")
        assert done.returncode == 2 and "nothing to force" in done.stderr

    def test_a_failed_run_is_the_worst_where_more_is_better(
        self, draw: Path, tmp_path: Path
    ) -> None:
        path = tmp_path / "exp.yaml"
        path.write_text(
            "experiment: e\ngraph: draw.yaml\nvary: {draw.level: 0..1}\nmaximize: drawn\n"
            "constraints: [total above 0, above_two below 3]\n"
        )
        plan = tuning_plan(read_experiment(path))
        found = {metric: plan.worst(metric) for metric in plan.metrics}
        assert found == {"drawn": -math.inf, "total": -math.inf, "above_two": math.inf}


class TestTheGraphsOwnValues:
    def test_nothing_beats_values_that_are_best(self, here: Run, tmp_path: Path) -> None:
        (tmp_path / "known.yaml").write_text(KNOWN)
        done = here("tune", "known.yaml", "--vary", "params.v=0..1", *KNOWN_TUNE)
        assert done.returncode == 1
        assert "nothing that was tried is better than the graph's own values" in done.stdout
        assert "--write has written nothing" in done.stderr
        assert (tmp_path / "known.yaml").read_text() == KNOWN
        found = stored(tmp_path / "tunings" / "known")
        assert found["front"] == found["better"] == found["table"] == []

    def test_a_winner_that_is_worse_on_held_out_runs_is_not_written(
        self, here: Run, tmp_path: Path
    ) -> None:
        """Trained for a target of 1, judged with one of 0, to which the own value is closer."""
        (tmp_path / "known.yaml").write_text(KNOWN)
        text = "graph: known.yaml\nexperiment: e\nvary: {params.v: 0..1}\nminimize: error\n"
        for runs, seeds, target in (("training", "0..1", 1.0), ("held_out", "2..9", 0.0)):
            changed = f"{{{runs}: {{set: {{params.target: {target}}}}}}}"
            text += f"{runs}: {{seeds: {seeds}, conditions: {changed}}}\n"
        (tmp_path / "e.yaml").write_text(text)
        done = here("tune", "e.yaml", *KNOWN_TUNE)
        assert done.returncode == 1, done.stderr
        assert "on the held-out runs, nothing that was tried is better" in done.stdout
        assert (tmp_path / "e.yaml").read_text() == text
        found = stored(tmp_path / "tunings" / "e")
        (winner,) = found["front"]
        assert found["better"] == []
        judged = table(found, "error")[winner]["held_out"]
        # All eight seeds give the same run: it is one, and nothing is tested.
        assert (judged["n"], judged["identical"], judged["low"]) == (1, True, None)
        value = found["configurations"][winner]["values"]["params.v"]
        assert judged["difference"]["mean"] == pytest.approx(value - 0.5)
        assert judged["difference"]["p"] is None and not judged["difference"]["distinguishable"]
        assert "n = 1: the seed changes nothing" in done.stdout

    def test_own_values_that_never_settle_are_the_worst(self, here: Run, tmp_path: Path) -> None:
        (tmp_path / "known.yaml").write_text(KNOWN.replace("v: 0.5", "v: 3.0"))
        goal = ("--vary", "params.v=0..1", "--minimize", "settled", "--seeds", "0..2")
        done = here("tune", "known.yaml", *goal, *KNOWN_TUNE)
        assert done.returncode == 0, done.stdout + done.stderr
        assert "never settled (n = 1)" in done.stdout
        found = stored(tmp_path / "tunings" / "known")
        assert found["configurations"][0]["never"] == ["settled"]
        written = yaml.safe_load((tmp_path / "known.yaml").read_text())["params"]["v"]
        assert abs(written - 0.5) <= 0.2

    @pytest.mark.parametrize("values", ["0..1", "[0.25, 0.5]", "0..1:5", "[0.25, 0.75]"])
    def test_the_optimiser_begins_with_them(self, tmp_path: Path, values: str) -> None:
        problems = Problems()
        factor = parse_factor("params.v", parse_yaml(values, "v"), "v", problems)
        assert factor is not None
        graph = tmp_path / "known.yaml"
        graph.write_text(KNOWN)
        own = own_value(runtime.load(graph), "params.v")
        assert own == 0.5
        goals = (Objective("error"),)
        runs = RunSet(Seeds(((0, 0),)), ())
        tuning = TuningSettings(goals, (), 10, "tpe", 4, 0, "mean", True, runs, runs)
        optimizer = Optimizer([factor], tuning)
        first = optimizer.begin_with([own])
        assert (first is None) == (values == "[0.25, 0.75]")
        if first is not None:
            assert first.values == (0.5,)
            optimizer.tell(first, (0.0,), ())


# -- the rules, by themselves


def scorer(objectives: int = 1, over: Any = "mean") -> Scorer:
    graph = runtime.Graph()
    runs = RunSet(Seeds(((0, 1),)), (GraphVariant("a", graph), GraphVariant("b", graph)))
    goals = tuple(Objective(name) for name in ("m", "n")[:objectives])
    bound = (Constraint("n", "below", 10.0),)
    tuning = TuningSettings(goals, bound, 10, "tpe", 4, 0, over, True, runs, runs)
    return Scorer(tuning, ("m", "n"))


def tried(number: int, *values: tuple[float | None, float]) -> Candidate:
    """A configuration with the values of (a, 0), (b, 0), (a, 1), (b, 1), as far as given."""
    one = Candidate(number, (1.0,))
    for (name, seed), metrics in zip(
        (("a", 0), ("b", 0), ("a", 1), ("b", 1)), values, strict=False
    ):
        one.rows[name, seed] = Row(0, (), seed, "ok", "", metrics, 0.0)
    return one


def test_a_score_is_over_the_seeds_and_then_over_the_conditions() -> None:
    one = tried(1, (1.0, 0.0), (4.0, 0.0), (3.0, 0.0), (8.0, 0.0))
    for over, expected in (("mean", 4.0), ("worst", 6.0)):
        judge = scorer(over=over)
        assert judge.score(one.rows, judge.tuning.training, (0, 1)).costs == (expected,)
    missing = tried(1, (1.0, 0.0), (None, 0.0))
    assert scorer().score(missing.rows, scorer().tuning.training, (0,)).costs == (np.inf,)


def test_who_is_stopped() -> None:
    judge = scorer()
    others = [tried(n, *[(float(n), 0.0)] * 4) for n in range(6)]
    for value, stops in ((2.0, False), (2.5, True), (9.0, True)):
        assert judge.should_stop(tried(9, (value, 0.0), (value, 0.0)), others, (0,)) is stops
    assert not judge.should_stop(tried(9, (9.0, 0.0), (9.0, 0.0)), others[:4], (0,))
    assert judge.should_stop(tried(9, (None, 0.0), (0.0, 0.0)), [], (0,))
    own = tried(0, (9.0, 0.0), (9.0, 0.0))
    own.values = None
    assert not judge.should_stop(own, others, (0,))
    # What violates a constraint is beaten by what does not.
    assert judge.should_stop(tried(9, (0.0, 11.0), (0.0, 11.0)), others, (0,))


def test_the_front_is_what_nothing_dominates() -> None:
    judge = scorer(objectives=2)
    found = []
    for number, pair in enumerate([(1, 5), (2, 3), (3, 4), (4, 1), (1, 5), (0, 20)], start=1):
        one = tried(number, *[(float(pair[0]), float(pair[1]))] * 4)
        one.score = judge.score(one.rows, judge.tuning.training, (0, 1))
        found.append(one)
    assert [one.number for one in front(found)] == [1, 2, 4]


def test_importance_is_the_share_of_the_variance() -> None:
    draw = np.random.default_rng(0)
    x, y = draw.uniform(size=(2, 4000))
    assert importance(x, x**3) == pytest.approx(1.0 - 1.0 / 25.0, abs=2e-3)  # five bins
    assert importance(x, y) == pytest.approx(0.0, abs=5e-3)
    assert importance(x, (x - 0.5) ** 2) > 0.8
    mixed = importance(x, x + y)
    assert mixed == pytest.approx(0.5, abs=0.05)
    assert importance(np.zeros(9), np.arange(9.0)) == 0.0
