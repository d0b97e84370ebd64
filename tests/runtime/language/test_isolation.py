"""A user's Python files: run once per content, in a process of their own, never on hover."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.errors import GraphError
from runtime.graph import load
from runtime.language import Isolation, Model, Surroundings, complete, diagnose, hover

MODULE = '''
from pathlib import Path
from blocks import Block, Input, Output, Scalar, SignalType, ParameterError, param

print("noise on standard output")
with Path(__file__).with_name("runs.txt").open("a") as file:
    file.write("run\\n")

Wrench = SignalType("Wrench", "record", ("force", "torque"), ("N", "N m"))


class Twice(Block):
    """Double a signal.

    input ─▶ [ Twice ] ─▶ out
    """

    input = Input(Scalar, doc="what is doubled")
    out = Output(Scalar, doc="the double")
    odd: int = param(1, at_least=0, doc="an odd number")

    def validate(self):
        if self.odd % 2 == 0:
            raise ParameterError([("odd", f"expected an odd number, got {self.odd}")])

    def validate_in(self, context):
        if context.dt > 0.5:
            raise ParameterError([("odd", "too slow")])

    def output(self, state, t, input):
        return 2.0 * input
'''
GRAPH = """graph: own
run: {dt: 0.1, until: 1.0}
blocks:
  a: {type: Constant, value: 1.0}
  b: {type: Twice, module: own.py, odd: 3}
wires:
  b: {input: a.value}
probes:
  p: b.out
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "own.py").write_text(MODULE, encoding="utf-8")
    return tmp_path


@pytest.fixture
def isolation() -> Iterator[Isolation]:
    made = Isolation()
    yield made
    made.close()


def model(folder: Path, isolation: Isolation, text: str = GRAPH) -> Model:
    return Model(text, folder / "own.yaml", Surroundings(modules=isolation.reader))


def runs(folder: Path) -> int:
    file = folder / "runs.txt"
    return file.read_text(encoding="utf-8").count("run") if file.exists() else 0


def messages(model: Model) -> list[str]:
    return [found.message for found in diagnose(model)]


def test_a_file_runs_once_per_content_however_much_is_asked(
    folder: Path, isolation: Isolation
) -> None:
    for edit in ("odd: 3", "odd: 5", "odd: 7"):
        text = GRAPH.replace("odd: 3", edit)
        made = model(folder, isolation, text)
        assert messages(made) == []
        hover(made, text.index("Twice") + 1)
        complete(made, text.index("odd"))
    assert runs(folder) == 1
    (folder / "own.py").write_text(MODULE + "\nx = 1\n", encoding="utf-8")
    assert messages(model(folder, isolation)) == []
    assert runs(folder) == 2


def test_the_file_is_not_imported_into_this_process(folder: Path, isolation: Isolation) -> None:
    import sys

    before = set(sys.modules)
    assert messages(model(folder, isolation)) == []
    assert {name for name in set(sys.modules) - before if name.startswith("_blocks_of")} == set()


def test_ports_parameters_and_documentation_are_those_of_the_file(
    folder: Path, isolation: Isolation
) -> None:
    text = GRAPH.replace("odd: 3", "")
    made = model(folder, isolation, text)
    found = {offer.label: offer for offer in complete(made, text.index("own.py, ") + 8).offers}
    assert "an odd number" in found["odd"].doc
    card = hover(made, text.index("Twice") + 1)
    assert card is not None
    assert "input ─▶ [ Twice ] ─▶ out" in card.markdown


@pytest.mark.parametrize(
    ("edit", "new"),
    [
        ("odd: 3", "odd: 4"),
        ("odd: 3", "odd: -1"),
        ("odd: 3", "oddd: 1"),
        ("odd: 3", "dt: 1.0"),
        ("a.value", "a.vlaue"),
        ("type: Twice", "type: Thrice"),
        ("own.py", "other.py"),
    ],
)
def test_problems_are_those_of_an_import(
    folder: Path, isolation: Isolation, edit: str, new: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    text = GRAPH.replace(edit, new)
    (folder / "own.yaml").write_text(text, encoding="utf-8")
    with pytest.raises(GraphError) as error:
        load(folder / "own.yaml").check()
    assert model(folder, isolation, text).problems == error.value.problems


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("1 / 0", "failed: ZeroDivisionError: division by zero"),
        ("def f(:", "own.py:1: invalid syntax"),
        ("import no_such_package_at_all", "ModuleNotFoundError"),
        ("raise SystemExit(3)", "failed: SystemExit: 3"),
        ("import os; os._exit(0)", "the process that imported it ended"),
        ("class X: pass", "no block type 'Twice'"),
    ],
)
def test_an_import_that_fails_is_a_diagnostic(
    folder: Path, isolation: Isolation, code: str, message: str
) -> None:
    (folder / "own.py").write_text(code, encoding="utf-8")
    found = diagnose(model(folder, isolation))
    assert message in found[0].message
    assert found[0].severity == "error"


def test_an_import_that_hangs_is_a_diagnostic(
    folder: Path, isolation: Isolation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.language.isolation.IMPORT_SECONDS", 0.5)
    (folder / "own.py").write_text("while True:\n    pass\n", encoding="utf-8")
    for _ in range(2):  # the second time it is remembered
        assert "took longer than 0.5 s" in messages(model(folder, isolation))[0]


def test_a_question_does_not_wait_longer_than_its_patience(folder: Path) -> None:
    import threading

    ended = threading.Event()
    isolation = Isolation(patience=0.0, on_change=ended.set)
    try:
        assert "is being imported; what needs it" in messages(model(folder, isolation))[0]
        assert ended.wait(30.0)
        assert messages(model(folder, isolation)) == []
    finally:
        isolation.close()


def test_a_check_that_hangs_is_a_diagnostic(
    folder: Path, isolation: Isolation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("runtime.language.isolation.ANSWER_SECONDS", 0.5)
    code = MODULE.replace(
        "if self.odd % 2 == 0:", "while self.odd == 9:\n            pass\n        if 0:"
    )
    (folder / "own.py").write_text(code, encoding="utf-8")
    assert messages(model(folder, isolation)) == []
    found = messages(model(folder, isolation, GRAPH.replace("odd: 3", "odd: 9")))
    assert "took longer than 0.5 s" in found[0]


def test_nothing_is_imported_where_modules_are_refused(folder: Path) -> None:
    made = Model(GRAPH, folder / "own.yaml", Surroundings(modules=False))
    assert "modules are refused" in messages(made)[0]
    assert runs(folder) == 0
