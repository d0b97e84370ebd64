"""What code of others raised, in words: any exception, also one whose text fails."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from blocks.foreign import LONGEST, raised_text

RAISED = {
    "import sys\nsys.exit(0)": "SystemExit: 0 (own.py:2)",
    "raise GeneratorExit": "GeneratorExit (own.py:1)",
    "class Own(BaseException):\n    def __str__(self): raise Own\nraise Own": (
        "Own: its text cannot be had, since __str__ fails (own.py:3)"
    ),
    "class Own(Exception):\n    def __str__(self): return 1\nraise Own": (
        "Own: its text cannot be had, since __str__ fails (own.py:3)"
    ),
}


@pytest.mark.parametrize("text", RAISED)
@pytest.mark.parametrize("words", [("check", "own.py"), ("blocks", "--module", "own.py")])
def test_a_file_that_raises_anything_is_refused(
    text: str, words: tuple[str, ...], tmp_path: Path, cli: Callable[..., Any]
) -> None:
    (tmp_path / "own.py").write_text(text, encoding="utf-8")
    done = cli(*words, cwd=tmp_path)
    assert done.returncode == 2 and done.stdout == ""
    assert done.stderr == f"cannot load 'own.py': {RAISED[text]}\n"


@pytest.mark.parametrize("text", RAISED)
def test_a_graph_says_what_its_file_raised(
    text: str, tmp_path: Path, cli: Callable[..., Any]
) -> None:
    (tmp_path / "own.py").write_text(text, encoding="utf-8")
    graph = "run: {until: 1}\nblocks: {a: {type: Own, module: own.py}}\n"
    (tmp_path / "own.yaml").write_text(graph, encoding="utf-8")
    done = cli("validate", "own.yaml", cwd=tmp_path)
    assert done.returncode == 2 and "Traceback" not in done.stderr
    assert f"own.py failed: {RAISED[text]}" in done.stdout + done.stderr


def test_control_c_goes_on_and_long_texts_are_cut() -> None:
    with pytest.raises(KeyboardInterrupt):
        raised_text(KeyboardInterrupt())
    assert raised_text(ValueError("a" * 10**6)) == f"ValueError: {'a' * LONGEST}"


def test_a_misspelt_attribute_has_a_suggestion() -> None:
    class Own:
        tau = 1.0

    with pytest.raises(AttributeError) as caught:
        getattr(Own(), "tua")  # noqa: B009 -- type checkers know that it has none
    text = raised_text(caught.value, with_place=False)
    assert text == "AttributeError: 'Own' object has no attribute 'tua', did you mean 'tau'?"
