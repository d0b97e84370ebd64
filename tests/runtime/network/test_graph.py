"""A graph in Python: built, changed, written and read back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import runtime
from blocks import Constant, DifferentialDrive, Gain, Saturator, Sum
from runtime.document import Override
from runtime.document.loader import SHIPPED, shipped_graphs


def small() -> runtime.Graph:
    graph = runtime.Graph("small", dt=0.01, until=0.5, seed=2)
    graph = graph.add("go", Constant(value=[1.0, 0.5], signal="Twist"))
    graph = graph.add("limit", Saturator(omega_max=0.25), dt=0.02)
    graph = graph.add("plant", DifferentialDrive(x0=[0.0, 1.0, 0.1], integrator="rk4"))
    graph = graph.connect("go.value", "limit.command").connect("limit.limited", "plant.command")
    graph = graph.probe("pose", "plant.pose", every=5).plot("way", "trajectory", "pose")
    return graph.metric("turned", "final", "plant.pose.theta", below=1.0)


def test_yaml_loads_back_equal(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(small().to_yaml(), encoding="utf-8")
    again = runtime.load(path)
    assert again == small()
    assert again.to_yaml() == small().to_yaml()
    first, second = small().run(), again.run()
    assert np.array_equal(first["pose"], second["pose"])
    assert first.metrics == second.metrics


@pytest.mark.parametrize("name", shipped_graphs())
def test_shipped_graphs_write_and_load_back_equal(name: str, tmp_path: Path) -> None:
    graph = runtime.load(name)
    path = tmp_path / "copy.yaml"
    path.write_text(graph.to_yaml(), encoding="utf-8")
    assert runtime.load(path) == graph
    assert runtime.load(graph.to_dict()) == graph


def test_a_dict_is_the_same_graph() -> None:
    assert runtime.load(small().to_dict()) == small()


def test_changes_are_copies() -> None:
    graph = small()
    before = graph.to_yaml()
    changed = graph.set("limit.omega_max", 0.1).without("limit").bypass("limit")
    assert graph.to_yaml() == before
    assert changed != graph
    assert changed.overrides == (
        Override("set", "limit.omega_max", "0.1"),
        Override("without", "limit"),
        Override("bypass", "limit"),
    )
    printed = ["set limit.omega_max=0.1", "without limit", "bypass limit"]
    assert [str(override) for override in changed.overrides] == printed
    assert [Override.parse(text) for text in printed] == list(changed.overrides)


def test_building_returns_copies_and_leaves_the_graph_alone() -> None:
    graph = small()
    before = graph.to_yaml()
    more = graph.add("twice", Gain(gain=2.0)).connect("limit.limited", "twice.input")
    more = more.probe("twice.out").plot("line", "timeseries", "pose").metric("m", "final", "pose.x")
    assert graph.to_yaml() == before
    assert more.names == [*graph.names, "twice"]
    assert more.overrides == graph.overrides == ()
    with pytest.raises(AttributeError, match="a graph never changes, so 'source' cannot be set"):
        graph.source = None  # type: ignore[misc]


def test_a_result_of_add_that_is_dropped_is_reported() -> None:
    graph = runtime.Graph("dropped")
    graph.add("go", Constant(value=1.0))
    message = "there is no block 'go' .*keep what add() returns, as in graph = graph.add"
    with pytest.raises(runtime.UsageError, match=message.replace("()", r"\(\)")):
        graph.connect("source.out", "go.input")


def test_copies_with_other_seeds_share_what_is_checked_and_planned() -> None:
    graph = small()
    first, second = graph.with_seed(3), graph.with_seed(3).with_seed(4)
    assert (first.network.seed, second.network.seed, graph.network.seed) == (3, 4, 2)
    assert first.program() is second.program() is graph.program()
    assert first.network.entries is graph.network.entries
    wrong = graph.set("run.seed", -1)
    assert wrong.with_seed(5).network.seed == 5


def test_bypass_and_without() -> None:
    straight = small().bypass("limit").run()
    assert straight["plant.pose"][-1, 2] > small().run()["plant.pose"][-1, 2]
    with pytest.raises(
        runtime.GraphError, match=r"input 'plant.command' \(Twist\) is not connected"
    ):
        small().without("limit").check()


def test_a_removed_term_takes_its_sign_along() -> None:
    graph = runtime.Graph(dt=1.0, until=1.0)
    for i, value in enumerate((1.0, 10.0, 100.0)):
        graph = graph.add(f"c{i}", Constant(value=value))
    graph = graph.add("sum", Sum(signs=[1, -1, -1]))
    for i in range(3):
        graph = graph.connect(f"c{i}.value", "sum.terms")
    graph = graph.probe("sum.out")
    assert graph.run()["sum.out"][0] == -109.0
    assert graph.without("c1").run()["sum.out"][0] == -99.0
    assert graph.without("c0", "c1").run()["sum.out"][0] == -100.0


def test_errors_in_building_are_reported() -> None:
    graph = small()
    with pytest.raises(runtime.UsageError, match="there is a block 'go' already"):
        graph.add("go", Gain(gain=1.0))
    with pytest.raises(
        runtime.UsageError, match="'plant.command' is wired to 'limit.limited' already"
    ):
        graph.connect("go.value", "plant.command")
    with pytest.raises(runtime.GraphError, match="did you mean 'limit'"):
        graph.set("blocks.limti.omega_max", 1.0)


def test_results_answer_by_probe_address_and_component(tmp_path: Path) -> None:
    result = small().run()
    assert np.array_equal(result["pose"], result["plant.pose"])
    assert (
        np.array_equal(result["plant.pose.theta"], result["pose"][:, 2])
        or len(result["plant.pose.theta"]) == 50
    )
    with pytest.raises(KeyError, match="did you mean 'pose'"):
        result["pos"]
    assert "plant.pose" in result
    assert "nothing" not in result
    folder = result.save(tmp_path / "run")
    again = runtime.open(folder)
    assert list(again) == list(result)
    assert np.array_equal(again["plant.pose"], result["plant.pose"])
    assert again.metrics == result.metrics
    assert again.title == "small"
    with pytest.raises(runtime.UsageError, match="exists already"):
        result.save(folder)
    with pytest.raises(runtime.UsageError, match="holds no run"):
        runtime.open(tmp_path)


def test_a_result_draws_its_plots() -> None:
    from matplotlib.figure import Figure

    result = small().run()
    assert isinstance(result.plot("way"), Figure)
    assert list(result.plot()) == ["way"]  # type: ignore[arg-type]
    with pytest.raises(runtime.UsageError, match="did you mean 'way'"):
        result.plot("wya")


def test_a_graph_shows_itself_in_a_notebook() -> None:
    svg = small()._repr_svg_()
    assert svg.lstrip().startswith("<")
    assert "DifferentialDrive" in svg


def test_blocks_of_a_file_are_written_with_their_module(tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text(
        'from blocks import *\nclass Twice(Block):\n    """Twice."""\n'
        "    x = Input(Scalar)\n    out = Output(Scalar)\n"
        "    def output(self, state, t, x):\n        return 2.0 * x\n"
    )
    text = (
        "run: {dt: 1, until: 1}\nblocks:\n  c: {type: Constant, value: 3}\n"
        "  twice: {type: Twice, module: own.py}\nwires:\n  twice: {x: c.value}\n"
        "probes: {out: twice.out}\n"
    )
    (tmp_path / "g.yaml").write_text(text)
    result = runtime.load(tmp_path / "g.yaml").run()
    assert result["out"][0] == 6.0
    folder = result.save(tmp_path / "runs" / "one")
    file.unlink()
    assert runtime.load(folder / "graph.resolved.yaml").run()["out"][0] == 6.0


def test_shipped_graphs_name_what_they_need() -> None:
    assert set(shipped_graphs()) >= {
        *("line_actuator_failure", "line_actuator_failure_robust"),
        *("sine_estimation_error", "sine_estimation_error_robust"),
    }
    assert (SHIPPED / "parts" / "adaptive_snn.yaml").is_file()
    for name in ("line_actuator_failure", "sine_estimation_error"):
        network = runtime.load(name).network
        sizes = [
            e.block.value("neurons")
            for e in network.entries.values()
            if e.cls.__name__ == "AdaptiveEnsemble"
        ]
        assert sizes == [100, 100]


def test_results_answer_by_the_address_that_was_written() -> None:
    """Through a part's port, and through a bypass that makes two addresses one signal."""
    result = runtime.load("line_actuator_failure").run(until=0.05)
    assert result["adaptive.command"].shape == (5, 2)
    graph = small().probe("both", "limit.limited", "go.value", every=1)
    with pytest.raises(runtime.GraphError, match="constant"):
        graph.check()
    graph = small().add("twice", Gain(gain=2.0)).connect("limit.limited", "twice.input")
    straight = graph.probe("both", "limit.limited", "twice.out").bypass("twice").run()
    assert straight["both"].shape[1] == 4
    assert np.array_equal(straight["limit.limited"], straight["twice.out"])


def test_a_world_is_exchanged_whole_by_its_file() -> None:
    graph = runtime.load("wall_following")
    for changed in (
        graph.set("world", "worlds/l_room.yaml"),
        graph.overlay({"world": "worlds/l_room.yaml"}),
    ):
        world = changed.network.world
        assert world is not None
        assert len(world.circles) == 0
        assert world.room is not None
        assert len(world.room) == 6
    with pytest.raises(runtime.GraphError, match="no such"):
        graph.set("world", "worlds/nowhere.yaml")


def test_a_part_may_have_an_output_with_the_name_of_an_inner_block() -> None:
    inner = {
        "outputs": {"k": "twice.out", "v": "v.out"},
        "blocks": {
            "k": {"type": "Constant", "value": 3.0},
            "twice": {"type": "Gain", "gain": 2.0},
            "v": {"type": "Function", "expression": ["7", "8"]},
        },
        "wires": {"twice": {"input": "k.value"}},
    }
    graph = runtime.load(
        {
            "run": {"dt": 0.1, "until": 0.1},
            "blocks": {"p": inner, "after": {"type": "Gain", "gain": 1.0}},
            "wires": {"after": {"input": "p.k"}},
            "probes": {"o": "p.k", "b": "p.k.value", "after": "after.out", "v": "p.v[1]"},
        }
    )
    result = graph.run()
    assert [float(np.ravel(result[name])[0]) for name in "obv"] == [6.0, 3.0, 8.0]
    assert result["after"][0] == 6.0
