"""The fuzzer of own blocks finds what differs, shows it small, and repeats itself."""

from __future__ import annotations

import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from runtime.engine import Engine
from tests.fuzz.own_blocks import engines
from tests.fuzz.own_blocks.engines import Batch, tried
from tests.fuzz.own_blocks.generator import EXPRESSIONS, Maker, Program, program
from tests.fuzz.own_blocks.shrinking import smallest


def test_a_program_is_the_same_each_time() -> None:
    assert [program(3, n) for n in range(30, 90)] == [program(3, n) for n in range(30, 90)]
    assert program(3, 80) != program(4, 80)


def test_every_form_of_an_expression_is_python() -> None:
    for kind, forms in EXPRESSIONS.items():
        for form in forms:
            maker = Maker(random.Random(form))
            text = maker.filled(form.lstrip("~?"), 1, {"c": "y"})
            compile(text, f"{kind}: {form}", "eval")


@pytest.mark.slow
def test_most_programs_run_without_a_failure() -> None:
    ways = tried([program(1, n) for n in range(100, 300)])
    assert 100 < sum(not way for way in ways.values()) < 200


def test_what_differs_is_found_and_made_small(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Another seed stands for a faulty engine: only what is drawn differs.
    monkeypatch.setattr(engines, "RUNNERS", {"compiled": None})
    run = Batch.run

    def other(self: Batch, kind: str, active: Sequence[str]) -> Any:
        seed = 1 if kind == "compiled" else 0
        for name in ("Engine", "Bare"):
            monkeypatch.setattr(engines, name, lambda made, _, *rest: Engine(made, seed, *rest))
        return run(self, kind, active)

    monkeypatch.setattr(Batch, "run", other)

    def check(programs: Sequence[Program]) -> dict[str, str]:
        ways = tried(programs)
        steady = [each for each in programs if not ways[each.name]]
        batch = Batch(steady, tmp_path)
        return {d.program.name: d.kind for d in batch.compared([p.name for p in steady])}

    same = Program("P1", ("y = x * 2.0", "r[0] = y", "r[1] = v[0] + state.h[2]"))
    drawn = Program("P2", ("y = x * 2.0", "r[0] = y", "r[1] = y + state.rng.random() * 3.0"))
    assert check([same, drawn]) == {"P2": "value"}
    assert smallest(drawn, "value", check).statements == ("r[1] = state.rng.random()",)
