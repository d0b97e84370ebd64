"""What is wrong with an experiment is reported at once, with the name of its variant."""

from __future__ import annotations

import json
from pathlib import Path

from tests.conftest import Run

WRONG = """
experiment: wrong
graph: draw.yaml
seeds: 0-4
metrics: [total, totl]
set: {draw.levl: 1.0}
variants:
  none: {without: hlf}
  slow: {set: {sum.bia: 1.0}}
  two:
    replace: {half: Gian}
    set: {half.gain: 2.0, sm.bias: 1.0}
  wire: {wire: {half.input: draw.ot}}
  part: {graph: nosuch.yaml}
training: {conditions: {windy: {set: {sum.bia: 2.0}}}}
"""


def test_all_errors_of_an_experiment_are_reported_in_the_name_of_their_variant(
    here: Run, draw: Path
) -> None:
    path = draw.parent / "wrong.yaml"
    path.write_text(WRONG)
    for verb in ("validate", "ablate"):
        done = here(verb, "wrong.yaml")
        assert done.returncode == 2
        shown = [line for line in done.stderr.splitlines() if line.startswith("wrong.yaml:")]
        expected = [
            ("seeds", "expected seeds"),
            ("metrics", "the graph has no metric 'totl', did you mean 'total'?"),
            ("blocks.draw.levl", "unknown parameter, did you mean 'level'?"),
            ("variants.none", "there is no block 'hlf', did you mean 'half'?"),
            ("variants.slow", "blocks.sum.bia: unknown parameter"),
            # Nothing of half.gain, which a block of another type might have.
            ("variants.two", "half.type: no block type 'Gian', did you mean 'Gain'?"),
            ("variants.two", "sm.bias: there is no 'sm' in the graph, did you mean 'sum'?"),
            ("variants.wire", "'draw' has no output 'ot', did you mean 'out'?"),
            ("variants.part.graph", "'nosuch.yaml': no such graph"),
            ("training.conditions.windy", "blocks.sum.bia: unknown parameter"),
        ]
        assert len(shown) == len(expected), done.stderr
        for line, (address, text) in zip(shown, expected, strict=True):
            assert f": {address}: " in line and text in line


def test_what_needs_no_graph_is_checked_without_one(here: Run, draw: Path) -> None:
    text = "experiment: x\ngraph: nosuch.yaml\nseeds: 0-4\ntrials: many\n"
    (draw.parent / "wrong.yaml").write_text(text)
    shown = here("validate", "wrong.yaml").stderr
    assert "no such graph" in shown and "0-4" in shown and "expected an integer" in shown


def test_metrics_of_an_experiment_are_those_of_its_table(here: Run, draw: Path) -> None:
    text = "graph: draw.yaml\nseeds: 0..1\nmetrics: [total]\nvariants: {half: {bypass: half}}\n"
    (draw.parent / "some.yaml").write_text(text)
    done = here("ablate", "some.yaml", "--json", "--no-plots")
    assert done.returncode == 0, done.stderr
    assert {line["metric"] for line in json.loads(done.stdout)["table"]} == {"total"}
