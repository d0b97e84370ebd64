"""Another type in a block's place: what stays, what is dropped, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError
from tests.conftest import Run

PLAIN: dict[str, Any] = {
    "graph": "g",
    "run": {"dt": 0.1, "until": 0.5},
    "params": {"k": 3},
    "blocks": {
        "one": {"type": "Constant", "value": 1},
        "slow": {"type": "Lowpass", "tau": "$k", "dt": 0.2},
        "sum": {"type": "Sum"},
    },
    "wires": {"slow": {"input": "one.value"}, "sum": {"terms": ["slow.out", "one.value"]}},
    "probes": {
        "slow": "slow.out",
        "memory": {"of": ["slow.memory", "sum.out"]},
        "held": "slow.memory",
    },
    "plots": {"held": {"kind": "timeseries", "of": ["held", "slow"]}},
    "metrics": {"last": {"kind": "final", "of": "held"}, "sum": {"kind": "final", "of": "sum.out"}},
}
PART: dict[str, Any] = {
    "graph": "p",
    "run": {"dt": 0.1, "until": 0.5},
    "blocks": {
        "one": {"type": "Constant", "value": 1},
        "part": {
            "params": {"k": 2},
            "inputs": {"x": "Scalar"},
            "outputs": {"y": "gain.out"},
            "blocks": {"gain": {"type": "Gain", "gain": "$k"}},
            "wires": {"gain": {"input": "inputs.x"}},
        },
    },
    "wires": {"part": {"x": "one.value"}},
    "probes": {"y": "part.y"},
}


def plain(**changes: Any) -> runtime.Graph:
    return runtime.load({**PLAIN, **changes})


def test_what_both_types_have_stays() -> None:
    graph = plain(probes={}, plots={}, metrics={})
    changed = graph.replace("slow", "UnitDelay")
    entry = changed.to_dict()["blocks"]["slow"]
    assert entry == {"type": "UnitDelay", "dt": 0.2}
    assert changed.to_dict()["wires"] == PLAIN["wires"]
    assert changed.notes == (
        "'slow' is now a UnitDelay, which has no tau: dropped",
        "params.k is left out: nothing uses $k after the change",
    )
    assert "params" not in changed.to_dict() or changed.to_dict()["params"] == {}
    assert graph.to_dict()["blocks"]["slow"]["type"] == "Lowpass"
    out = changed.probe("out", "slow.out").run()["out"]
    assert np.array_equal(out, [0.0, 1.0, 1.0])


def test_a_param_that_something_else_reads_stays() -> None:
    graph = plain(probes={}, plots={}, metrics={}).set("one.value", "$k")
    assert graph.replace("slow", "UnitDelay").check().to_dict()["params"] == {"k": 3}


def test_wires_of_ports_that_are_gone_fall_away() -> None:
    graph = plain(probes={}, plots={}, metrics={}).replace("slow", "Constant")
    assert graph.set("slow.value", 7).probe("s", "sum.out").run()["s"].tolist() == [1.0] * 5
    assert any("no input 'input'" in note for note in graph.notes)
    assert any("'slow.out' is dropped" in note for note in graph.notes)


def test_a_required_input_is_never_left_open_in_silence() -> None:
    graph = plain(probes={}, plots={}, metrics={}).wire("slow.input", "sum.out")
    graph = graph.wire("sum.terms", ["one.value"]).replace("sum", "Constant").set("sum.value", 1)
    with pytest.raises(GraphError, match=r"input 'slow\.input' is not connected"):
        graph.check()


def test_probes_plots_and_metrics_of_what_is_gone_fall_away() -> None:
    document = plain().set("probes.memory.of", ["slow.nothing", "sum.out"]).to_dict()
    document["probes"]["held"] = "slow.nothing"
    result = runtime.load(document).replace("slow", "UnitDelay").run()
    assert result["memory"].shape == (5,)
    assert "held" not in result
    assert result.plots[0].of == ("slow",)
    assert result.metrics == {"sum": 2.0}
    assert result.notes == [
        "'slow' is now a UnitDelay, which has no tau: dropped",
        "'slow' is now a UnitDelay, which has no 'nothing': 'slow.nothing' is dropped",
        "params.k is left out: nothing uses $k after the change",
    ]


def test_inside_a_part_and_the_part_itself() -> None:
    graph = runtime.load(PART)
    inner = graph.replace("part.gain", "UnitDelay").check()
    assert inner.run()["y"].tolist() == [0.0, 1.0, 1.0, 1.0, 1.0]
    assert inner.to_dict()["blocks"]["part"]["params"] == {}
    whole = graph.replace("part", "Constant").set("part.value", 4)
    assert whole.check().to_dict()["blocks"]["part"] == {"type": "Constant", "value": 4}
    assert any("'part.y' is dropped" in note for note in whole.notes)


def test_a_type_of_ones_own(tmp_path: Path, cli: Run) -> None:
    (tmp_path / "own.py").write_text(
        "import blocks\n\nclass Twice(blocks.Block):\n    '''Doubles.'''\n"
        "    input = blocks.Input(blocks.Scalar)\n    out = blocks.Output(blocks.Scalar)\n\n"
        "    def output(self, state, t, input):\n        return 2.0 * input\n"
    )
    graph = runtime.load(PART).replace("part.gain", f"{tmp_path / 'own.py'}:Twice")
    assert graph.run()["y"].tolist() == [2.0] * 5
    (tmp_path / "g.yaml").write_text(runtime.load(PART).to_yaml())
    done = cli("run", "g.yaml", "--replace", "part.gain=own.py:Twice", "--no-plots", "--json")
    assert done.returncode == 0, done.stderr
    assert "which has no gain: dropped" in done.stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("slw=Gain", "--replace slw=Gain: there is no block 'slw', did you mean 'slow'?"),
        ("slow=Gian", "--replace slow=Gian: slow.type: no block type 'Gian', did you mean 'Gain'?"),
        ("slow.x=Gain", "--replace slow.x=Gain: 'slow' is a block, not a part"),
        (
            "slow={type: Gain}",
            "slow: expected a type, as PathPID or my_blocks.py:Mine (--set",
        ),
        ("slow=no.py:Gain", "no such file: 'no.py'"),
        ("slow", "expected NAME=TYPE, as in lqr=PathPID"),
        ("slow=Constant", "blocks.slow.value: missing"),
    ],
)
def test_mistakes(cli: Run, tmp_path: Path, arguments: str, message: str) -> None:
    without = {**PLAIN, "probes": {"s": "sum.out"}, "plots": {}, "metrics": {}}
    (tmp_path / "g.yaml").write_text(runtime.load(without).to_yaml())
    done = cli("run", "g.yaml", "--replace", arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert "Traceback" not in done.stderr


def test_another_seed_shares_the_network_and_changes_the_numbers() -> None:
    graph = runtime.load("sine_estimation_error").set("run.until", 0.2).set("plots", {})
    fresh = {seed: graph.set("run.seed", seed).run()["errors"] for seed in (1, 2)}
    network = graph.network
    for seed, expected in fresh.items():
        again = graph.with_seed(seed)
        assert again.network.entries is network.entries
        assert np.array_equal(again.run()["errors"], expected)
        assert again.run().manifest["seed"] == seed
    with pytest.raises(GraphError, match="expected a non-negative integer"):
        graph.with_seed(-1).check()
