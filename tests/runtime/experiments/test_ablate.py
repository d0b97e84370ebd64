"""``runtime ablate``: variants with the same noise, and a table with significant differences."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy import stats

import runtime
from runtime.document.node import parse_yaml
from runtime.experiments.design.variants import group_changes, removals, slugs
from tests.conftest import Run
from tests.runtime.experiments.graphs import normal

SEEDS = ("--seeds", "0..5", "-j", "2")


def folder_of(root: Path) -> Path:
    return root / "ablations" / "draw"


def values(folder: Path) -> dict[tuple[str, int], dict[str, str]]:
    with (folder / "index.csv").open(newline="") as lines:
        return {(row["variant"], int(row["seed"])): row for row in csv.DictReader(lines)}


def table(facts: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    return {(line["variant"], line["metric"]): line for line in facts["table"]}


def test_every_block_alone(cli: Run, draw: Path, tmp_path: Path) -> None:
    done = cli("ablate", "draw.yaml", *SEEDS)
    assert done.returncode == 0, done.stderr
    folder = folder_of(tmp_path)
    facts = json.loads((folder / "ablation.json").read_text())
    names = [variant["name"] for variant in facts["variants"]]
    assert names == ["baseline", "bypass twice", "bypass half", "without sum"]
    assert facts["essential"] == {"draw": "input 'twice.input' is not connected without 'draw'"}
    assert facts["essential"]["draw"] in done.stdout
    # total is draw + half * twice * draw: 2 draw, and 1.5 or 3 draw with one of the gains removed.
    found = values(folder)
    for seed in range(6):
        out = 1.0 + normal(seed)
        for variant, factor in (("baseline", 2.0), ("bypass twice", 1.5), ("bypass half", 3.0)):
            row = found[variant, seed]
            assert float(row["drawn"]) == out
            assert float(row["total"]) == pytest.approx(factor * out)
        assert found["without sum", seed]["total"] == ""
    lines = table(facts)
    assert lines["bypass twice", "drawn"]["difference"]["mean"] == 0.0
    assert lines["bypass twice", "drawn"]["difference"]["verdict"] == "equal"
    assert lines["without sum", "total"]["recorded"] is False
    assert lines["without sum", "total"]["n"] == 0
    outs = np.array([1.0 + normal(seed) for seed in range(6)])
    apart = lines["bypass half", "total"]["difference"]
    expected = stats.ttest_rel(3.0 * outs, 2.0 * outs)
    assert apart["p"] == pytest.approx(expected.pvalue)
    interval = expected.confidence_interval(0.95)
    assert (apart["low"], apart["high"]) == pytest.approx((interval.low, interval.high))
    assert apart["mean"] == pytest.approx(outs.mean())
    settled = lines["baseline", "above_two"]
    assert settled["n"] == int((outs > 2.0).sum())
    assert settled["runs"] == 6


def test_what_a_folder_holds(here: Run, draw: Path, tmp_path: Path) -> None:
    done = here("ablate", "draw.yaml", *SEEDS, "--bypass", "twice", "--json")
    assert done.returncode == 0, done.stderr
    folder = folder_of(tmp_path)
    facts = json.loads(done.stdout)
    written = json.loads((folder / "ablation.json").read_text())
    assert {**facts, "checks": written["checks"]} == {**written, "plots": facts["plots"]}
    assert [Path(plot).name for plot in facts["plots"]] == ["ablation.png"]
    assert {path.name for path in folder.iterdir()} == {
        *(
            "plan.yaml",
            "graph.resolved.yaml",
            "own.py",
            "index.csv",
            "ablation.json",
            "starts.jsonl",
        ),
        *("diagram.json", "variants", "diagrams", "runs", "plots"),
    }
    plan = parse_yaml((folder / "plan.yaml").read_text(), "plan").plain()
    assert plan["kind"] == "ablation"
    assert plan["variants"] == {
        "bypass twice": {
            "graph": "variants/bypass_twice/graph.resolved.yaml",
            "changes": ["bypass twice"],
        }
    }
    for slug in ("baseline", "bypass_twice"):
        result = runtime.open(folder / "runs" / slug)
        assert result.metrics["drawn"] == 1.0 + normal(0)
        assert (folder / "diagrams" / f"{slug}.svg").read_text().startswith("<")
    # Removed blocks are drawn in grey: both diagrams show all four blocks.
    drawn = (folder / "diagrams" / "bypass_twice.svg").read_text()
    whole = (folder / "diagrams" / "baseline.svg").read_text()
    assert "bypassed" in drawn and "bypassed" not in whole
    for block in ("draw", "twice", "half", "sum"):
        assert block in drawn
    words = ("ablate", str(folder / "plan.yaml"), "--name", "again", "-j", "2", "--no-plots")
    again = here(*words, "--json")
    assert json.loads(again.stdout)["table"] == facts["table"]


EXPERIMENT = """
experiment: draw
graph: draw.yaml
set: {draw.level: 5}
seeds: [0, 3]
variants:
  no half: {without: half}
  steep: {set: {params.gain: 4}}
  constant:
    replace: {twice: Constant}
    set: {twice.value: 8}
    wire: {half.input: twice.value}
  unlimited: {wire: {sum.terms: [draw.out]}}
"""


def test_variants_of_a_file_and_of_the_command_line(here: Run, draw: Path, tmp_path: Path) -> None:
    (tmp_path / "e.yaml").write_text(EXPERIMENT)
    late = ("--variant", "late", "--without", "half", "--without", "twice")
    extra = ("--set", "draw.count=1", *late)
    done = here("ablate", "e.yaml", *extra, "--json", "-j", "2", "--no-plots")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    names = [variant["name"] for variant in facts["variants"]]
    assert names == ["baseline", "no half", "steep", "constant", "unlimited", "late"]
    changes = {variant["name"]: variant["changes"] for variant in facts["variants"]}
    assert changes["steep"] == ["set params.gain=4"]
    assert changes["late"] == ["without half", "without twice"]
    notes = {variant["name"]: variant["notes"] for variant in facts["variants"]}
    assert any("no input 'input'" in note for note in notes["constant"])
    found = values(folder_of(tmp_path))
    for seed in (0, 3):
        out = 6.0 + normal(seed)
        expected = {"baseline": 2.0 * out, "no half": out, "steep": 3.0 * out, "late": out}
        expected |= {"unlimited": out, "constant": out + 4.0}
        for name, total in expected.items():
            assert float(found[name, seed]["total"]) == pytest.approx(total)


def test_changes_are_grouped_in_the_order_written() -> None:
    plain = [("set", "a=1"), ("without", "x"), ("set", "b=2"), ("bypass", "y"), ("replace", "z=T")]
    assert group_changes(plain) == (
        [("set", "a=1")],
        [
            ("without x", [("without", "x"), ("set", "b=2")]),
            ("bypass y", [("bypass", "y")]),
            ("replace z=T", [("replace", "z=T")]),
        ],
    )
    named = [
        ("set", "a=1"),
        ("variant", "soft"),
        ("without", "x"),
        ("set", "b=2"),
        ("variant", "n"),
    ]
    assert group_changes(named) == (
        [("set", "a=1")],
        [("soft", [("without", "x"), ("set", "b=2")]), ("n", [])],
    )


def test_names_of_files_never_clash() -> None:
    names = ["a b", "a_b", "A b", "ä", "..", "a" * 200]
    found = slugs(names)
    assert len({slug.lower() for slug in found.values()}) == len(names)
    assert all(re.fullmatch(r"[A-Za-z0-9_-]{1,64}", slug) for slug in found.values())


def test_each_block_of_case_a() -> None:
    variants, essential = removals(runtime.load("line_actuator_failure"))
    assert {variant.name for variant in variants} >= {
        *("bypass limit", "bypass fault", "without adaptive", "without adaptive.snn_v"),
        "without lqr",
    }
    assert set(essential) == {"track", "match", "error", "total", "plant"}
    assert essential["plant"] == "input 'match.pose' (Pose) is not connected without 'plant'"
    # What a graph leaves out already is not tried again.
    less, _ = removals(runtime.load("line_actuator_failure").without("adaptive"))
    assert not [variant for variant in less if "adaptive" in variant.name]


@pytest.mark.slow
def test_variants_see_the_same_noise_and_neurons(here: Run, tmp_path: Path) -> None:
    case = ("ablate", "sine_estimation_error", "--until", "0.2", "--seeds", "1,4", "-j", "2")
    done = here(*case, "--without", "adaptive.snn_v", "--bypass", "limit", "--json")
    assert done.returncode == 0, done.stderr
    with (Path(json.loads(done.stdout)["folder"]) / "index.csv").open(newline="") as lines:
        found = list(csv.DictReader(lines))
    base = runtime.load("sine_estimation_error").set("run.until", 0.2)
    graphs = {
        "baseline": base,
        "without adaptive.snn_v": base.without("adaptive.snn_v"),
        "bypass limit": base.bypass("limit"),
    }
    noise = {}
    for row in found:
        result = graphs[row["variant"]].probe("seen", "noise.measured").run(seed=int(row["seed"]))
        for name, value in result.metrics.items():
            # "never settled" is the worst value, not a missing one.
            never = "inf" if name in base.check().observation.metric_never else ""
            assert row[name] == (never if value is None else repr(value))
        noise[row["variant"], row["seed"]] = result["seen"] - result["pose"]
    assert len(found) == 6
    for seed in ("1", "4"):
        assert np.allclose(noise["baseline", seed], noise["bypass limit", seed], atol=1e-12)
    assert not np.allclose(noise["baseline", "1"], noise["baseline", "4"])


def test_an_interrupted_ablation_goes_on(here: Run, draw: Path, tmp_path: Path) -> None:
    variants = ("ablate", "draw.yaml", *SEEDS, "--no-plots", "--bypass", "half")
    assert here(*variants).returncode == 0
    folder = folder_of(tmp_path)
    whole = values(folder)
    index = folder / "index.csv"
    # As a kill would leave it: no table, a torn row, a run folder without its row.
    (folder / "ablation.json").unlink()
    kept = index.read_bytes().splitlines(keepends=True)
    index.write_bytes(b"".join(kept[:6]) + kept[6][:9])
    assert "exists already; --resume continues it, --name NAME begins" in here(*variants).stderr
    done = here(*variants, "--resume", "--json")
    assert done.returncode == 0, done.stderr
    assert len(json.loads(done.stdout)["table"]) == 6
    numbers = ("status", "drawn", "total", "above_two")
    again = values(folder)
    assert {key: [row[n] for n in numbers] for key, row in again.items()} == {
        key: [row[n] for n in numbers] for key, row in whole.items()
    }
    other = here(*variants, "--bypass", "twice", "--resume")
    assert other.returncode == 2
    assert "belongs to a different plan, which differs in variants" in other.stderr
    for command in (("--resume", str(folder)), ("--resume", "nosuch")):
        done = here(*variants, *command)
        assert done.returncode == 2
        assert "--resume takes no folder: it continues the one of --out DIR and --n" in done.stderr


def test_a_folder_of_older_ablations_is_left_alone(here: Run, draw: Path, tmp_path: Path) -> None:
    """They were at ablations/NAME/DATE-TIME-ID; such a one is still continued, by its name."""
    variants = ("ablate", "draw.yaml", *SEEDS, "--no-plots", "--bypass", "half", "--json")
    older = ("--out", "ablations/draw", "--name", "20260101-120000-abcdef")
    assert here(*variants, *older).returncode == 0
    done = here(*variants)
    assert done.returncode == 2
    assert "'ablations/draw' exists already, and is not the folder of a" in done.stderr
    assert "--name NAME begins one elsewhere" in done.stderr
    again = here(*variants, *older, "--resume")
    assert again.returncode == 0 and json.loads(again.stdout)["variants"][1]["runs"] == 6


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--without", "drw"], "there is no block 'drw', did you mean 'draw'?"),
        (["--without", "draw"], "variant 'without draw' cannot run:"),
        (["--without", "half", "--without", "half"], "duplicate variant 'without half'"),
        (["--variant", "baseline"], "duplicate variant 'baseline'"),
        (["--variant", ""], "'' is not a valid name for a variant"),
        (["--bypass", "sum"], "variant 'bypass sum' cannot run:"),
        (["--replace", "half=Gian"], "no block type 'Gian', did you mean 'Gain'?"),
        (["--seeds", "two"], "expected seeds such as 0..9, 3 or 0,4,7..9, got the string 'two'"),
        (["--set", "metrics={}"], "the graph has no metrics to compare variants by"),
        (["--set", "metrics.variant={kind: final, of: draw.out}"], "metric 'variant': the name is"),
        (["--test", "z"], "invalid choice: 'z'"),
    ],
)
def test_errors_are_reported_before_anything_runs(
    here: Run, draw: Path, tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = here("ablate", "draw.yaml", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert done.stdout == ""
    assert not (tmp_path / "ablations").exists()


def test_a_variant_that_fails_is_reported(here: Run, draw: Path) -> None:
    failing = ("--variant", "broken", "--set", "draw.how=raise")
    done = here("ablate", "draw.yaml", *SEEDS, "--no-plots", *failing)
    assert done.returncode == 0, done.stderr
    assert "broken: 6 of 6 trials failed, first: block 'draw' at tick 0" in done.stdout
    [total] = [line for line in done.stdout.splitlines() if line.startswith("  broken")][1:2]
    # Its last value has no direction: only how often there is one is compared.
    assert total.split() == ["broken", "0/6", "failed", "-", "-", "-", "yes,", "in", "seeds"]
    five = here("ablate", "draw.yaml", "--seeds", "0..4", "--no-plots", "--name", "five", *failing)
    assert "too few pairs to test (6 needed); of 5 pairs p is at least 0.062." in five.stdout


def test_ranks_says_so(here: Run, draw: Path) -> None:
    done = here(
        *("ablate", "draw.yaml", *SEEDS, "--bypass", "half", "--json", "--no-plots"),
        *("--test", "ranks"),
    )
    facts = json.loads(done.stdout)
    assert facts["test"] == "signed ranks"
    apart = table(facts)["bypass half", "total"]["difference"]
    outs = [1.0 + normal(seed) for seed in range(6)]
    assert apart["p"] == pytest.approx(stats.wilcoxon(outs, method="exact").pvalue)


CROSSED = """
experiment: crossed
graph: draw.yaml
seeds: 0..5
vary: {draw.level: [0, 1, 4]}
primary: total
contrasts: [[steep, soft]]
variants:
  soft: {set: {params.gain: 1}}
  steep: {set: {params.gain: 4}}
"""


def test_variants_cross_factors(here: Run, draw: Path, tmp_path: Path) -> None:
    """total = (1 + gain / 2)(level + noise): variants differ at each level, and in their trend."""
    (tmp_path / "crossed.yaml").write_text(CROSSED)
    done = here("ablate", "crossed.yaml", "--json", "-j", "2")
    assert done.returncode == 0, done.stderr
    facts = json.loads(done.stdout)
    lines = {(x["metric"], x["setting"], x["variant"], x["reference"]): x for x in facts["table"]}
    noise = np.array([normal(seed) for seed in range(6)])
    for setting, level in (("", 5.0 / 3.0), ("draw.level=0", 0.0), ("draw.level=4", 4.0)):
        line = lines["total", setting, "steep", "baseline"]
        assert line["mean"] == pytest.approx(3.0 * (level + noise.mean()))
        assert line["runs"] == 6  # settings are not observations of their own
        assert line["difference"]["mean"] == pytest.approx((level + noise).mean())
    trend = lines["total per draw.level", "", "soft", "baseline"]
    assert trend["mean"] == pytest.approx(1.5)
    assert trend["difference"]["mean"] == pytest.approx(-0.5)
    contrast = lines["total", "", "steep", "soft"]["difference"]
    assert contrast["mean"] == pytest.approx(1.5 * (5.0 / 3.0 + noise.mean()))
    assert lines["drawn", "", "steep", "baseline"]["primary"] is False
    rows = (tmp_path / "ablations" / "crossed" / "index.csv").read_text().splitlines()
    assert rows[0].startswith("trial,variant,draw.level,seed,") and len(rows) == 1 + 3 * 3 * 6
    names = {Path(plot).stem for plot in facts["plots"]}
    assert names == {"ablation", "curves"}
    # The same file as a sweep has the same rows, and the best of all of them.
    swept = json.loads(here("sweep", "crossed.yaml", "--json", "--no-plots").stdout)
    assert swept["trials"] == 54 and swept["factors"] == ["variant", "draw.level"]
    assert swept["best"][0]["values"] == {"variant": "baseline", "draw.level": "0"}
    assert here("report", "ablations/crossed").returncode == 0
    assert here("report", "sweeps/crossed").returncode == 0


def test_a_section_that_a_verb_does_not_use_is_an_error(
    here: Run, draw: Path, tmp_path: Path
) -> None:
    (tmp_path / "crossed.yaml").write_text(CROSSED + "training: {seeds: 3}\n")
    for verb in ("sweep", "ablate"):
        done = here(verb, "crossed.yaml")
        assert done.returncode == 2
        assert f"crossed.yaml:11:1: training: 'runtime {verb}' does not use it, but" in done.stderr


def test_a_factor_may_replace_a_whole_block(here: Run, draw: Path, tmp_path: Path) -> None:
    (tmp_path / "part.yaml").write_text(
        "graph: half\ninputs: {input: Scalar}\noutputs: {out: gain.out}\n"
        "blocks:\n  gain: {type: Gain, gain: 8}\nwires:\n  gain: {input: inputs.input}\n"
    )
    (tmp_path / "e.yaml").write_text(
        "experiment: e\ngraph: draw.yaml\nseeds: 3\nvary:\n"
        "  half: [{type: Gain, gain: 3}, {graph: part.yaml}, {type: Lowpass, tau: 1.0}]\n"
    )
    done = here("sweep", "--no-plots", "e.yaml", "--json", "-j", "1")
    assert done.returncode == 0, done.stderr
    out = 1.0 + normal(3)
    with (tmp_path / "sweeps" / "e" / "index.csv").open(newline="") as lines:
        totals = [float(row["total"]) for row in csv.DictReader(lines)]
    assert totals == pytest.approx([7.0 * out, 17.0 * out, totals[2]])
    assert totals[2] < 2.0 * out
    again = here("sweep", "sweeps/e/plan.yaml", "--name", "again", "--json", "--no-plots")
    assert again.returncode == 0, again.stderr


def test_a_world_is_looked_up_beside_the_experiment(here: Run, draw: Path, tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    (folder / "rooms").mkdir(parents=True)
    (folder / "rooms" / "small.yaml").write_text("room: [[-1, -1], [1, -1], [1, 1], [-1, 1]]\n")
    (folder / "e.yaml").write_text(
        "experiment: rooms\ngraph: ../draw.yaml\nseeds: 1\nvariants:\n"
        "  small: {set: {world: rooms/small.yaml}}\n  shipped: {set: {world: worlds/l_room.yaml}}\n"
    )
    assert here("ablate", "mine/e.yaml", "--no-plots", "-j", "1").returncode == 0
    variants = tmp_path / "ablations" / "rooms" / "variants"
    small = (variants / "small" / "graph.resolved.yaml").read_text()
    assert all(corner in small for corner in ("[-1, -1]", "[1, -1]", "[1, 1]", "[-1, 1]"))
    assert "room:" in (variants / "shipped" / "graph.resolved.yaml").read_text()
