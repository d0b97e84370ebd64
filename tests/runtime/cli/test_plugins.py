"""Verbs, diagram formats, export targets and solvers of packages; `runtime plugins` lists them."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import runtime
from runtime.cli import run
from runtime.cli.commands import VERBS
from runtime.cli.commands.plugins import REGISTRIES, registry
from runtime.errors import UsageError
from tests.blocks.test_extensions import package

VERB = '''"""Say it."""
HELP = "say a word, 100 % surely"


def add(parser):
    parser.add_argument("word")


def run(options):
    if options.word == "nothing":
        raise ValueError("nothing to say")
    print(options.word)
    return 7
'''
FORMAT = """from runtime.diagrams import DiagramFormat

LIST = DiagramFormat("names of blocks", lambda network: " ".join(sorted(network.entries)), ("lst",))
"""
TARGET = """from pathlib import Path
from runtime.export import Exported, ExportTarget


def write(graph, folder, **options):
    names = options.get("separator", " ").join(graph.network.entries)
    return Exported(Path(folder), ("names.txt",), names, (), ())


SEPARATOR = {"metavar": "X", "help": "between 100 % of the names"}
NAMES = ExportTarget("names only", write, {"separator": SEPARATOR, "json": {}})
"""
SOLVER = """import numpy as np
from blocks import DecoderSolver


class Pseudo(DecoderSolver):
    "The pseudo-inverse."

    def solve(self, a, y, rng):
        return np.linalg.pinv(a) @ y
"""
GRAPH = """graph: g
run: {dt: 0.001, until: 0.01}
blocks:
  c: {type: Constant, value: 0.5}
  e: {type: Ensemble, neurons: 20, dimensions: 1}
  d: {type: Decoder, solver: pseudo}
wires: {e: {input: c.value}, d: {spikes: e.spikes}}
probes: {value: d.value}
"""


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Packages that work, and one of each kind that does not."""
    folder, before = tmp_path / "site", set(sys.modules)
    package(folder, "sb_verb", "[spikeblocks.verbs]\nsay = sb_verb\n", VERB)
    package(folder, "sb_list", "[spikeblocks.diagrams]\nlist = sb_list:LIST\n", FORMAT)
    package(folder, "sb_names", "[spikeblocks.exports]\nnames = sb_names:NAMES\n", TARGET)
    package(folder, "sb_pseudo", "[spikeblocks.solvers]\npseudo = sb_pseudo:Pseudo\n", SOLVER)
    package(folder, "sb_broken", "[spikeblocks.verbs]\nbreak = sb_broken\n", "raise OSError('no')")
    package(folder, "sb_half", "[spikeblocks.verbs]\nhalf = sb_half\n", "HELP = 'half'")
    fails = VERB.replace('parser.add_argument("word")', "parser.add_argumnt()")
    package(folder, "sb_fails", "[spikeblocks.verbs]\nfail = sb_fails\n", fails)
    package(folder, "sb_mine", "[spikeblocks.verbs]\nrun = sb_mine\n", "raise OSError('imported')")
    package(folder, "sb_typo", "[spikeblocks.metric]\nrms = sb_typo:RMS\n", "")
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.chdir(tmp_path)
    yield folder
    for name in set(sys.modules) - before:
        if name.startswith("sb_"):
            del sys.modules[name]


def test_every_registry_is_where_the_list_says() -> None:
    for name in REGISTRIES:
        assert registry(name).name == name
        assert registry(name).names()


def test_a_verb_of_a_package_runs(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["say", "hello"]) == 7
    assert capsys.readouterr().out == "hello\n"
    # The other packages are not imported.
    assert not {"sb_broken", "sb_half", "sb_fails", "sb_list"} & set(sys.modules)


def test_what_a_verb_raises_names_the_package(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["say", "nothing"]) == 2
    said = capsys.readouterr().err
    assert "'say' of package sb_verb 1.0: ValueError: nothing to say (" in said
    assert "sb_verb.py:11)" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("verb", "reason"),
    [
        ("break", "sb_broken cannot be imported: OSError: no"),
        ("half", "sb_half is not a module with HELP, add and run"),
    ],
)
def test_a_broken_verb_is_one_line(
    site: Path, capsys: pytest.CaptureFixture[str], verb: str, reason: str
) -> None:
    assert run([verb, "x"]) == 2
    assert reason in capsys.readouterr().err


def test_help_lists_what_works_and_notes_the_rest(
    site: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        run(["--help"])
    said = capsys.readouterr()
    assert ended.value.code == 0
    assert "say a word, 100 % surely" in said.out
    for package_name in ("sb_broken", "sb_half", "sb_fails"):
        assert sum(f"package {package_name} 1.0" in line for line in said.err.splitlines()) == 1
    assert "add_argumnt" in said.err
    assert "half" not in said.out
    assert run(["fail", "x"]) == 2
    assert capsys.readouterr().err.startswith("'fail' of package sb_fails 1.0: AttributeError")


def test_a_diagram_format_of_a_package(site: Path) -> None:
    Path("g.yaml").write_text(GRAPH.replace("pseudo", "l2"))
    assert run(["draw", "g.yaml", "-o", "g.list", "--format", "list"]) == 0
    assert Path("g.list").read_text() == "c d e"
    with pytest.raises(UsageError, match="no diagram format 'lst', did you mean 'list'"):
        runtime.load("g.yaml").diagram("lst")


def test_an_export_target_of_a_package(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("g.yaml").write_text(GRAPH.replace("pseudo", "l2"))
    assert run(["export", "g.yaml", "out", "--to", "names"]) == 0
    assert capsys.readouterr().out.splitlines() == ["c e d", "written to out: names.txt"]
    assert run(["export", "g.yaml", "out", "--to", "name"]) == 2
    assert "no export target 'name', did you mean 'names'?" in capsys.readouterr().err
    assert run(["export", "g.yaml", "out", "--to", "names", "--separator", "-"]) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == "c-e-d"
    # An option that the verb has itself is a note, and stays the verb's.
    assert said.err.startswith("note: --json of export target 'names': ArgumentError")
    assert run(["export", "g.yaml", "out", "--to", "c", "--separator", "-"]) == 2
    assert "--separator: this option is for --to names" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        run(["export", "--help"])
    assert "names: names only" in " ".join(capsys.readouterr().out.split())


def test_a_solver_of_a_package(site: Path) -> None:
    Path("g.yaml").write_text(GRAPH)
    graph = runtime.load("g.yaml")
    assert graph.run(engine="python").status == "complete"
    assert type(graph.network.entries["d"].block.value("solver")).__name__ == "Pseudo"


def test_plugins_lists_origins_and_failures(site: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["plugins", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    offers = {each["name"]: each for each in found["plugins"]}
    assert offers["say"] == {
        "kind": "verbs",
        "name": "say",
        "package": "sb_verb 1.0",
        "module": "sb_verb",
    }
    assert {"list", "names", "pseudo"} <= set(offers)
    assert not {"break", "half", "run"} & set(offers)
    for text in (
        "'break' of package sb_broken 1.0: sb_broken cannot be imported: OSError: no",
        "'half' of package sb_half 1.0: sb_half is not a module with HELP, add and run",
        "'run' of package sb_mine 1.0 is not used: the library has that name itself",
    ):
        assert found["failures"].count(text) == 1
    (misspelt,) = (line for line in found["failures"] if "'spikeblocks.metric'" in line)
    assert misspelt.endswith("did you mean 'spikeblocks.metrics'?")
    assert run(["plugins"]) == 1
    said = capsys.readouterr()
    rows = [line.split() for line in said.out.splitlines()]
    assert ["verbs", "say", "sb_verb", "1.0", "sb_verb"] in rows
    assert f"error: {found['failures'][0]}" in said.err


def test_own_verbs_are_found_without_looking_at_packages(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise AssertionError("looked at packages")

    monkeypatch.setattr("blocks.library.extensions._installed", fail)
    for name in VERBS.lazy:
        assert VERBS.find(name) is not None
