"""Every verb is started by a test, and says what it and each of its options do."""

from __future__ import annotations

import argparse
import re
import shlex
from pathlib import Path

import pytest

from runtime.cli import make_parser, run
from runtime.cli.commands import VERBS

TESTS = Path(__file__).parents[2]


def test_every_verb_is_started_by_a_test() -> None:
    texts = [path.read_text(encoding="utf-8") for path in TESTS.rglob("test_*.py")]
    # As the first word of a command: cli("run", ...), run(["run", ...]), or of a document's.
    started = {word for text in texts for word in re.findall(r'[(\[]\s*"([a-z-]+)"', text)}
    assert sorted(set(VERBS.library()) - started) == [], "write a test that starts the new verb"


@pytest.mark.parametrize("name", VERBS.library())
def test_every_option_is_explained(name: str) -> None:
    verb = VERBS[name]
    assert verb.HELP
    (commands,) = make_parser({name: verb})._subparsers._group_actions  # type: ignore[union-attr]
    assert isinstance(commands, argparse._SubParsersAction)
    for action in commands.choices[name]._actions:
        if action.choices is None:
            assert action.help, f"runtime {name}: {action.option_strings or action.dest}"


@pytest.mark.parametrize("name", VERBS.library())
def test_help_begins_with_what_a_verb_does_and_ends_with_examples(name: str) -> None:
    verb = VERBS[name]
    text = parser_of(name).format_help()
    assert text.lower().startswith(verb.HELP.lower()[:40])
    end = text.partition("\nexamples:\n")[2].splitlines()
    assert len(end) >= 2
    assert all(line.startswith(f"  runtime {name}") for line in end)


@pytest.mark.parametrize("name", VERBS.library())
def test_examples_have_options_that_there_are(name: str) -> None:
    for line in VERBS[name].EXAMPLES.strip().splitlines():  # type: ignore[attr-defined]
        command = re.split(r"\s(?:>{1,2}|\|)\s|   ", line)[0]
        made = make_parser({name: VERBS[name]}).parse_args(shlex.split(command)[1:])
        assert made.command == name


@pytest.mark.parametrize("name", VERBS.library())
def test_help_is_no_wider_than_the_terminal(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = parser_of(name).format_help().partition("\nexamples:\n")[0]
    assert [line for line in text.splitlines() if len(line) > 80] == []


def test_options_that_change_a_graph_are_explained_once(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "100")
    with_changes = [n for n in VERBS.library() if "--wire" in parser_of(n)._option_string_actions]
    assert len(with_changes) >= 9
    for name in with_changes:
        text = " ".join(parser_of(name).format_help().split())
        assert "wire an input" not in text
        assert "--wire," in text and "'runtime help changes'" in text
    assert run(["help", "changes"]) == 0
    printed = capsys.readouterr().out
    assert "wire an input: lqr.error=error.state" in printed
    assert all(f"  {flag}" in printed for flag in ("--with", "--initial", "--until", "--engine"))
    # The options are there, whatever the help says.
    assert run(["validate", "starters/adaptive", "--set", "run.until=3", "-q"]) == 0


def test_the_help_begins_with_six_verbs_and_lists_each_once_in_its_group(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    text = make_parser().format_help()
    groups = dict(re.findall(r"^([a-z ]+):\n((?:  \S.*\n)+)", text, re.MULTILINE))
    verbs = {title: [line.split()[0] for line in own.splitlines()] for title, own in groups.items()}
    assert verbs.pop("options") == ["-h,", "--version"]
    assert set(verbs.pop("examples")) == {"runtime"}
    first = next(iter(verbs))
    assert verbs[first] == ["new", "run", "validate", "draw", "blocks", "ablate"]
    listed = [name for names in verbs.values() for name in names]
    assert sorted(listed) == sorted(VERBS.names())
    assert len(set(listed)) == len(listed)


def test_rare_options_are_named_and_explained_by_help_all(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    texts = []
    for flag in ("--help", "--help-all"):
        with pytest.raises(SystemExit) as ended:
            run(["run", flag])
        assert ended.value.code == 0
        texts.append(" ".join(capsys.readouterr().out.split()))
    short, whole = texts
    assert "--profile" in short and "'runtime run --help-all'" in short
    assert "show the time per block" not in short and "show the time per block" in whole
    assert "wire an input" not in short and "wire an input" in whole
    assert run(["validate", "starters/adaptive", "--no-modules", "-q"]) == 0


def test_a_command_without_a_verb_says_where_to_begin(capsys: pytest.CaptureFixture[str]) -> None:
    assert run([]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) < 12
    assert any("runtime run starters/adaptive" in line for line in lines)


def parser_of(name: str) -> argparse.ArgumentParser:
    (commands,) = make_parser({name: VERBS[name]})._subparsers._group_actions  # type: ignore[union-attr]
    assert isinstance(commands, argparse._SubParsersAction)
    found: argparse.ArgumentParser = commands.choices[name]
    return found
