"""Files from untrusted sources: bounded work, nothing imported, nothing overwritten."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import zipfile
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

import runtime
from runtime.cli import run as run_verb
from runtime.diagrams.paint import draw
from runtime.diagrams.stored import MAX_BOXES, read_picture, stored_picture
from runtime.diagrams.svg import to_svg
from runtime.errors import GraphError, UsageError
from runtime.reports import report
from runtime.runs.folder import DIAGRAM
from runtime.runs.result import open_run
from runtime.terminal import printable
from tests.conftest import Run
from tests.examples import examples

# Escape, bell, delete, C1 control sequence introducer, right-to-left override, line separators.
NASTY = "\x1b[2J\x07\x7f\x9b1m\u202e\u2028\x85\u2066"


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


MODULE = """
from pathlib import Path
Path(__file__).with_name("ran").touch()
from blocks import Block, Output, Scalar

class Own(Block):
    out = Output(Scalar)
    def output(self, state, t):
        return 1.0
"""
OWN = """graph: own
run: {dt: 0.1, until: 1.0}
blocks:
  x: {type: Own, module: own.py}
probes: {x: x.out}
plots: {x: {kind: timeseries, of: x}}
metrics: {end: {kind: final, of: x}}
"""


@pytest.fixture
def verb(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Run:
    """Runs a verb as the console script does, within this process; in the test's folder."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments: str, **_: Any) -> subprocess.CompletedProcess[str]:
        code: Any
        try:
            code = run_verb(arguments)
        except SystemExit as left:
            code = left.code
        seen = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, code, seen.out, seen.err)

    return run


@pytest.fixture
def own(tmp_path: Path) -> Path:
    """A run of a user block, whose module writes a file when it is imported."""
    write(tmp_path, {"own.py": MODULE, "own.yaml": OWN})
    folder: Path = runtime.load(tmp_path / "own.yaml").run().save(tmp_path / "run")
    (tmp_path / "ran").unlink()
    assert not (folder / "ran").exists()
    return folder


def test_viewing_a_run_imports_nothing(cli: Run, own: Path) -> None:
    for arguments in (["report", "run"], ["compare", "run", "run", "--exact", "--no-plots"]):
        done = cli(*arguments)
        assert done.returncode == 0, done.stderr
    assert cli("render", "run", "--no-film").returncode in (2, 4)
    assert not list(own.parent.rglob("ran"))
    assert "block diagram of own" in (own / "report.html").read_text()


@pytest.mark.parametrize(
    "verb", ["validate", "draw", "explain", "run", "sweep", "ablate"], ids=lambda verb: str(verb)
)
def test_modules_are_refused_where_that_is_asked_for(
    verb: str, cli: Run, own: Path, tmp_path: Path
) -> None:
    done = cli(verb, "own.yaml", "--no-modules")
    assert done.returncode == 2, done.stdout
    message = done.stderr
    assert "own.yaml:4:13: blocks.x.type: 'own.py' was not imported" in message
    assert not list(tmp_path.rglob("ran"))


def test_a_block_is_not_replaced_by_one_of_a_module(own: Path) -> None:
    graph = runtime.load(own.parent / "own.yaml", modules=False)
    with pytest.raises(GraphError, match="was not imported"):
        graph.replace("x", f"{own.parent}/own.py:Own")
    assert not (own.parent / "ran").exists()


def test_a_variant_of_another_graph_is_refused_its_modules_too(cli: Run, own: Path) -> None:
    experiment = (
        f"graph: line_actuator_failure\nvariants: {{v: {{graph: {own.parent}/own.yaml}}}}\n"
    )
    write(own.parent, {"e.yaml": experiment})
    done = cli("ablate", "e.yaml", "--no-modules")
    assert done.returncode == 2
    assert "was not imported" in done.stderr
    assert not list(own.parent.rglob("ran"))


def test_a_diagram_is_drawn_from_what_the_folder_holds(own: Path) -> None:
    graph = runtime.load("line_actuator_failure")
    text = stored_picture(graph.network, graph.observation.probes.values())
    assert text is not None
    again = to_svg(draw(read_picture(text)))
    assert again == graph.diagram()
    (own / DIAGRAM).unlink()
    assert "This folder has no diagram" in report(own).html


@pytest.fixture(scope="module")
def stored() -> Any:
    text = stored_picture(runtime.load("wall_following").network)
    assert text is not None
    return json.loads(text)


def _places(value: Any) -> list[tuple[Any, Any]]:
    inside = list(value.items() if isinstance(value, dict) else enumerate(value))
    found = [(value, key) for key, _ in inside]
    for _, item in inside:
        if isinstance(item, (dict, list)):
            found += _places(item)
    return found


@examples(60, suppress_health_check=[*HealthCheck])
@given(data=st.data())
def test_a_diagram_with_something_else_in_it_is_drawn_or_refused(
    stored: Any, data: st.DataObject
) -> None:
    changed = json.loads(json.dumps(stored))
    wrong: tuple[Any, ...] = (
        None,
        True,
        -1,
        1e300,
        "x",
        "</svg><script>",
        [],
        ["x"],
        {},
        [["x", "y"]],
        ...,
    )
    for _ in range(data.draw(st.integers(1, 3))):
        owner, key = data.draw(st.sampled_from(_places(changed)))
        value = data.draw(st.sampled_from(wrong))
        if value is ...:
            del owner[key]
        else:
            owner[key] = deepcopy(value)
    try:
        drawn = to_svg(draw(read_picture(json.dumps(changed))))
    except ValueError:
        return
    assert "<script" not in drawn


def test_a_large_graph_stores_no_diagram() -> None:
    graph = runtime.Graph("large", dt=0.1, until=1.0)
    blocks = {f"c{i}": {"type": "Constant", "value": 1.0} for i in range(MAX_BOXES + 1)}
    large = graph.overlay({"blocks": blocks})
    assert stored_picture(large.network) is None


def test_hashes_are_checked(own: Path) -> None:
    assert open_run(own).notes == []
    (own / "own.py").write_text("")
    (own / "graph.yaml").write_text(OWN + "#")
    notes = open_run(own).notes
    assert len(notes) == 2 and all("was changed after the run was saved" in n for n in notes)
    metrics = json.loads((own / "metrics.json").read_text())
    (own / "metrics.json").write_text(json.dumps({**metrics, "end": 2.0}))
    with pytest.raises(UsageError, match=r"metrics.json' is damaged: it is not the file that was"):
        open_run(own)


def test_an_archive_that_unfolds_is_refused(own: Path) -> None:
    arrays = dict(np.load(own / "probes.npz"))
    np.savez_compressed(own / "probes.npz", **arrays)
    with pytest.raises(UsageError, match=r"probes.npz' is damaged: it is compressed"):
        open_run(own)
    names = [f"{name}.npy" for name in arrays]
    with zipfile.ZipFile(own / "probes.npz", "w") as archive:
        for name in names:
            archive.writestr(name, b"x")
    data = bytearray((own / "probes.npz").read_bytes())
    at = data.index(b"PK\x01\x02")
    data[at + 24 : at + 28] = (2**31).to_bytes(4, "little")  # the declared uncompressed size
    (own / "probes.npz").write_bytes(bytes(data))
    with pytest.raises(UsageError, match="declared larger than the file"):
        open_run(own)


def test_printable() -> None:
    assert printable("plain – ü\n  text") == "plain – ü\n  text"
    shown = printable(NASTY)
    assert shown.isprintable() and shown.isascii()
    assert "\\x1b[2J" in shown and "\\u202e" in shown and "\\u2028" in shown
    assert printable("\ud800") == "\\ud800"


def _is_clean(done: subprocess.CompletedProcess[str]) -> bool:
    return all(c.isprintable() or c == "\n" for c in done.stdout + done.stderr)


def test_no_verb_lets_a_text_act_on_the_terminal(verb: Run, own: Path, tmp_path: Path) -> None:
    quoted = json.dumps(NASTY)
    raising = MODULE.replace("return 1.0", f"raise ValueError({NASTY!r})")
    documented = f'class A(Own):\n    """{NASTY}"""\n'.replace("\x85", "").replace("\u2028", "")
    write(tmp_path, {"bad.py": raising + documented})
    graph = f"graph: {quoted}\nblocks: {{{quoted}: {{type: {quoted}}}, x: {{type: Constant}}}}\n"
    write(tmp_path, {"names.yaml": graph, "raise.yaml": OWN.replace("own.py", "bad.py")})
    manifest = json.loads((own / "manifest.json").read_text())
    manifest["notes"], manifest["failures"] = [NASTY], [NASTY]
    manifest["error"] = manifest["source"] = NASTY
    manifest["versions"]["numpy"] = NASTY
    (own / "manifest.json").write_text(json.dumps(manifest))
    other = runtime.load(tmp_path / "own.yaml").run().save(tmp_path / "other")
    for arguments in (
        *(["validate", "names.yaml"], ["run", "raise.yaml"], ["sweep", "raise.yaml", "-j", "1"]),
        *(["blocks", "A", "--module", "bad.py"], ["compare", "run", str(other), "--no-plots"]),
        *([f"--no{NASTY}"], ["report", "run"], ["draw", "own.yaml", "--set", f"{NASTY}=1"]),
    ):
        done = verb(*arguments)
        assert _is_clean(done), (arguments, done.stdout, done.stderr)
        assert "Traceback" not in done.stderr, done.stderr
    page = (own / "report.html").read_text(encoding="utf-8")
    assert not set(page) & set(NASTY.replace("[2J", "").replace("1m", ""))


def test_json_is_ascii_without_controls(cli: Run, own: Path) -> None:
    write(own.parent, {"names.yaml": "blocks: {'a\x7f\u202e': {type: Sum}}\n".replace("\x7f", "")})
    done = cli("validate", "names.yaml", "\x7f.yaml", "--json")
    assert done.stdout.isascii() and "\x7f" not in done.stdout
    assert "\x7f.yaml" in json.loads(done.stdout)["problems"]


def test_an_encoding_that_lacks_letters_is_no_error(own: Path, script: Path) -> None:
    code = "import sys; from runtime.terminal import show; show('w\\u00fc \\u25b8')"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, env={"PYTHONIOENCODING": "ascii"}
    )
    assert done.stdout == b"w\\xfc \\u25b8\n"


def test_a_report_replaces_a_link_and_not_its_target(verb: Run, own: Path, tmp_path: Path) -> None:
    target = tmp_path / "precious.txt"
    target.write_text("precious")
    (own / "report.html").symlink_to(target)
    (own / ".report.html.partial").symlink_to(target)
    assert verb("report", "run").returncode == 0
    assert target.read_text() == "precious"
    assert not (own / "report.html").is_symlink()
    assert (own / "report.html").read_text().startswith("<!doctype html>")


def test_latest_that_leads_elsewhere_is_not_written_through(
    verb: Run, own: Path, tmp_path: Path
) -> None:
    foreign = tmp_path / "foreign"
    foreign.mkdir()
    (foreign / "latest").symlink_to(own)
    done = verb("report", "foreign/latest")
    assert done.returncode == 2
    assert "is a link that leads to" in done.stderr
    assert not (own / "report.html").exists()
    assert verb("report", "foreign/latest", "-o", "mine.html").returncode == 0
    (tmp_path / "latest").symlink_to("run")
    assert verb("report", "latest").returncode == 0


def test_a_world_set_by_name_keeps_its_places(cli: Run, tmp_path: Path) -> None:
    write(tmp_path, {"bad.yaml": "room: [[0, 0], [4, 0], [4, 3], [0, 3]]\ncircles: [[1, 1, -1]]\n"})
    done = cli("validate", "wall_following", "--set", "world=bad.yaml")
    assert done.returncode == 2
    assert done.stderr.startswith("bad.yaml:2:11: world.circles[0]: expected a radius")


def test_the_hash_of_a_large_file_is_that_of_its_bytes(own: Path) -> None:
    hashes = json.loads((own / "manifest.json").read_text())["hashes"]
    for name, digest in hashes.items():
        assert hashlib.sha256((own / name).read_bytes()).hexdigest() == digest
