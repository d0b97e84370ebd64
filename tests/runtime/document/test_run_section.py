"""The keys of ``run`` are declared once; what is read, shown and stored follows."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

import runtime
from runtime.document import RUN_KEYS, RunSection
from runtime.errors import GraphError

GRAPH = {"blocks": {"one": {"type": "Constant", "value": 1.0}}}
ROOT = Path(__file__).parents[3]
# Of each form, values that it takes and one that it does not take.
WRONG: dict[str, tuple[Any, str]] = {
    "dt": (0, "expected a number of seconds above 0, got 0"),
    "until": ("long", "expected a number of seconds above 0, got the string 'long'"),
    "seed": (-1, "expected a non-negative integer, got -1"),
    "engine": ("fast", "there is no engine 'fast'"),
    "memory": (
        "2T",
        "expected a size in bytes for recordings, such as 512M or 2G, got the string '2T'",
    ),
    "states": ("som", "there is no states 'som'"),
    "time_unit": ("sec", "there is no time_unit 'sec'"),
    "events": (["ticks"], "there is no events ['ticks']; expected located, ticks"),
    "loops": ("solv", "there is no loops 'solv', did you mean 'solve'"),
    "keep": (0, "expected a time above 0, as in 60 or 60s"),
    "stop": (3, "expected {when: plant.contact, above: 0.5}, got 3"),
    "solver": ("dopri", "there is no solver 'dopri', did you mean 'dopri5'"),
    "rtol": (0, "expected a number above 0, got 0"),
    "atol": (True, "expected a number above 0, got true"),
    "max_step": ("1", "expected a number above 0, got the string '1'"),
}


@pytest.mark.parametrize("key", RUN_KEYS)
def test_the_file_that_a_key_names_reads_it(key: str) -> None:
    text = (ROOT / RUN_KEYS[key].acts).read_text(encoding="utf-8")
    assert re.search(rf"\b{key}\b", text), RUN_KEYS[key].acts


def test_each_key_has_a_wrong_value_here() -> None:
    assert WRONG.keys() == RUN_KEYS.keys()


@pytest.mark.parametrize("key", RUN_KEYS)
def test_a_wrong_value_of_each_key_is_reported_at_its_place(key: str) -> None:
    value, message = WRONG[key]
    run = {"solver": "dopri5"} if RUN_KEYS[key].doc.startswith("dopri5") else {}
    with pytest.raises(GraphError) as caught:
        runtime.load({**GRAPH, "run": {**run, key: value}}).check()
    (problem,) = caught.value.problems
    assert problem.address == f"run.{key}"
    assert problem.text.startswith(message), problem.text


def test_the_defaults_are_those_of_an_empty_section() -> None:
    assert RunSection().run_entries() == {"dt": 0.001, "until": 10.0, "seed": 0, "engine": "auto"}
    network = runtime.load({**GRAPH, "run": {}}).network
    assert {key: getattr(network, key) for key in RUN_KEYS} == vars(RunSection())
