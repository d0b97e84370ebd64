"""What a newcomer meets first: new, graphs, blocks, completion, and errors with their line."""

from __future__ import annotations

import importlib.metadata
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import runtime
from runtime.cli import run
from runtime.cli.commands import VERBS
from runtime.cli.shipped import shipped, summary
from runtime.terminal import in_colour
from tests.conftest import Run
from tests.runtime.broken import SOUND, changed

ROOT = Path(runtime.__file__).parents[1]


@pytest.mark.parametrize("name", [each.name for each in shipped("starters")])
def test_a_starter_is_written_runs_and_has_values(name: str, cli: Run, tmp_path: Path) -> None:
    done = cli("new", "mine.yaml", "--from", name)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("mine.yaml\n")
    done = cli("run", "mine.yaml", "--json", "--until", "12", "--no-plots")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["notes"] == []
    assert summary["metrics"]
    assert "my.yaml" not in (tmp_path / "mine.yaml").read_text()


@pytest.mark.parametrize("verb", ["", *VERBS.names()])
def test_every_help_says_what_it_does_and_fits_a_terminal(
    verb: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        run([*verb.split(), "--help"])
    lines = capsys.readouterr().out.splitlines()
    assert [line for line in lines if len(line) > 80] == []
    assert lines[lines.index("") - 1].endswith(".") and not lines[0].startswith("usage")
    examples = lines[-lines[::-1].index("") :]
    assert sum(line.startswith("  runtime ") for line in examples) >= 2


def test_the_backlash_of_the_starter_has_its_closed_form(cli: Run, tmp_path: Path) -> None:
    """A wave of amplitude 1 behind a play of 0.4 reaches 0.8 within a step's change of the wave."""
    assert cli("new", "own.yaml", "--from", "own_block").stdout.split()[:2] == [
        "own.yaml",
        "own.py",
    ]
    result = runtime.load(tmp_path / "own.yaml").run()
    wave, play = result["both"][1:].T
    assert result.metrics["largest"] == pytest.approx(0.8, abs=1e-4)
    assert (abs(wave - play) <= 0.2 + 0.013).all()


def test_new_without_a_file_lists_the_starters(cli: Run, tmp_path: Path) -> None:
    done = cli("new")
    assert [line.split()[0] for line in done.stdout.splitlines()[:-2]] == [
        each.name for each in shipped("starters")
    ]
    assert list(tmp_path.iterdir()) == []


def test_a_shipped_graph_can_be_copied(cli: Run, tmp_path: Path) -> None:
    assert cli("new", "case.yaml", "--from", "line_actuator_failure").returncode == 0
    assert runtime.load(tmp_path / "case.yaml") == runtime.load("line_actuator_failure")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["there.yaml"], "'there.yaml' exists already; choose another name, or remove it"),
        (["a.txt"], "'a.txt': expected a file that ends with .yaml, as in my.yaml"),
        (["a.yaml", "--from", "adaptiv"], "no such starter or graph, did you mean 'adaptive'?"),
        (["no/a.yaml"], "cannot write 'no/a.yaml': No such file or directory"),
    ],
)
def test_new_refuses_and_says_why(
    arguments: list[str], message: str, cli: Run, tmp_path: Path
) -> None:
    (tmp_path / "there.yaml").write_text("mine")
    done = cli("new", *arguments)
    assert done.returncode == 2
    assert message in done.stderr
    assert (tmp_path / "there.yaml").read_text() == "mine"


def test_graphs_lists_every_shipped_file(cli: Run) -> None:
    listed = json.loads(cli("graphs", "--json").stdout)
    files = {path.relative_to(ROOT / "graphs") for path in (ROOT / "graphs").rglob("*.yaml")}
    assert {
        Path(*(() if group == "graphs" else (group,)), f"{name}.yaml")
        for group, members in listed.items()
        for name in members
    } == files
    assert all(text for members in listed.values() for text in members.values())
    assert list(listed)[:2] == ["graphs", "starters"]
    done = cli("graphs", "world")
    assert done.returncode == 2
    assert done.stderr == "no group 'world', did you mean 'worlds'?\n"


def test_a_summary_is_the_first_sentence_of_the_comment() -> None:
    assert summary("# Turn rate down by 3.5 %,\n# at once. More.\n#\n# rest\na: 1\n") == (
        "Turn rate down by 3.5 %, at once"
    )
    assert summary("a: 1\n# late\n") == ""


def test_blocks_are_listed_by_family_and_found_by_a_word(cli: Run) -> None:
    lines = cli("blocks").stdout.splitlines()
    families = [line.partition(":")[0] for line in lines if line and line[0] != " "][:-1]
    assert families[:2] == ["control", "neural"]
    assert len(families) == len(set(families))
    found = cli("blocks", "--search", "delay").stdout
    assert "UnitDelay" in found
    assert "LinePath" not in found
    assert cli("blocks", "--search", "zzzz").stderr == (
        "nothing has 'zzzz' in its name or description\n"
    )


def test_completion_is_a_script_that_bash_accepts_and_that_completes(
    cli: Run, tmp_path: Path
) -> None:
    pytest.importorskip("shtab")
    script = cli("completion", "bash").stdout
    (tmp_path / "completion.sh").write_text(script)
    ask = "source completion.sh; COMP_WORDS=(runtime va); COMP_CWORD=1; _shtab_runtime; "
    ask += 'echo "${COMPREPLY[@]}"'
    done = subprocess.run(
        ["bash", "-c", ask], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.split() == ["validate"], done.stderr


# -- errors with their line


def test_an_error_shows_its_line_with_a_caret(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(changed(SOUND, ("q: [1, 1, 1]", "qq: [1, 1, 1]")))
    done = cli("validate", "g.yaml")
    assert done.stderr == (
        "g.yaml:7:20: blocks.lqr.qq: unknown parameter, did you mean 'q'?\n"
        "     7 |   lqr: {type: LQR, qq: [1, 1, 1], r: [1, 1]}\n"
        "       |                    ^\n"
    )


def test_a_long_line_is_cut_around_the_caret(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(f"{{a: '{'x' * 300}', wirs: {{}}, b: '{'y' * 300}'}}")
    lines = cli("validate", "g.yaml").stderr.splitlines()
    first = next(i for i, line in enumerate(lines) if "wirs: unknown section" in line)
    line, caret = lines[first + 1 : first + 3]
    assert len(line) < 110
    assert line[caret.index("^") :].startswith("wirs: {}")


def test_a_line_with_a_control_character_is_shown_without_it(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text("graph: 'a\x1b[31mb'\n")
    shown = cli("validate", "g.yaml").stderr
    assert "     1 | graph: 'a [31mb'\n" in shown
    assert "\x1b" not in shown


def test_a_change_on_the_command_line_has_no_source_line(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text(SOUND)
    done = cli("validate", "g.yaml", "--set", "lqr.q=[1]")
    assert done.stderr.count("\n") == 1
    assert done.stderr.startswith("--set lqr.q=[1]: blocks.lqr.q: expected")


def test_errors_have_colour_on_a_terminal_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    parent, child = os.openpty()
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    with os.fdopen(child, "w") as stream, Path(os.devnull).open("w") as other:
        assert in_colour(stream)
        assert not in_colour(other)
        monkeypatch.setenv("NO_COLOR", "1")
        assert not in_colour(stream)
        monkeypatch.delenv("NO_COLOR")
        monkeypatch.setenv("TERM", "dumb")
        assert not in_colour(stream)
    os.close(parent)


# -- answers to first mistakes


@pytest.mark.parametrize(
    ("arguments", "answer"),
    [
        (["vaildate", "g.yaml"], "did you mean 'validate'?; 'runtime --help' shows the usage\n"),
        (
            ["run", "g.yaml", "--sed", "3"],
            "unrecognized arguments: --sed 3, did you mean '--seed'?",
        ),
    ],
)
def test_a_misspelt_verb_or_option_is_answered(cli: Run, arguments: list[str], answer: str) -> None:
    done = cli(*arguments)
    assert done.returncode == 2
    assert answer in done.stderr
    assert done.stderr.count("\n") == 1


def test_a_list_that_is_not_opened_is_answered(cli: Run, tmp_path: Path) -> None:
    (tmp_path / "g.yaml").write_text("blocks: {a: {type: LQR, q: 1, 2, 3], r: [1, 1]}}\n")
    done = cli("validate", "g.yaml")
    assert done.stderr.startswith("g.yaml:1:35: not valid YAML: this ']' has no '[' before it\n")


MISTAKES = {
    ("--set", "lqr=PathPID"): "takes the place of this one with --replace lqr=PathPID",
    ("--set", "v_r=2"): "there is no 'v_r' in the graph, did you mean 'params.v_r' or 'match.v_r'",
    (
        "--set",
        "omega_max=2",
    ): "there is no 'omega_max' in the graph, did you mean 'limit.omega_max'?",
    (
        "--with",
        "turn_loss_5",
    ): "no such graph, did you mean 'conditions/turn_loss_50'?",
    (
        "--with",
        "conditions/turn_los",
    ): "did you mean 'conditions/turn_loss_35' or 'conditions/turn_loss_50'?\n",
    ("--with", "conditions/zzz"): "shipped conditions: conditions/delay, conditions/lag, ",
}


@pytest.mark.parametrize("change", MISTAKES)
def test_a_first_mistake_is_answered(change: tuple[str, str], cli: Run) -> None:
    done = cli("validate", "line_actuator_failure", *change)
    assert done.returncode == 2
    assert MISTAKES[change] in done.stderr


def test_a_factor_without_its_section_is_answered(cli: Run) -> None:
    done = cli("sweep", "line_actuator_failure", "--vary", "v_r=1..2:2")
    assert done.returncode == 2
    assert "did you mean 'params.v_r'" in done.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--until", "5s"], "argument --until: expected a number, got '5s'"),
        (["--seed", "x"], "argument --seed: expected an integer, got 'x'"),
    ],
)
def test_an_option_that_is_not_a_number_is_answered(
    options: list[str], message: str, cli: Run
) -> None:
    done = cli("run", "line_actuator_failure", *options)
    assert done.returncode == 2
    assert message in done.stderr


# -- imports


def test_the_installed_name_can_be_imported() -> None:
    import spikeblocks

    assert spikeblocks.load is runtime.load
    assert spikeblocks.blocks.Gain(gain=2.0).gain == 2.0
    assert set(dir(spikeblocks)) == {*runtime.__all__, "blocks", "__version__"}
    assert spikeblocks.__version__ == importlib.metadata.version("spikeblocks")


@pytest.mark.parametrize("hidden", ["blocks", "runtime"])
def test_a_folder_of_the_users_own_that_hides_ours_is_named(hidden: str, tmp_path: Path) -> None:
    (tmp_path / hidden).mkdir()
    (tmp_path / hidden / "__init__.py").write_text("")
    done = subprocess.run(
        [sys.executable, "-c", "import spikeblocks"], cwd=tmp_path, capture_output=True, text=True
    )
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError: your own '")
    assert f"hides the package '{hidden}' of spikeblocks; rename it, or start Python in" in last


@pytest.mark.parametrize("hidden", ["blocks/__init__.py", "blocks/mine.py", "runtime.py"])
def test_the_command_reports_what_hides_ours_in_one_sentence(hidden: str, tmp_path: Path) -> None:
    (tmp_path / hidden).parent.mkdir(exist_ok=True)
    (tmp_path / hidden).write_text("")
    command = [sys.executable, "-m", "spikeblocks_command", "--version"]
    found = {**os.environ, "PYTHONPATH": str(runtime.PACKAGE)}
    done = subprocess.run(command, cwd=tmp_path, env=found, capture_output=True, text=True)
    is_hidden = hidden != "blocks/mine.py"  # Python prefers a package to a folder without one
    assert done.returncode == (2 if is_hidden else 0)
    assert len(done.stderr.splitlines()) == is_hidden
    assert ("hides the package" in done.stderr) == is_hidden


def test_a_part_in_place_of_a_graph_is_one_problem(cli: Run) -> None:
    done = cli("run", "parts/adaptive_snn")
    assert done.returncode == 2
    (line,) = [line for line in done.stderr.splitlines() if ".yaml:" in line]
    assert "speed_input, speed_error, turn_input, turn_error have no defaults" in line
    assert line.endswith("{name: {graph: FILE}}, needs none")


@pytest.mark.parametrize(
    "name",
    [
        "cart_pole_push",
        "recorded_push",  # with its data
        "zero_order_hold",  # which extends another one
        "circular_convolution",  # with a part
    ],
)
def test_a_copy_of_the_gallery_is_valid_where_it_is(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run(["new", "own.yaml", "--from", f"gallery/{name}"]) == 0
    assert run(["validate", "own.yaml", "-q"]) == 0, capsys.readouterr().err
    assert (tmp_path / "own.csv").exists() == (name == "recorded_push")


def test_shipped_graphs_are_searched_by_word_and_by_block(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["graphs", "gallery", "--search", "thermoSTAT"]) == 0
    group, found = capsys.readouterr().out.splitlines()
    assert group.startswith("gallery (run one")
    assert found.split()[0] == "thermostat"
    assert run(["graphs", "--search", "type: Relay", "--json"]) == 0
    assert "thermostat" in json.loads(capsys.readouterr().out)["gallery"]
    assert run(["graphs", "--search", "no such word"]) == 2
