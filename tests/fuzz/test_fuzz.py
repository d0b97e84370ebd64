"""A modest number of random examples of each subject; ``python -m tests.fuzz`` tries any."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import strategies as st

import runtime
from runtime.document.node import dump_yaml, parse_yaml
from tests.fuzz import (
    clocks_and_clusters,
    command_lines,
    damaged_caches,
    damaged_folders,
    damaged_indexes,
    engines,
    graphs,
    hostile_files,
    odd_documents,
    own_blocks,
    page,
    subclasses,
)
from tests.fuzz.campaign import Record, bounded, campaign
from tests.fuzz.workspace import TINY, assert_answered

Run = Callable[[int, int], Record]
# A subject, and its numbers of examples in the quick tests and in the slow ones.
TRIED: list[tuple[Run, int, int]] = [
    (graphs.run, 60, 400),
    (command_lines.run_quick, 12, 60),
    (damaged_folders.run_quick, 8, 40),
    (damaged_indexes.run, 3, 12),
    (damaged_caches.run, 1, 2),
    (engines.run, 1, 2),
    (subclasses.run, 1, 2),
    (own_blocks.run, 10, 80),
    (hostile_files.run, 3, 24),
    (odd_documents.run, 3, 12),
    (clocks_and_clusters.run_quiet, 1, 4),
]


def tried() -> Iterator[Any]:
    for run, few, many in TRIED:
        name = run.__module__.rpartition(".")[2]
        yield pytest.param(run, few, id=name)
        yield pytest.param(run, many, id=f"{name}-many", marks=pytest.mark.slow)


@pytest.mark.parametrize(("run", "examples"), list(tried()))
@pytest.mark.slow
def test_random_examples_hold(run: Run, examples: int) -> None:
    record = run(examples, 2)
    assert record.failures == (), "\n".join(record.failures)
    assert record.examples == examples


MOST_DANGEROUS = [
    ("w.npz", "zero", ("run", "weights.yaml", "--no-plots")),
    ("a/probes.npz", "zero", ("report", "a")),
    ("own.py", "fifo", ("check", "own.py")),
    ("rows.npz", "sparse", ("validate", "npz.yaml")),
]


@pytest.mark.parametrize(("file", "kind", "command"), MOST_DANGEROUS)
def test_a_file_that_does_not_end_is_refused(
    tmp_path: Path, file: str, kind: str, command: tuple[str, ...]
) -> None:
    for name in ("weights", "npz"):
        text = dump_yaml(hostile_files.GRAPHS[name])
        (tmp_path / f"{name}.yaml").write_text(text, encoding="utf-8")
    if "/" in file:
        runtime.load(TINY).run().save(tmp_path / "a")
    hostile_files.inflict(tmp_path / file, kind)
    answer, memory = hostile_files.measured(command, tmp_path)
    assert_answered(answer, command)
    assert answer.code == 2
    assert memory < hostile_files.MOST


def test_the_graph_that_is_mutated_is_sound() -> None:
    assert runtime.load(graphs.SOUND).run().failures == []


def planted(number: int) -> str:
    """Fails in two ways."""
    if number >= 1000:
        raise ValueError("large")
    if number >= 100:
        raise KeyError(number)
    return "odd" if number % 2 else "even"


def test_a_campaign_finds_all_faults_with_small_examples_and_goes_on() -> None:
    record = campaign("planted", st.integers(0, 10_000), planted, 300, 1)
    assert record.examples == 300
    assert sum(record.outcomes.values()) == 300
    assert record.outcomes["failed"] == len(record.failures) == 2
    assert sorted(text.partition("\n")[0] for text in record.failures) == ["100", "1000"]


def test_a_campaign_is_repeated_by_its_seed() -> None:
    seen: list[list[int]] = [[], []]
    for tried in seen:
        campaign("kept", st.integers(0, 10**9), lambda n, to=tried: to.append(n) or "", 50, 4)
    assert seen[0] == seen[1]


def test_work_without_end_is_a_failure() -> None:
    def forever() -> None:
        while True:
            try:
                sum(range(1000))
            except Exception:  # noqa: BLE001
                return

    with pytest.raises(BaseException, match="not finished"), bounded(0.05):
        forever()


def test_engines_that_differ_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    # The seeds differ as faulty engines would: noise must not pass as equal.
    noisy = {
        **damaged_caches.GRAPH,
        "blocks": {
            "go": {"type": "Constant", "value": [1.0, 0.5], "signal": "Twist"},
            "slip": {"type": "WheelSlip"},
        },
        "wires": {"slip": {"command": "go.value"}},
        "probes": {"out": "slip.actual"},
    }
    run = runtime.Graph.run
    other = {"python": 0, "compiled": 1}
    monkeypatch.setattr(
        runtime.Graph,
        "run",
        lambda self, seed, engine: run(self, seed=seed + other[engine], engine="python"),
    )
    with pytest.raises(AssertionError, match="out"):
        engines.compare(runtime.load(noisy).check(), 0)


def test_the_page_is_what_was_recorded() -> None:
    assert page.PAGE.read_text(encoding="utf-8") == page.page(), "run: python -m tests.fuzz --page"


def test_a_place_of_broken_yaml_lies_inside_the_text() -> None:
    for text, line, column in (("a: {", 1, 5), ("a: 1\nb: [", 2, 5)):
        with pytest.raises(runtime.GraphError) as caught:
            parse_yaml(text, "f")
        where = caught.value.problems[0].where
        assert (where.line, where.column) == (line, column), caught.value
