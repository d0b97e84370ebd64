"""Every verb is started by a test, and says what it and each of its options do."""

from __future__ import annotations

import argparse
import re
from pathlib import Path

import pytest

from runtime.cli import make_parser
from runtime.cli.commands import VERBS

TESTS = Path(__file__).parents[2]


def test_every_verb_is_started_by_a_test() -> None:
    texts = [path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py")]
    # As the first word of a command: cli("run", ...), run(["run", ...]), or of a document's.
    started = {word for text in texts for word in re.findall(r'[(\[]\s*"([a-z]+)"', text)}
    assert sorted(VERBS.lazy.keys() - started) == [], "write a test that starts the new verb"


@pytest.mark.parametrize("name", VERBS.lazy)
def test_every_option_is_explained(name: str) -> None:
    verb = VERBS[name]
    assert verb.HELP
    (commands,) = make_parser({name: verb})._subparsers._group_actions  # type: ignore[union-attr]
    assert isinstance(commands, argparse._SubParsersAction)
    for action in commands.choices[name]._actions:
        if action.choices is None:
            assert action.help, f"runtime {name}: {action.option_strings or action.dest}"
