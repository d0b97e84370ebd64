"""Seeds of blocks and parts: what is drawn with them does not depend on the run's."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from runtime.errors import GraphError

NOISE = {"type": "WhiteNoise", "density": 1.0}


def graph(block: dict[str, Any], part: dict[str, Any], **more: Any) -> runtime.Graph:
    """Noise alone, and two noises in a part, of which the second has a seed of its own."""
    inner = {"n": NOISE, "own": {**NOISE, "seed": 9}}
    return runtime.load(
        {
            "run": {"dt": 0.01, "until": 0.1, "seed": 5},
            "blocks": {
                "a": {**NOISE, **block},
                "p": {"outputs": {"n": "n.out", "own": "own.out"}, "blocks": inner, **part},
            },
            "probes": {"a": "a.out", "n": "p.n", "own": "p.own"},
            **more,
        }
    )


def drawn(one: runtime.Graph, seed: int, engine: str = "python") -> dict[str, np.ndarray]:
    run = one.with_seed(seed).run(engine=engine)
    return {name: run[name] for name in ("a", "n", "own")}


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_a_seed_stands_in_for_that_of_the_run(engine: str) -> None:
    plain = {seed: drawn(graph({}, {}), seed) for seed in (1, 5, 6, 9)}
    seeded = drawn(graph({"seed": 5}, {"seed": 6}), 1, engine)
    assert np.array_equal(seeded["a"], plain[5]["a"])
    assert np.array_equal(seeded["n"], plain[6]["n"])
    # What stands nearer to the block counts, whatever the seeds around it.
    assert np.array_equal(seeded["own"], plain[1]["own"])
    assert np.array_equal(plain[1]["own"], plain[9]["own"])
    assert not np.array_equal(plain[1]["n"], plain[5]["n"])


def test_blocks_of_one_seed_still_draw_different_numbers() -> None:
    found = drawn(graph({"seed": 9}, {"seed": 9}), 0)
    assert not np.array_equal(found["a"], found["n"])


def test_defaults_give_all_blocks_of_a_type_a_seed() -> None:
    found = drawn(graph({}, {}, defaults={"WhiteNoise": {"seed": 5}}), 1)
    assert np.array_equal(found["a"], drawn(graph({}, {}), 5)["a"])


def test_a_seed_is_a_factor_that_is_crossed_with_the_runs_seeds() -> None:
    one = graph({}, {}, metrics={"a": {"kind": "rms", "of": "a"}, "n": {"kind": "rms", "of": "n"}})
    swept = runtime.sweep(one, {"a.seed": [1, 2]}, seeds="0..1")
    rows = [
        (row.values["a.seed"], row.seed, row.metrics["a"], row.metrics["n"]) for row in swept.trials
    ]
    by = {(factor, seed): (a, n) for factor, seed, a, n in rows}
    # The noise `a` follows its own seed alone, and `n` the run's.
    assert by[1, 0][0] == by[1, 1][0] != by[2, 0][0]
    assert by[1, 0][1] == by[2, 0][1] != by[1, 1][1]


@pytest.mark.parametrize("seed", [-1, 1.5, True, "one"])
def test_a_wrong_seed_is_reported_where_it_is_written(seed: Any) -> None:
    with pytest.raises(GraphError) as caught:
        graph({"seed": seed}, {"seed": seed}).check()
    places = [problem.address for problem in caught.value.problems]
    assert places == ["blocks.a.seed", "blocks.p.seed"]
    assert "expected a non-negative integer" in str(caught.value)


OWN = """
import random
import numpy as np
from blocks import Block, Output, Scalar

class Mine(Block):
    "A block with noise of its own."
    out = Output(Scalar)

    def output(self, state, t):
        return DRAW
"""


@pytest.mark.parametrize(
    ("draw", "noted"),
    [
        ("np.random.rand()", True),
        ("random.random()", True),
        ("float(np.random.default_rng(3).random())", False),
        ("1.0", False),
    ],
)
def test_numbers_that_no_seed_sets_are_a_note(tmp_path: Path, draw: str, noted: bool) -> None:
    (tmp_path / "own.py").write_text(OWN.replace("DRAW", draw))
    (tmp_path / "g.yaml").write_text(
        "run: {dt: 0.1, until: 1}\nblocks:\n  m: {type: Mine, module: own.py}\nprobes: {y: m.out}\n"
    )
    notes = runtime.load(tmp_path / "g.yaml").check().network.notes
    assert [("draws from a generator" in note) for note in notes] == [True] * noted
