"""Texts that ask for exponential work, counted and never timed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from blocks.core.hints import CANDIDATES, hint
from blocks.limits import GRAPH_FILE
from runtime.document import limits
from runtime.document import node as document
from runtime.document.limits import MAX_BLOCKS, MAX_LEVELS, MAX_WORK, Measure, Work
from runtime.document.node import MAX_NODES, Node, parse_yaml
from runtime.document.parse_errors import MAX_DEPTH
from runtime.errors import MAX_PROBLEMS, NOWHERE, GraphError, Problems, Where

LEAF = (
    "run: {dt: 0.1, until: 0.2}\nblocks: {c: {type: Constant, value: 1.0}}\nprobes: {c: c.value}\n"
)
PART = "outputs: {o: c.value}\nblocks: {c: {type: Constant, value: 1.0}}\n"


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
    message = refused(tmp_path / "x399.yaml")
    at = tmp_path / f"x{400 - MAX_LEVELS}.yaml"
    assert message.startswith(f"{at}:1:10: extends: graphs extend or contain each other more than ")


def test_parts_that_double_are_counted_before_they_are_unfolded(tmp_path: Path) -> None:
    write(tmp_path, {"p0.yaml": PART})
    for i in range(1, 23):
        inner = f"{{graph: p{i - 1}.yaml}}"
        text = f"outputs: {{o: a.o}}\nblocks: {{a: {inner}, b: {inner}}}\n"
        write(tmp_path, {f"p{i}.yaml": text})
    message = refused(tmp_path / "p22.yaml")
    assert f"expands to more than {MAX_NODES} values" in message
    assert message.startswith(f"{tmp_path}/p") and ":2:" in message


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
    message = refused(tmp_path / "top.yaml")
    assert message.startswith(f"{tmp_path}/r")
    assert "expands to more than 20000 values" in message


@pytest.mark.parametrize(
    ("levels", "inner", "reason"),
    [
        (20, "[$p, $p]", f"$p is nested more than {limits.MAX_VALUE_DEPTH} deep"),
        (4, str(["$p"] * 60).replace("'", ""), f"takes more than {MAX_WORK} steps"),
    ],
)
def test_params_of_parts_that_grow_are_refused_before_they_are_large(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, levels: int, inner: str, reason: str
) -> None:
    read = []
    plain = Node.plain

    def counted(self: Node) -> Any:
        read.append(1)
        return plain(self)

    monkeypatch.setattr(Node, "plain", counted)
    part = "params: {p: 1}\noutputs: {o: c.value}\nblocks: {c: {type: Constant, value: $p}}\n"
    write(tmp_path, {"g0.yaml": part})
    for i in range(1, levels):
        text = f"params: {{p: 1}}\noutputs: {{o: a.o}}\nblocks: {{a: {{graph: g{i - 1}.yaml, "
        write(tmp_path, {f"g{i}.yaml": f"{text}params: {{p: {inner}}}}}}}\n"})
    top = f"params: {{z: [1]}}\nblocks: {{a: {{graph: g{levels - 1}.yaml, params: {{p: $z}}}}}}\n"
    write(tmp_path, {"top.yaml": top})
    message = refused(tmp_path / "top.yaml")
    assert message.startswith(f"{tmp_path}/g")
    assert reason in message
    assert len(read) < 1000


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
        file.truncate(100 * GRAPH_FILE)  # a sparse file
    assert "is larger than 16 MiB" in refused(large)
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
