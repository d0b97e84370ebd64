"""Models of Nengo as graphs: text, arrays, own blocks, and the same spikes."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime
from tests.conftest import Run

nengo = pytest.importorskip("nengo")

from spikeblocks.nengo.expressions import expression_of  # noqa: E402
from spikeblocks.nengo.importing import Imported, import_file, is_equal, run_both  # noqa: E402

PES = """
import nengo, numpy as np
with nengo.Network(seed=2) as model:
    stimulus = nengo.Node(lambda t: [np.sin(8 * t), 0.5 if t > 0.02 else -0.5])
    pre, post = nengo.Ensemble(30, 2), nengo.Ensemble(25, 1, radius=1.5)
    error = nengo.Ensemble(20, 1)
    nengo.Connection(stimulus, pre)
    learnt = nengo.Connection(pre, post, function=lambda x: 0 * x[0],
                              learning_rule_type=nengo.PES(2e-4))
    nengo.Connection(post, error)
    nengo.Connection(pre, error, function=lambda x: x[0] * x[1], transform=-1)
    nengo.Connection(error, learnt.learning_rule)
    off = nengo.Node(lambda t: 1.0 if t > 0.04 else 0.0)
    nengo.Connection(off, error.neurons, transform=[[-3]] * 20, synapse=None)
    value = nengo.Probe(post, synapse=0.01)
    weights = nengo.Probe(learnt, "weights", synapse=None)
"""
ARRAYS = """
import nengo, numpy as np
with nengo.Network(seed=1) as model:
    stimulus = nengo.Node([0.2, 0.8, 0.5])
    bg = nengo.networks.BasalGanglia(3)
    thalamus = nengo.networks.Thalamus(3)
    nengo.Connection(stimulus, bg.input, synapse=None)
    nengo.Connection(bg.output, thalamus.input)
    chosen = nengo.Probe(thalamus.output, synapse=0.01)
"""
RULES = """
import nengo, numpy as np
with nengo.Network(seed=1) as model:
    stimulus = nengo.Node(lambda t: [np.sin(9 * t), np.cos(5 * t)])
    a, b = nengo.Ensemble(20, 2), nengo.Ensemble(25, 2)
    c, d = nengo.Ensemble(20, 2), nengo.Ensemble(15, 2)
    nengo.Connection(stimulus, a, synapse=None)
    nengo.Connection(a, b, learning_rule_type=nengo.Voja())
    nengo.Connection(a.neurons, c.neurons, transform=np.full((20, 20), 1e-3),
                     learning_rule_type=nengo.Oja())
    nengo.Connection(c, d, solver=nengo.solvers.LstsqL2(weights=True))
    out = nengo.Probe(d, synapse=0.01)
"""


def imported(folder: Path, text: str, **options: Any) -> Imported:
    (folder / "model.py").write_text(text, encoding="utf-8")
    return import_file(str(folder / "model.py"), folder / "my.yaml", **options)


@pytest.mark.parametrize(
    ("text", "engine"),
    [
        (PES, "python"),
        (RULES, "python"),
        (ARRAYS, "python"),
        *(pytest.param(text, "compiled", marks=pytest.mark.slow) for text in (PES, RULES, ARRAYS)),
    ],
)
def test_spikes_and_probes_are_nengos(tmp_path: Path, text: str, engine: str) -> None:
    ours, theirs = run_both(imported(tmp_path, text), 0.08, engine)
    assert any(theirs[name].any() for name in theirs if name.startswith("spikes"))
    for name, expected in theirs.items():
        scale = max(1e-6, float(np.abs(expected).max()))
        np.testing.assert_allclose(ours[name], expected, rtol=0, atol=1e-9 * scale, err_msg=name)


def test_the_text_is_short_and_says_what_is_computed(tmp_path: Path) -> None:
    imported(tmp_path, PES)
    text = (tmp_path / "my.yaml").read_text(encoding="utf-8")
    assert "pre_error: {type: Decoder, weights: my.npz#pre_error.weights" in text
    assert "# of x[0] * x[1]" in text
    assert 'stimulus: {type: Function, expression: ["sin(8 * (t + 0.001))"' in text
    assert "learning: {rule: pes, learning_rate: 0.0002, tau: 0.005}" in text


@pytest.mark.slow
def test_basal_ganglia_of_ten_actions_are_under_sixty_lines(tmp_path: Path) -> None:
    imported(tmp_path, ARRAYS.replace("[0.2, 0.8, 0.5]", "[0.1] * 10").replace("(3)", "(10)"))
    text = (tmp_path / "my.yaml").read_text(encoding="utf-8")
    assert len(text.splitlines()) < 60
    assert "groups: 10" in text


@pytest.mark.slow
def test_redraw_has_functions_and_no_arrays(tmp_path: Path) -> None:
    done = imported(tmp_path, ARRAYS, redraw=True)
    text = done.files[0].read_text(encoding="utf-8")
    assert "max(0, x - 0.2)" in text
    assert ".npz" not in text
    assert [path.name for path in done.files] == ["my.yaml"]
    ours, theirs = run_both(done, 0.3)
    # Other neurons of the same model: the same action is chosen, with a value alike.
    for values in (ours["chosen"], theirs["chosen"]):
        assert np.argmax(values[-50:].mean(axis=0)) == 1
    difference = ours["chosen"][-50:].mean(axis=0) - theirs["chosen"][-50:].mean(axis=0)
    assert np.abs(difference).max() < 0.25


def test_a_function_that_is_no_expression_is_a_table(tmp_path: Path) -> None:
    text = PES.replace("x[0] * x[1]", "sorted([x[0], x[1], 0.1])[1]")
    done = imported(tmp_path, text, redraw=True)
    assert "targets: my.npz#pre_error.function.targets" in done.files[0].read_text(encoding="utf-8")
    ours, theirs = run_both(imported(tmp_path, text), 0.03)
    assert np.array_equal(ours["spikes of error"], theirs["spikes of error"])


OWN = """
import nengo, numpy as np
LEVELS = [0.1, 0.5, 0.9]
state = []
def plain(t, x):
    total = 0.0
    for level in LEVELS:
        if x[0] > level:
            total += level
    return total
def remembers(t, x):
    state.append(x[0])
    return sum(state)
with nengo.Network(seed=1) as model:
    noise = nengo.Node(nengo.processes.WhiteSignal(1.0, high=20))
    stairs = nengo.Node(plain, size_in=1)
    memory = nengo.Node(remembers, size_in=1)
    a, b = nengo.Ensemble(20, 1), nengo.Ensemble(20, 1)
    nengo.Connection(noise, a)
    nengo.Connection(a, stairs)
    nengo.Connection(stairs, b)
    nengo.Connection(a, memory)
    out = nengo.Probe(stairs)
"""


def test_python_nodes_become_blocks_and_what_is_not_plain_is_named(tmp_path: Path) -> None:
    done = imported(tmp_path, OWN)
    own = (tmp_path / "my_blocks.py").read_text(encoding="utf-8")
    assert "for level in LEVELS" in own
    assert "LEVELS = [0.1, 0.5, 0.9]" in own
    assert any("write class Memory by hand" in note for note in done.notes)
    assert any("noise: a process; recorded for 1 s" in note for note in done.notes)
    graph = runtime.load(done.files[0])
    with pytest.raises(runtime.SimulationError, match="write what the node memory"):
        graph.run()
    # Without the stub, all of it is Nengo's.
    graph = graph.without("memory").set("run.until", 0.05)
    with nengo.Simulator(done.network, progress_bar=False) as simulator:
        simulator.run(0.05, progress_bar=False)
    np.testing.assert_allclose(
        graph.run()["out"].reshape(-1)[:50], simulator.data[done.network.probes[0]][:50, 0],
        atol=1e-12,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("function", "d", "expected"),
    [
        (lambda x: x[0] * x[1], 2, "x[0] * x[1]"),
        (np.square, 1, "x**2"),
        (np.sin, 1, "sin(x)"),
        (np.multiply.reduce, 2, ["1*x[0]*x[1]", "x[0]*x[1]"]),
        (lambda x: float(str(x[0])), 1, None),
        (lambda x: 1 / 0, 1, None),
    ],
)
def test_functions_are_recognised_by_their_values(function: Any, d: int, expected: Any) -> None:
    rng = np.random.default_rng(0)
    points = [(p,) for p in rng.uniform(-1, 1, (50, d))]
    found = expression_of(function, points, {"x": d})
    if isinstance(expected, list):
        assert found in (expected, *expected, *([each] for each in expected))
    elif expected is None and found is not None:
        assert found in ("x", ["x[0]"])  # float(str(x)) is x
    else:
        assert found == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x = 1\n", "expected one network"),
        ("import nengo\na, b = nengo.Network(), nengo.Network()\n", "got a, b; write"),
        ("1 / 0\n", "fails: ZeroDivisionError"),
        ("import os, sys\nos.chdir('/')\nsys.stderr = None\n", "expected one network"),
        ("import nengo, sys\nwith nengo.Network() as m:\n  u = nengo.Node(0)\n"
         "  a = nengo.Ensemble(9, 1)\n"
         "  nengo.Connection(u, a)\nu.output = lambda t: sys.exit(0)\n", "fails: SystemExit: 0 ("),
        ("import nengo\nwith nengo.Network() as m:\n  a = nengo.Ensemble(9, 1)\n"
         "  nengo.Connection(a, a, function=lambda x: x if x < 0.5 else 1 / 0)\n", "model.py:4)"),
        ("import nengo\nwith nengo.Network() as m:\n  nengo.Ensemble(9, 1, "
         "neuron_type=nengo.PoissonSpiking(nengo.LIFRate(amplitude=2)))\n", "is not read; give"),
        ("import nengo\nwith nengo.Network() as m:\n"
         "  a = nengo.Ensemble(9, 1)\n"
         "  nengo.Connection(a, a, synapse=nengo.LinearFilter([1], [1], analog=False))\n",
             "is a gain, which is not read; put it into the transform"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_said(tmp_path: Path, cli: Run, text: str, expected: str) -> None:
    (tmp_path / "model.py").write_text(text, encoding="utf-8")
    done = cli("import", "nengo", str(tmp_path / "model.py"), "-o", str(tmp_path / "my.yaml"))
    assert done.returncode == 2
    assert expected in done.stderr
    assert not (tmp_path / "my.yaml").exists()


def test_a_model_that_closes_stdout_gets_its_graph_and_a_sentence(tmp_path: Path, cli: Run) -> None:
    (tmp_path / "model.py").write_text(f"{PES}\nimport sys\nsys.stdout.close()\n", encoding="utf-8")
    done = cli("import", "nengo", f"{tmp_path}/model.py", "-o", f"{tmp_path}/my.yaml")
    assert done.returncode == 2
    assert done.stderr.endswith("cannot write to stdout: Bad file descriptor\n")
    assert (tmp_path / "my.yaml").exists()


def test_the_command_writes_compares_and_prints(tmp_path: Path, cli: Run) -> None:
    (tmp_path / "model.py").write_text(PES, encoding="utf-8")
    done = cli("import", "nengo", f"{tmp_path}/model.py:model", "-o", f"{tmp_path}/my.yaml",
               "--until", "0.05", "--compare")  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "spikes of pre: equal" in done.stdout
    missing = cli("import", "nengo", f"{tmp_path}/nothing.py")
    assert missing.returncode == 2
    assert "there is no file" in missing.stderr


def test_without_nengo_the_message_is_the_pip_line(
    tmp_path: Path, cli: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    from runtime.errors import MissingExtraError
    from spikeblocks.nengo import verb

    monkeypatch.setitem(sys.modules, "nengo", None)
    parser = __import__("argparse").ArgumentParser()
    verb.add(parser)
    with pytest.raises(MissingExtraError, match=r"pip install .*\[nengo\]"):
        verb.run(parser.parse_args(["nengo", "model.py"]))


HEAD = """
import nengo, numpy as np
with nengo.Network(seed=1) as model:
    u = nengo.Node(lambda t: [np.sin(9 * t), np.cos(9 * t)])
    a, b = nengo.Ensemble(30, 2), nengo.Ensemble(25, 2)
    nengo.Connection(u, a)
    w = np.random.RandomState(0).normal(0, 1e-3, (25, 30))
"""


@pytest.mark.parametrize(
    "line",
    [
        "nengo.Connection(a.neurons, b.neurons, transform=w, learning_rule_type=[nengo.Oja(1e-6, "
        "post_synapse=0.05), nengo.BCM(1e-9, post_synapse=0.05)])",
        "k = nengo.Connection(a, b, learning_rule_type={'a': nengo.PES(1e-3), "
        "'b': nengo.PES(3e-4), "
        "'v': nengo.Voja(1e-2)})\n"
        "    nengo.Connection(b, k.learning_rule['a']); nengo.Connection(u, k.learning_rule['b'])\n"
        "    p = nengo.Probe(k, 'weights', sample_every=0.01)\n"
        "    q = nengo.Probe(k.learning_rule['v'], 'scaled_encoders')",
        "nengo.Connection(a, b[0], function=lambda x: x[0], learning_rule_type=nengo.Voja(1e-2))\n"
        "    nengo.Connection(u, b, learning_rule_type=nengo.Voja(5e-2, post_synapse=None))",
        "k = nengo.Connection(a, b, solver=nengo.solvers.LstsqL2(weights=True), "
        "learning_rule_type=nengo.Oja(1e-6, post_synapse=nengo.Alpha(0.01)))\n"
        "    p = nengo.Probe(k, 'weights')",
        "k = nengo.Connection(a, b, solver=nengo.solvers.LstsqL2(weights=True), "
        "learning_rule_type=nengo.PES(1e-3, pre_synapse=nengo.Alpha(0.01)))\n"
        "    nengo.Connection(u, k.learning_rule); p = nengo.Probe(k, 'weights')",
    ],
    ids=["oja bcm", "pes pes voja", "two voja", "full oja", "full pes"],
)
def test_several_rules_and_their_probes_are_nengos(tmp_path: Path, line: str) -> None:
    told = imported(tmp_path, f"{HEAD}    {line}\n").compare(0.1)
    assert all(map(is_equal, told.values())), told


def test_a_difference_is_an_exit_code(tmp_path: Path, cli: Run) -> None:
    text = "import nengo\nwith nengo.Network(seed=1) as m:\n  a = nengo.Ensemble(30, 1, "
    text += "neuron_type=nengo.PoissonSpiking(nengo.LIFRate()))\n"
    (tmp_path / "model.py").write_text(text, encoding="utf-8")
    done = cli("import", "nengo", f"{tmp_path}/model.py", "-o", f"{tmp_path}/my.yaml",
               "--until", "0.05", "--compare")  # fmt: skip
    assert done.returncode == 1
    assert "spikes of a: differs:" in done.stdout
