"""Files that somebody else wrote: bounded work, nothing imported, nothing overwritten."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import runtime
from blocks.params import CANDIDATES, hint
from runtime import document, limits
from runtime.cli import run as run_verb
from runtime.diagrams.paint import draw
from runtime.diagrams.stored import MAX_BOXES, read_picture, stored_picture
from runtime.diagrams.svg import to_svg
from runtime.document import MAX_DEPTH, MAX_NODES, Node, parse_yaml
from runtime.errors import MAX_PROBLEMS, NOWHERE, GraphError, Problems, UsageError, Where
from runtime.limits import MAX_BLOCKS, MAX_LEVELS, MAX_WORK, Measure, Work
from runtime.loader import MAX_BYTES
from runtime.record import DIAGRAM
from runtime.reopen import open_run
from runtime.reports.report import report
from runtime.terminal import printable
from tests.conftest import Run

LEAF = (
    "run: {dt: 0.1, until: 0.2}\nblocks: {c: {type: Constant, value: 1.0}}\nprobes: {c: c.value}\n"
)
PART = "outputs: {o: c.value}\nblocks: {c: {type: Constant, value: 1.0}}\n"
# Escape, bell, delete, C1 control sequence introducer, right-to-left override, line separators.
NASTY = "\x1b[2J\x07\x7f\x9b1m\u202e\u2028\x85\u2066"


def write(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")


def refused(source: Any) -> str:
    with pytest.raises(GraphError) as raised:
        runtime.load(source).check()
    return str(raised.value)


@pytest.fixture
def charged(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """What is counted while graphs are read."""
    counts: list[int] = []
    charge = Work.charge

    def counted(self: Work, count: int, *rest: Any) -> None:
        counts.append(count)
        charge(self, count, *rest)

    monkeypatch.setattr(Work, "charge", counted)
    return counts


def test_extending_a_file_twice_over_and_over_reads_each_once(
    tmp_path: Path, charged: list[int]
) -> None:
    write(tmp_path, {"e0.yaml": LEAF})
    levels = 40
    for i in range(1, levels):
        write(tmp_path, {f"e{i}.yaml": f"extends: [e{i - 1}.yaml, e{i - 1}.yaml]\n"})
    graph = runtime.load(tmp_path / f"e{levels - 1}.yaml").check()
    assert graph.names == ["c"]
    # Each level merges a handful of entries; unshared, it would be 2 ** 39 times as many.
    assert sum(charged) < 50 * levels


def test_graphs_extend_each_other_up_to_a_level(tmp_path: Path) -> None:
    write(tmp_path, {"x0.yaml": LEAF})
    for i in range(1, 400):
        write(tmp_path, {f"x{i}.yaml": f"extends: x{i - 1}.yaml\n"})
    runtime.load(tmp_path / f"x{MAX_LEVELS - 1}.yaml").check()
    said = refused(tmp_path / "x399.yaml")
    at = tmp_path / f"x{400 - MAX_LEVELS}.yaml"
    assert said.startswith(f"{at}:1:10: extends: graphs extend or contain each other more than ")


def test_parts_that_double_are_counted_before_they_are_unfolded(tmp_path: Path) -> None:
    write(tmp_path, {"p0.yaml": PART})
    for i in range(1, 23):
        inner = f"{{graph: p{i - 1}.yaml}}"
        text = f"outputs: {{o: a.o}}\nblocks: {{a: {inner}, b: {inner}}}\n"
        write(tmp_path, {f"p{i}.yaml": text})
    said = refused(tmp_path / "p22.yaml")
    assert f"unfolds to more than {MAX_NODES} values" in said
    assert said.startswith(f"{tmp_path}/p") and ":2:" in said


def test_what_runs_nested_reads_back(tmp_path: Path) -> None:
    write(tmp_path, {"q0.yaml": PART})
    for i in range(1, 27):
        text = f"outputs: {{o: a.o}}\nblocks: {{a: {{graph: q{i - 1}.yaml}}}}\n"
        write(tmp_path, {f"q{i}.yaml": text})
    accepted = 0
    for i in range(27):
        try:
            top = {"blocks": {"t": {"graph": str(tmp_path / f"q{i}.yaml")}}}
            graph = runtime.load(top).check()
        except GraphError as error:
            assert f"nested more than {MAX_DEPTH} deep" in str(error)
            continue
        accepted += 1
        assert runtime.load(parse_yaml(graph.to_yaml(), "again").plain()) == graph
    assert 20 <= accepted < 27


def test_params_that_double_are_counted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(limits, "MAX_NODES", 20_000)
    part = "params: {p: 1}\noutputs: {o: c.value}\nblocks: {c: {type: Constant, value: $p}}\n"
    write(tmp_path, {"r0.yaml": part})
    for i in range(1, 24):
        text = f"params: {{p: 1}}\noutputs: {{o: a.o}}\nblocks: {{a: {{graph: r{i - 1}.yaml, "
        write(tmp_path, {f"r{i}.yaml": text + "params: {p: [$p, $p]}}}\n"})
    top = f"params: {{z: {[1] * 2000}}}\nblocks: {{a: {{graph: r22.yaml, params: {{p: $z}}}}}}\n"
    write(tmp_path, {"top.yaml": top})
    said = refused(tmp_path / "top.yaml")
    assert said.startswith(f"{tmp_path}/r")
    assert "unfolds to more than 20000 values" in said


def test_sizes_and_depths_are_those_of_the_tree_written_out() -> None:
    node = Node([Node(1), Node({"a": Node(2)})])
    for _ in range(3):
        node = Node([node, node])

    def count(node: Node) -> tuple[int, int]:
        inside = node.value if node.is_list else [n for _, n in node.items()]
        found = [count(item) for item in inside]
        return 1 + sum(n for n, _ in found), max((d + 1 for _, d in found), default=0)

    assert Measure().of(node) == count(node)


def test_blocks_problems_and_python_values_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    work = Work(Problems())
    with pytest.raises(GraphError, match=f"b: more than {MAX_BLOCKS} blocks"):
        for _ in range(MAX_BLOCKS + 1):
            work.block(NOWHERE, "b")
    problems = Problems()
    with pytest.raises(GraphError, match=f"^more than {MAX_PROBLEMS} problems") as raised:
        for i in range(MAX_PROBLEMS + 1):
            problems.add(NOWHERE, f"a{i}", "wrong")
    assert len(raised.value.problems) == MAX_PROBLEMS + 2
    with pytest.raises(GraphError, match=f"f:1:2: reading .* more than {MAX_WORK} steps"):
        Work(Problems()).charge(MAX_WORK + 1, Where("f", 1, 2))
    monkeypatch.setattr(document, "MAX_NODES", 10_000)
    value: Any = [1] * 10
    for _ in range(9):
        value = [value] * 10
    assert "more than 10000 values" in refused({"params": {"a": value}})
    with pytest.raises(GraphError, match="^f:1:[0-9]+: .*more than 10000 values in one file"):
        parse_yaml("[" + "1," * 20_000 + "1]", "f")


def test_a_file_that_is_too_large_is_not_read(tmp_path: Path) -> None:
    large = tmp_path / "large.yaml"
    with large.open("wb") as file:
        file.truncate(100 * MAX_BYTES)  # a sparse file
    assert "is larger than 32 MiB" in refused(large)
    write(tmp_path, {"top.yaml": "extends: large.yaml\n"})
    assert refused(tmp_path / "top.yaml").startswith(f"{tmp_path}/top.yaml:1:10: extends: ")


def test_many_misspelt_names_get_their_suggestions(monkeypatch: pytest.MonkeyPatch) -> None:
    import difflib

    looked = []
    ratio = difflib.SequenceMatcher.ratio

    def counted(self: Any) -> float:
        looked.append(1)
        return ratio(self)

    monkeypatch.setattr(difflib.SequenceMatcher, "ratio", counted)
    known = [f"block_{i:04d}" for i in range(1000)]
    for i in (0, 17, 500, 999):
        assert hint(f"blok_{i:04d}", known) == f", did you mean 'block_{i:04d}'?"
    assert len(looked) <= 4 * 2 * CANDIDATES
    assert hint("x" * 1_000_000, known) == ""
    assert hint("entirely different", known) == ""


@given(st.text("abcd_0123", max_size=12), st.lists(st.text("abcd_0123", min_size=1, max_size=12)))
def test_suggestions_are_difflibs_where_names_are_few(name: str, known: list[str]) -> None:
    import difflib

    few = list(dict.fromkeys(known))[:CANDIDATES]
    close = difflib.get_close_matches(name, few, n=1, cutoff=0.6)
    assert hint(name, few) == (f", did you mean '{close[0]}'?" if close else "")


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
    """A run of a block of one's own, whose module tells by a file that it was imported."""
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
    said = done.stderr
    assert "own.yaml:4:13: blocks.x.type: 'own.py' was not imported" in said
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
    network = runtime.load("line_actuator_failure").network
    text = stored_picture(network)
    assert text is not None
    again = to_svg(draw(read_picture(text)))
    assert again == runtime.load("line_actuator_failure").diagram()
    (own / DIAGRAM).unlink()
    assert "This folder holds no diagram" in report(own).html


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


@settings(max_examples=60, deadline=None, suppress_health_check=[*HealthCheck])
@given(data=st.data())
def test_a_diagram_with_something_else_in_it_is_drawn_or_refused(
    stored: Any, data: st.DataObject
) -> None:
    changed = json.loads(json.dumps(stored))
    wrong = (None, True, -1, 1e300, "x", "</svg><script>", [], ["x"], {}, [["x", "y"]], ...)
    for _ in range(data.draw(st.integers(1, 3))):
        owner, key = data.draw(st.sampled_from(_places(changed)))
        value = data.draw(st.sampled_from(wrong))
        if value is ...:
            del owner[key]
        else:
            owner[key] = value
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
    data[at + 24 : at + 28] = (2**31).to_bytes(4, "little")  # the size said, uncompressed
    (own / "probes.npz").write_bytes(bytes(data))
    with pytest.raises(UsageError, match="said to be larger than the file"):
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
    for name in ("report", "render"):
        done = verb(name, "foreign/latest")
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
