"""The documents say what is true."""

from __future__ import annotations

import doctest
import importlib
import json
import math
import os
import re
import shlex
import subprocess
import sys
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import blocks
import runtime
from blocks.library.registry import blocks_of_module
from docs.describe import blocks_pages, gallery_page, observing_page, with_run_keys
from docs.expressions_page import expressions_page
from runtime.cli.shipped import RUNNABLE, shipped
from runtime.document import parse_yaml
from tests.browser import find
from tests.conftest import Run
from tests.rooms import BUDGETS, room_sizes

ROOT = Path(__file__).parent.parent
PAGES = (*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"))
README = (ROOT / "README.md").read_text(encoding="utf-8")
GRAPH = re.search(r"```yaml\n(graph: adaptive_line.*?)```", README, re.S)
ERRORS = re.search(r"```text\n(my\.yaml.*?)```", README, re.S)


def test_the_blocks_page_is_current() -> None:
    for name, text in blocks_pages().items():
        page = (ROOT / "docs" / name).read_text(encoding="utf-8")
        assert page == text, "run: python -m docs.describe"
    page = (ROOT / "docs" / "observing.md").read_text(encoding="utf-8")
    assert page == observing_page(), "run: python -m docs.describe"
    page = (ROOT / "docs" / "expressions.md").read_text(encoding="utf-8")
    assert page == expressions_page(), "run: python -m docs.describe"
    page = (ROOT / "docs" / "graph-format.md").read_text(encoding="utf-8")
    assert page == with_run_keys(page), "run: python -m docs.describe"
    page = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert page == gallery_page(), "run: python -m docs.describe"


@pytest.fixture
def written(tmp_path: Path) -> Path:
    assert GRAPH is not None
    path = tmp_path / "my.yaml"
    path.write_text(GRAPH[1], encoding="utf-8")
    return path


def test_the_readme_graph_is_the_starter(written: Path) -> None:
    assert runtime.load(written) == runtime.load("starters/adaptive")


def test_the_readme_graph_runs_and_settles(written: Path) -> None:
    graph = runtime.load(written)
    result = graph.run()
    assert result.status == "complete"
    assert result.metrics["settled_at"] is not None
    assert graph.without("adaptive").run().metrics["settled_at"] is None


def ablated(written: Path, *arguments: str) -> dict[str, dict[str, Any]]:
    """The table of an ablation of the README's graph, by variant."""
    script = "from runtime.cli import main\nif __name__ == '__main__':\n    main()\n"
    (written.parent / "command.py").write_text(script, encoding="utf-8")
    found = subprocess.run(
        [sys.executable, "command.py", "ablate", written.name, *arguments, "--json"],
        cwd=written.parent,
        capture_output=True,
        text=True,
        check=True,
    )
    lines = json.loads(found.stdout)["table"]
    return {line["variant"]: line for line in lines if line["metric"] == "settled_at"}


@pytest.mark.slow
def test_the_readme_graph_earns_its_network(written: Path) -> None:
    """With its network the robot settles with every seed, and without it with none."""
    settled = ablated(written, "--seeds", "0..19")
    assert settled["baseline"]["n"] == settled["baseline"]["runs"] == 20
    assert settled["without adaptive"]["runs"] == 20
    assert settled["without adaptive"]["n"] == 0


def test_the_readme_ablations_run(written: Path) -> None:
    graph = runtime.load(written).set("run.until", 0.05)
    for variant in (
        graph.without("adaptive"),
        graph.bypass("limit", "fault"),
        graph.wire("snn.error", "error.heading"),
        graph.set("lqr.q", [1, 1, 1]),
    ):
        assert variant.run(seed=3).status == "complete"


def test_the_readme_errors_are_real(written: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    text = written.read_text(encoding="utf-8")
    broken = text.replace("LQR, q:", "LQR, Q:").replace(
        "error:    {pose: plant.pose", "error:    {pose: plant.pos"
    )
    broken = broken.replace(
        "snn:      {input: error.heading, error: error.lateral}", "snn:      {input: error.heading}"
    )
    written.write_text(broken, encoding="utf-8")
    monkeypatch.chdir(written.parent)
    with pytest.raises(runtime.GraphError) as caught:
        runtime.load("my.yaml").check()
    assert ERRORS is not None
    assert str(caught.value) == ERRORS[1].strip()


WITH_EXAMPLES = [
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
    for room in ("blocks", "runtime")
    for path in sorted((ROOT / room).rglob("*.py"))
    if ">>> " in path.read_text(encoding="utf-8")
]


@pytest.mark.parametrize("module", WITH_EXAMPLES)
def test_examples_of_docstrings(module: str) -> None:
    found = doctest.testmod(importlib.import_module(module))
    assert found.attempted > 0
    assert found.failed == 0


def test_the_readme_is_short_and_its_first_command_shows_both_runs() -> None:
    assert README.count("\n") < 150
    one_line = re.findall(r"^ +((?:python3|py) -m venv .*)$", README, re.M)
    first, windows, tests = one_line
    run = "pip install -e . && runtime run starters/adaptive --vs without=adaptive"
    assert first == f"python3 -m venv .venv && . .venv/bin/activate && {run}"
    assert windows == rf"py -m venv .venv && .venv\Scripts\activate && {run}"
    assert tests.endswith("pytest -n auto")


HOW_TO = (ROOT / "docs" / "how-to.md").read_text(encoding="utf-8")
BLOCKS = dict(re.findall(r"```python\n# (\w+)\.py\n(.*?)```", HOW_TO, re.S))


def own(name: str, folder: Path) -> dict[str, type[blocks.Block]]:
    """The blocks of one file of the how-to."""
    (folder / f"{name}.py").write_text(BLOCKS[name], encoding="utf-8")
    return blocks_of_module(folder / f"{name}.py")


@pytest.mark.parametrize("name", BLOCKS)
def test_blocks_of_the_how_to_keep_the_rules(name: str, tmp_path: Path) -> None:
    for cls in own(name, tmp_path).values():
        runtime.check_block(cls())


def test_the_cart_of_the_how_to_drives_a_circle(tmp_path: Path) -> None:
    """By Euler's method with steps h the radius is v / omega up to a share of h omega / 2."""
    cart = own("cart", tmp_path)["Cart"]
    graph = runtime.Graph(dt=0.001, until=2.0 * math.pi).add("cart", cart())
    graph = graph.add("go", blocks.Constant(value=[1.0, 1.0], signal="Twist"))
    pose = graph.connect("go.value", "cart.command").probe("cart.pose").run()["cart.pose"]
    away = np.hypot(pose[:, 0], pose[:, 1] - 1.0)
    assert np.abs(away - 1.0).max() < 0.005
    assert pose[-1, 2] == pytest.approx(2.0 * math.pi, abs=0.002)


def test_the_metric_of_the_how_to_is_computed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (code,) = re.findall(r"```python\n(import spikeblocks.*?)```", HOW_TO, re.S)
    monkeypatch.chdir(tmp_path)
    text = (ROOT / "graphs" / "starters" / "tracking.yaml").read_text(encoding="utf-8")
    (tmp_path / "tracking.yaml").write_text(text, encoding="utf-8")
    space: dict[str, dict[str, float]] = {}
    exec(code, space)
    assert space["rms"].keys() == {"lqr", "pid"}
    assert all(0.0 < value < 1.0 for value in space["rms"].values())


def test_the_plot_of_the_how_to_is_valid() -> None:
    (text,) = re.findall(r"```yaml\n(plots:.*?)```", HOW_TO, re.S)
    graph = runtime.load("starters/adaptive").overlay(parse_yaml(text, "how-to").plain())
    assert graph.check().observation.plots[1].options["labels"] == ["e_p", "e_θ"]


def test_the_ports_of_the_how_to_are_those_of_its_linearization() -> None:
    """At the end of a step response, x'' = (1 - c x' - k x) / m in closed form."""
    (text,) = re.findall(r"```yaml\n# pushed.yaml\n(.*?)```", HOW_TO, re.S)
    graph = runtime.Graph().overlay(parse_yaml(text, "how-to").plain())
    m, c, k, t = 2.0, 0.5, 3.0, 1.99
    rate, decay = math.sqrt(k / m - (c / (2.0 * m)) ** 2), c / (2.0 * m)
    swing = math.cos(rate * t) + decay / rate * math.sin(rate * t)
    expected = (1.0 - math.exp(-decay * t) * swing) / k
    assert graph.run()["place"][-1] == pytest.approx(expected, abs=1e-6)
    linear = graph.linearize(inputs=["push"], outputs=["place"])
    assert linear.b.ravel().tolist() == pytest.approx([0.0, 1.0 / m])


@pytest.mark.slow
def test_what_the_how_to_learns_works_without_learning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Shortened to a quarter; an error of 0.65 is that of an output of 0."""
    (text,) = re.findall(r"```yaml\n(# learn.*?)```", HOW_TO, re.S)
    (code,) = re.findall(r"```python\n# deploy\n(.*?)```", HOW_TO, re.S)
    monkeypatch.chdir(tmp_path)
    short = text.replace("until: 40.0", "until: 10.0").replace("after: 10.0", "after: 5.0")
    Path("learn.yaml").write_text(short, encoding="utf-8")
    space: dict[str, Any] = {}
    exec(code, space)
    assert space["deployed"].metrics["mean_error"] < 0.1
    stored = runtime.load("deployed.yaml")
    assert "learning" not in stored.to_dict()["blocks"]["decoder"]
    assert stored.run().metrics == space["deployed"].metrics


def consoles(page: str, *kinds: str) -> list[str]:
    """What a page shows of consoles, of the terminal and of Python, in order."""
    text = (ROOT / "docs" / page).read_text(encoding="utf-8")
    return re.findall(rf"```(?:{'|'.join(kinds)})\n(.*?)```", text, re.S)


def commands(console: str) -> list[tuple[str, int, list[str]]]:
    """The commands in a console, with exit codes and the lines that they should print."""
    found: list[tuple[str, int, list[str]]] = []
    for line in console.splitlines():
        if line.startswith("$ "):
            command, _, code = line[2:].partition("    # exit code ")
            found.append((command, int(code or 0), []))
        else:
            found[-1][2].append(line)
    return found


SHORT = {"run": "--until=1.5", "ablate": "--until=1.5", "sweep": "--until=1.5"}


@pytest.mark.slow
def test_every_command_of_the_how_to_runs(cli: Run) -> None:
    """Shortened; those of the tutorial, with what they print, are run by the slow test below."""
    for command, code, _ in chain(*map(commands, consoles("how-to.md", "console"))):
        verb, *rest = shlex.split(command.removeprefix("runtime "))
        done = cli(verb, *rest, *([SHORT[verb]] if verb in SHORT else []))
        assert done.returncode == code, f"{command}: {done.stderr}"


@pytest.mark.slow
def test_the_tutorial_shows_what_is_printed(
    cli: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {}
    for session in consoles("tutorial.md", "console", "pycon"):
        if session.startswith(">>>"):
            python(session, space)
            continue
        for command, code, lines in commands(session):
            done = cli(*shlex.split(command.removeprefix("runtime ")))
            assert done.returncode == code, done.stderr
            printed = (done.stdout + done.stderr).splitlines()
            for line in lines:
                start = line.removesuffix("...").rstrip()
                assert any(each.startswith(start) for each in printed), f"{command}: {line}"
            if code:  # of a mistake, all messages are shown, so that the page does not flatter
                assert lines == printed, command


def python(session: str, space: dict[str, Any]) -> None:
    """Run a session of Python's console, and compare what it prints."""
    test = doctest.DocTestParser().get_doctest(session, space, "tutorial", None, 0)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS)
    assert runner.run(test, out=said.append, clear_globs=False).failed == 0, "".join(said)
    space.update(test.globs)


@pytest.mark.parametrize(
    "name",
    [
        *("run_from_python.py", "stateful_block.py"),
        pytest.param("ablation.py", marks=pytest.mark.slow),
        pytest.param("train_policy.py", marks=pytest.mark.slow),
    ],
)
def test_the_examples_run(name: str) -> None:
    if name == "train_policy.py":
        pytest.importorskip("gymnasium")
    arguments = [sys.executable, str(ROOT / "examples" / name)]
    arguments += ["1"] if name in ("ablation.py", "train_policy.py") else []
    done = subprocess.run(arguments, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout


def test_the_example_with_physics_runs(tmp_path: Path) -> None:
    script = str(ROOT / "examples" / "physics.py")
    done = subprocess.run(
        [sys.executable, script, "2"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    folder = done.stdout.split()[-1]
    assert (tmp_path / folder / "manifest.json").is_file()


def test_the_example_block_runs_from_its_graph() -> None:
    result = runtime.load(ROOT / "examples" / "slippery_patch.yaml").run(until=2.0)
    turned = result["limit.limited"][:, 1]
    assert result.status == "complete"
    assert turned.any()


def test_links_lead_somewhere() -> None:
    for page in PAGES:
        for target in re.findall(r"\]\(([^)#:]+)\)", page.read_text(encoding="utf-8")):
            made = target.startswith("generated/")  # when the site is built, which checks it
            assert made or (page.parent / target).exists(), f"{page.name}: {target}"


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_are_named_exist(page: Path) -> None:
    named = r"`((?:blocks|runtime|tests|graphs|examples|benchmarks|docs)/[\w./-]*)`"
    found = re.findall(named, page.read_text(encoding="utf-8"))
    assert [name for name in found if not (ROOT / name).exists()] == []


def test_the_architecture_lists_every_room_with_its_budget() -> None:
    """The numbers of lines may be a little older than the code."""
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    number = r"([\d,]+)"
    found = re.findall(rf"^\| `([^`]+)` \| .* \| {number} \| {number} \|$", page, re.M)
    rows = {room: [int(text.replace(",", "")) for text in texts] for room, *texts in found}
    assert rows.keys() == BUDGETS.keys() == room_sizes().keys(), "run: python -m tests.rooms"
    assert {room: budget for room, (_, budget) in rows.items()} == BUDGETS
    stale = {room for room, (n, _) in rows.items() if abs(n - room_sizes()[room]) > 20 + 0.1 * n}
    assert stale == set(), "run: python -m tests.rooms"


def test_names_in_the_architecture_are_those_of_the_code() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
    page = re.sub(r"```.*?```", "", page, flags=re.S)
    folders = ("blocks", "runtime", "spikeblocks", "tests", "benchmarks")
    paths = [path for folder in folders for path in (ROOT / folder).rglob("*.*")]
    # By their whole suffix: Python writes a.pyc.1234 before it is a.pyc.
    sources = [path for path in paths if path.suffix in (".py", ".c", ".h")]
    texts = {f"/{p.relative_to(ROOT)}": p.read_text("utf-8") for p in sources}
    words = set(chain.from_iterable(re.findall(r"\w+", f"{p} {t}") for p, t in texts.items()))
    named = set(re.findall(r"`(\w+(?:\.\w+)*)`", page))
    assert [name for name in sorted(named) if not words.issuperset(name.split("."))] == []
    places = re.findall(r"`([\w.]+)` (?:in|\()\s?`([\w/]+\.py)`", page)
    assert len(places) > 15
    for name, file in places:
        inside = [text for path, text in texts.items() if path.endswith(f"/{file}")]
        assert any(name.rpartition(".")[2] in text for text in inside), f"{name} in {file}"


def test_the_python_of_the_experiments_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (ROOT / "docs" / "experiments.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"```python\n(import runtime\n.*?)```", page, re.S)
    monkeypatch.chdir(tmp_path)
    space: dict[str, Any] = {}
    exec(code, space)
    assert space["found"].runs == 3
    assert (tmp_path / "ablation.pdf").is_file()


@pytest.mark.slow
def test_the_site_builds_without_warnings(tmp_path: Path) -> None:
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-b", "html", "docs", str(tmp_path)]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={**os.environ, "SPIKEBLOCKS_DOCS_RUNS": "0"},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    for page in ("tutorial", "python-api", "generated/command-line"):
        assert (tmp_path / f"{page}.html").stat().st_size > 2000
    landing, gallery = check_page(tmp_path / "index.html"), tmp_path / "generated" / "gallery.html"
    heads = {
        e.attributes.get("property"): e.attributes["content"]
        for e in find(landing, "meta")
        if "content" in e.attributes
    }
    assert heads["og:image"].endswith("/_images/errors.png")
    assert (tmp_path / "_images" / "errors.png").is_file()
    assert heads["og:description"]
    assert len(find(landing, "a", class_="card")) == 6
    assert "{{" not in landing
    count = sum(len(shipped(group)) for group in RUNNABLE)
    assert len(find(check_page(gallery), "a", class_="card")) == count
    assert gallery.stat().st_size < 1e6
    weight = sum(path.stat().st_size for path in (tmp_path / "_static").glob("graph-*.webp"))
    assert weight < 1e6
    page = check_page(tmp_path / "generated" / "graph-gallery-pid_loop.html")
    assert find(page, "a", href="../blocks/dynamics.html#pid")
    assert 'id="pid"' in (tmp_path / "blocks" / "dynamics.html").read_text(encoding="utf-8")


def check_page(path: Path) -> str:
    """The text of a page: its pictures and links within the site exist, and say what they show."""
    html = path.read_text(encoding="utf-8")
    for image in find(html, "img"):
        source = image.attributes["src"].partition("?")[0]
        assert (path.parent / source).is_file(), source
        assert "alt" in image.attributes
    for link in find(html, "a"):
        target = link.attributes.get("href", "").partition("#")[0].partition("?")[0]
        assert not target or ":" in target or (path.parent / target).exists(), target
    return html


def test_the_index_lists_every_page() -> None:
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^([\w-]+)$", index, re.M))
    pages = {page.stem for page in (ROOT / "docs").glob("*.md")}
    assert pages - {"index"} - listed == set()
