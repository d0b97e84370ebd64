"""``runtime check``: the blocks of a file against the rules, and what of them compiles."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from runtime import cli

FILE = '''import numpy as np
from blocks import Block, Input, Output, Scalar, State, param


class Twice(Block):
    """Twice the input."""

    x = Input(Scalar)
    out = Output(Scalar)

    def output(self, state, t, x):
        return 2.0 * x


class Scaled(Block):
    """The input by a factor, which is kept in a dictionary."""

    x = Input(Scalar)
    out = Output(Scalar)
    factor: float = param(above=0.0, doc="by which the input is multiplied")

    def start(self, state):
        state.table = {"factor": self.factor}

    def output(self, state, t, x):
        return state.table["factor"] * x


class Forgetful(Block):
    """Counts in a list that it does not declare."""

    x = Input(Scalar)
    out = Output(Scalar)

    def start(self, state):
        state.seen = [0.0]

    def output(self, state, t, x):
        return state.seen[0]

    def update(self, state, t, x):
        state.seen[0] += x
'''


@pytest.fixture
def file(tmp_path: Path) -> str:
    path = tmp_path / "own.py"
    path.write_text(FILE)
    return str(path)


def test_each_block_is_checked(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["check", file, "Twice", "Scaled", "--set", "factor=2.5", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["blocks"]
    fine = {"status": "fine", "problems": [], "called_from_python": [], "not_copied": []}
    assert found["Twice"] == fine
    (reason,) = found["Scaled"]["called_from_python"]
    assert reason.startswith("Scaled.output is not compiled: state.table is a dict (")
    assert "own.py:" in reason

    assert cli.run(["check", file, "Forgetful", "--json"]) == 1
    (problem,) = json.loads(capsys.readouterr().out)["blocks"]["Forgetful"]["problems"]
    assert problem.startswith("Forgetful: a run that resumes from its declared states differs")


def test_what_is_missing_is_said(file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["check", file]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert lines[:2] == [
        "Twice: fine",
        "  compiles; each compiled run compares it with its Python form on some ticks",
    ]
    assert "Scaled: not checked" in lines
    assert any(line.startswith("  factor: missing; expected a number above 0") for line in lines)
    assert "Forgetful: broken" in lines


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["Twise"], "has no block 'Twise', did you mean 'Twice'?"),
        (["--set", "facto=1"], "--set facto: no block has this parameter, did you mean 'factor'?"),
        (["--set", "factor"], "--set factor: expected NAME=VALUE"),
    ],
)
def test_mistakes_are_named(
    file: str, capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert cli.run(["check", file, *arguments]) == 2
    assert message in capsys.readouterr().err


def test_a_file_without_blocks_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    empty = tmp_path / "empty.py"
    empty.write_text("")
    assert cli.run(["check", str(empty)]) == 2
    assert "defines no blocks" in capsys.readouterr().err


def test_a_file_that_is_not_there_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["check", "nothere.py"]) == 2
    assert capsys.readouterr().err == "cannot read 'nothere.py': No such file or directory\n"


def test_a_graph_is_checked_by_another_verb(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.run(["check", "my.yaml"]) == 2
    assert "expected a Python file; 'runtime validate' checks a graph" in capsys.readouterr().err


KEEPS = '''import threading
from blocks import Block, Input, Output, Scalar

LINES = iter(["a", "b"])


class Twice(Block):
    """Twice the input, beside {what}."""

    x = Input(Scalar)
    out = Output(Scalar)

    def start(self, state):
        {start}

    def output(self, state, t, x):
        return 2.0 * x

    def update(self, state, t, x):
        {update}
'''


@pytest.mark.parametrize(
    ("start", "update", "where"),
    [
        ("state.view = memoryview(bytearray(2))", "state.view[0] = 1", "state.view"),
        ("state.lock = threading.Lock()", "state.lock.locked()", "state.lock"),
        ("state.k = (k for k in range(9))", "next(state.k)", "state.k"),
        ("pass", "next(LINES, None)", "the global 'LINES'"),
        ("state.add = [].append", "state.add(x)", ""),
    ],
)
def test_memory_that_cannot_be_copied_is_a_warning(
    start: str, update: str, where: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "own.py"
    path.write_text(KEEPS.format(what="what it keeps", start=start, update=update))
    assert cli.run(["check", str(path), "--json"]) == 0
    (facts,) = json.loads(capsys.readouterr().out)["blocks"].values()
    assert facts["status"] == "fine"
    if not where:
        assert facts["not_copied"] == []
        return
    (text,) = facts["not_copied"]
    assert text.startswith(f"Twice keeps in {where} what cannot be copied (")
    assert text.endswith("such a block is not compared, not branched and not checkpointed")
