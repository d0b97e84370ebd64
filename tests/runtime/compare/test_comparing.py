"""Comparison of runs: documents by key, probes exactly and by tolerance, overlays."""

from __future__ import annotations

import copy
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.compare import compare, open_runs
from runtime.compare.documents import ABSENT, differences, same, text_of
from runtime.compare.overlay import overlays
from runtime.compare.probes import pair
from runtime.document.node import parse_yaml
from runtime.errors import UsageError
from runtime.observation.run_data import Recording

KEYS = st.sampled_from(["a", "b", "c", "long_name"])
SCALARS = st.one_of(
    *(st.none(), st.booleans(), st.integers(-9, 9), st.floats(), st.text("ab0: #'", max_size=5)),
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(
        st.dictionaries(KEYS, inner, max_size=4), st.lists(inner, min_size=1, max_size=30)
    ),
    max_leaves=12,
)
DOCUMENTS = st.dictionaries(KEYS, VALUES, max_size=4)


def _set(document: Any, path: str, value: Any) -> None:
    """Apply a difference to a document."""
    keys = [
        int(k) if k.isdigit() else k for k in path.replace("[", ".").replace("]", "").split(".")
    ]
    for key in keys[:-1]:
        document = document.setdefault(key, {}) if isinstance(document, dict) else document[key]
    if value is ABSENT:
        del document[keys[-1]]
    else:
        document[keys[-1]] = value


def _without_empty_sections(document: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in document.items() if value != {}}


@given(DOCUMENTS, DOCUMENTS)
def test_differences_turn_one_document_into_the_other(a: Any, b: Any) -> None:
    turned = copy.deepcopy(a)
    for item in differences([a, b]):
        assert not same(*item.values)
        _set(turned, item.path, copy.deepcopy(item.values[1]))
    # An empty section is the same as none.
    assert same(_without_empty_sections(turned), _without_empty_sections(b))


@given(VALUES)
def test_the_text_of_a_value_is_its_yaml(value: Any) -> None:
    assert same(parse_yaml(text_of({"x": value})[1:-1], "x").plain()["x"], value)


def test_what_differs_in_a_graph() -> None:
    base = {"blocks": {"x": {"q": [1, 2]}, "y": {"a": 1}}, "without": ["z"], "run": {"dt": 1}}
    other = {"blocks": {"x": {"q": [1, 3]}}, "probes": {"p": "x.out"}, "run": {"dt": 1.0}}
    found = [(d.change, d.path, *map(text_of, d.values)) for d in differences([base, other])]
    assert found == [
        ("changed", "blocks.x.q", "[1, 2]", "[1, 3]"),
        ("removed", "blocks.y", "{a: 1}", ""),
        ("removed", "without", "[z]", ""),
        ("added", "probes.p", "", "x.out"),
    ]


def test_long_lists_are_compared_item_by_item() -> None:
    here = {"a": {"q": [[i, 0.5] for i in range(40)]}}
    there = copy.deepcopy(here)
    there["a"]["q"][17][1] = 0.25
    (found,) = differences([here, there])
    assert (found.path, found.values) == ("a.q[17]", ([17, 0.5], [17, 0.25]))


def _recorded(values: Any, every: float = 0.01, **more: Any) -> Recording:
    values = np.array(values, dtype=float)
    columns = values.shape[1] if values.ndim > 1 else 1
    facts = {
        "labels": tuple(f"p.{i}" for i in range(columns)),
        "units": ("m",) * columns,
        "kinds": ("State",),
        **more,
    }
    return Recording("p", np.arange(len(values)) * every, values, **facts)


def test_the_first_difference_is_found_to_the_bit() -> None:
    values = np.random.default_rng(0).normal(size=(50, 3))
    other = values.copy()
    other[30:, 1] = np.nextafter(other[30:, 1], np.inf)
    other[44, 0] = 7.0
    found = pair(_recorded(values), _recorded(other), dt=0.001)
    first = found.first_difference
    assert first is not None
    assert (first.tick, first.column) == (300, "p.1")
    assert first.t == pytest.approx(0.3)
    assert first.values == (values[30, 1], other[30, 1])
    assert found.differing == 20
    assert found.is_whole


def test_bits_count_where_equality_does_not() -> None:
    assert pair(_recorded([0.0]), _recorded([-0.0]), 0.01).first_difference is not None
    assert pair(_recorded([math.nan]), _recorded([math.nan]), 0.01).first_difference is None


@given(
    st.lists(st.tuples(*[st.floats(-1e6, 1e6)] * 2, st.floats(0.0, 1.0)), min_size=1, max_size=40),
    st.floats(0.0, 1.0),
    st.floats(0.0, 10.0),
)
def test_columns_agree_with_numpy(rows: Any, rtol: float, atol: float) -> None:
    a = np.array([row[0] for row in rows])
    b = np.where([row[2] < 0.5 for row in rows], a, [row[1] for row in rows])
    (column,) = pair(_recorded(a), _recorded(b), 0.01).columns(rtol, atol)
    apart = np.abs(a - b)
    assert column.largest == apart.max()
    assert column.at == pytest.approx(0.01 * apart.argmax())
    # In this formula, the squares of the smallest differences underflow.
    assert column.rms == pytest.approx(np.sqrt(np.mean(apart**2)), rel=1e-9, abs=1e-150)
    close = np.isclose(b, a, rtol=rtol, atol=atol)
    assert column.beyond == np.count_nonzero(~close)
    assert (column.since is None) == bool(close.all())


def test_nan_is_beyond_every_tolerance() -> None:
    inf, nan = math.inf, math.nan
    a, b = [1.0, inf, nan, inf, nan, -inf], [1.0, inf, nan, 1.0, 2.0, inf]
    (column,) = pair(_recorded(a), _recorded(b), 0.01).columns(1.0, 1e9)
    assert column.beyond == 3
    assert column.largest == inf


def test_rows_are_matched_by_their_times() -> None:
    every = pair(_recorded(np.arange(10.0)), _recorded(np.arange(0.0, 10.0, 2.0), 0.02), 0.01)
    assert every.t == pytest.approx([0.0, 0.02, 0.04, 0.06, 0.08])
    assert every.first_difference is None
    assert not every.is_whole
    longer = pair(_recorded(np.arange(7.0)), _recorded(np.arange(4.0)), 0.01)
    assert (len(longer.t), longer.rows, longer.is_whole) == (4, (7, 4), False)


def test_recordings_that_cannot_be_compared_have_a_reason() -> None:
    wide = pair(_recorded(np.zeros((4, 3))), _recorded(np.zeros((4, 2))), 0.01)
    assert wide.fault == "3 columns in one, 2 in the other"
    assert wide.first_difference is None
    assert wide.columns(0.0, 0.0) == []
    units = pair(_recorded([0.0]), _recorded([1.0], units=("rad",)), 0.01)
    assert units.fault == "[m] in one, [rad] in the other"


GRAPH = """
graph: small
run: {dt: 0.01, until: 1.0, seed: 3}
blocks:
  go: {type: Constant, value: [1.0, 0.5], signal: Twist}
  plant: {type: DifferentialDrive}
  seen: {type: PoseNoise}
wires:
  plant: {command: go.value}
  seen: {pose: plant.pose}
probes: {seen: seen.measured, pose: {of: plant.pose, every: 5}}
plots: {way: {kind: trajectory, of: [pose]}}
metrics: {turned: {kind: final, of: plant.pose.theta}}
"""


@pytest.fixture(scope="module")
def folders(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    root = tmp_path_factory.mktemp("runs")
    (root / "small.yaml").write_text(GRAPH)
    graph = runtime.load(root / "small.yaml")
    graphs = {
        "base": graph,
        "fast": graph.set("go.value", [2.0, 0.5]),
        "other seed": graph.set("run.seed", 4),
        "without": graph.without("seen"),
    }
    return {name: graph.run().save(root / name) for name, graph in graphs.items()}


def test_runs_are_labelled_by_their_differences(folders: dict[str, Path]) -> None:
    def labels(*names: str) -> list[str]:
        return [run.label for run in open_runs([folders[name] for name in names])]

    assert labels("base", "fast") == ["as written", "go.value=[2.0, 0.5]"]
    assert labels("base", "other seed") == ["seed 3", "seed 4"]
    assert labels("fast", "without", "other seed") == [
        *("go.value=[2.0, 0.5], seed 3", "without seen, seed 3", "seed 4"),
    ]
    assert labels("base", "base") == ["base", "base (2)"]


def test_given_labels(folders: dict[str, Path]) -> None:
    both = [folders["base"], folders["fast"]]
    assert [run.label for run in open_runs(both, ["slow", "fast"])] == ["slow", "fast"]
    for labels in (["one"], ["same", "same"], ["", "b"]):
        with pytest.raises(UsageError, match="expected (a label|distinct and non-empty labels)"):
            open_runs(both, labels)
    with pytest.raises(UsageError, match="two or more runs, got 1"):
        open_runs(both[:1])


def test_a_comparison_has_all_differences(folders: dict[str, Path]) -> None:
    runs = open_runs([folders["base"], folders["fast"], folders["without"]])
    found = compare(runs)
    assert [(d.path, d.change) for d in found.graph] == [
        *(("blocks.go.value", "changed"), ("without", "added")),
    ]
    assert found.metrics["turned"] == [run.result.metrics["turned"] for run in runs]
    fast, without = found.others
    assert fast.missing == {}
    assert without.missing == {"seen": "without seen"}
    assert not fast.is_same
    # theta is the same at either speed; the position differs from the second tick on.
    assert [(p.name, at.tick, at.column) for p, at in fast.first_differences] == [
        *(("seen", 1, "seen.measured.x"), ("pose", 5, "plant.pose.x")),
    ]
    assert without.first_differences == []


def test_causes_come_first_where_ticks_are_equal(folders: dict[str, Path]) -> None:
    runs = open_runs([folders["base"], folders["fast"]])
    names = [p.name for p in compare(runs, causes_first=True).others[0].pairs]
    assert names.index("pose") < names.index("seen")
    assert compare(runs).others[0].pairs[0].name == "seen"


def test_probes_can_be_chosen(folders: dict[str, Path]) -> None:
    runs = open_runs([folders["base"], folders["fast"]])
    assert [p.name for p in compare(runs, ["pose"]).others[0].pairs] == ["pose"]
    with pytest.raises(UsageError, match="no run has a probe 'poze', did you mean 'pose'"):
        compare(runs, ["poze"])


def test_overlays_show_every_run(folders: dict[str, Path]) -> None:
    runs = open_runs([folders["base"], folders["fast"]])
    figures = dict(overlays(runs, ["seen", "pose", "plant.pose.theta"]))
    assert set(figures) == {"way", "seen", "pose", "plant.pose.theta"}
    for name in ("seen", "pose"):
        for i, axes in enumerate(figures[name].axes):
            drawn = {str(line.get_label()): line for line in axes.lines}
            for run in runs:
                line = drawn[run.label]
                rows, last = np.asarray(line.get_xydata())[:-1], np.asarray(line.get_xydata())[-1]
                assert np.array_equal(rows[:, 1], run.result[name][:, i])
                assert np.array_equal(rows[:, 0], run.result.time(name))
                # Sampled signals are held to the end of the last step.
                assert last[1] == rows[-1, 1] and last[0] > rows[-1, 0]
    ways = {str(line.get_label()): line for line in figures["way"].axes[0].lines}
    for run in runs:
        assert np.array_equal(ways[run.label].get_xydata(), run.result["pose"][:, :2])


def test_spikes_and_wide_signals_have_one_line_per_run(tmp_path: Path) -> None:
    graph = runtime.load(
        {
            "graph": "wide",
            "run": {"until": 0.2},
            "blocks": {
                "x": {"type": "Constant", "value": 0.5},
                "e": {"type": "AdaptiveEnsemble", "neurons": 20},
            },
            "wires": {"e": {"input": "x.value", "error": "x.value"}},
            "probes": {"spikes": "e.spikes", "activity": "e.activity"},
        }
    )
    folders = [graph.run(seed=seed).save(tmp_path / str(seed)) for seed in (1, 2)]
    runs = open_runs(folders)
    figures = dict(overlays(runs, ["spikes", "activity"]))
    (axes,) = figures["activity"].axes
    for line, run in zip(axes.lines, runs, strict=False):
        expected = np.sqrt(np.mean(run.result["activity"] ** 2, axis=1))
        assert np.allclose(np.asarray(line.get_ydata())[:-1], expected)
    (axes,) = figures["spikes"].axes
    for line, run in zip(axes.lines, runs, strict=False):
        rates = np.asarray(line.get_ydata())
        # Away from the ends, a window's mean is the number of spikes in it.
        count = np.count_nonzero(run.result["spikes"][75:125])
        assert rates[100] == pytest.approx(count / 20 / 0.05, rel=0.2)
