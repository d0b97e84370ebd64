"""Learning rules against Nengo's, weight for weight, and against the fused AdaptiveEnsemble."""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
import pytest

import blocks
import runtime
from tests.blocks.neural.models import Wave, drawn, ensemble, graph, simulated, ticks, wave, weights

LENGTHS = [pytest.param(0.6, id="short"), pytest.param(10.0, id="10s", marks=pytest.mark.slow)]
N = 40


def learner(seconds: float, fixed: dict[str, Any], initial: Any, **more: Any) -> runtime.Graph:
    made = graph(seconds).add("x", Wave(size=2)).add("e", Wave(size=2, speed=1.3))
    made = made.add("snn", blocks.Ensemble(neurons=N, radius=1.2, **fixed))
    made = made.add("out", blocks.Decoder(weights=initial, **more))
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")
    made = made.connect("e.out", "out.error")
    return made.probe("snn.fired").probe("out.weights").probe("out.value")


@pytest.mark.parametrize("seconds", LENGTHS)
@pytest.mark.parametrize(
    ("rule", "theirs"),
    [
        ({"rule": "pes", "learning_rate": 1e-3}, nengo.PES(1e-3)),
        ({"rule": "rls", "tau": 0.01}, nengo.RLS(1e-3, pre_synapse=nengo.Lowpass(0.01))),
        ({"rule": "pes", "tau": "alpha(0.01)"}, nengo.PES(pre_synapse=nengo.Alpha(0.01))),
        (
            {"rule": "rls", "tau": "triangle(0.004)"},
            nengo.RLS(pre_synapse=nengo.synapses.Triangle(0.004)),
        ),
    ],
    ids=["pes", "rls", "pes alpha", "rls triangle"],
)
def test_rules_with_an_error_are_nengos(rule: Any, theirs: Any, seconds: float) -> None:
    fixed, initial = drawn(N, 2, 1), weights(2, N, 2)
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 2)))
        e = nengo.Node(ticks(lambda t: wave(t, 2, 1.3)))
        population = ensemble(N, 2, fixed, radius=1.2)
        nengo.Connection(x, population, synapse=None)
        out = nengo.Node(size_in=2)
        link = nengo.Connection(
            population,
            out,
            synapse=0.01,
            solver=nengo.solvers.NoSolver(initial.T),
            learning_rule_type=theirs,
        )
        nengo.Connection(e, link.learning_rule, synapse=None)
        learnt, value = nengo.Probe(link, "weights"), nengo.Probe(out)
    data = simulated(model, seconds).data
    ours = learner(seconds, fixed, initial, synapse=0.01, learning=rule).run()
    # What a tick learns is in the weights with which its successor decodes.
    np.testing.assert_allclose(ours["out.weights"][1:], data[learnt][:-1], rtol=0.0, atol=1e-10)
    np.testing.assert_allclose(ours["out.value"], data[value], rtol=0.0, atol=1e-10)
    assert np.abs(data[learnt][-1] - initial).max() > 1e-5


def test_learning_compiles() -> None:
    fixed, initial = drawn(N, 2, 1), weights(2, N, 2)
    made = learner(0.3, fixed, initial, learning="pes")
    python, compiled = made.run(), made.run(engine="compiled")
    np.testing.assert_allclose(
        compiled["out.weights"], python["out.weights"], rtol=1e-12, atol=1e-15
    )


@pytest.mark.parametrize(
    ("block", "wrong", "expected"),
    [
        (blocks.Weights, [{"rule": "oja"}, {"rule": "oja"}], "add up the learning rates"),
        (blocks.Weights, [{"rule": "oja"}, {"rule": "bcm", "tau": 1}], "the same activities"),
        (blocks.Ensemble, [{"rule": "voja", "tau": "alpha(1)"}, "voja"], "each takes a time"),
        (blocks.Decoder, ["pes", "rls"], "expected a learning rule"),
    ],
)
def test_rules_that_do_not_add_up_are_refused(block: Any, wrong: Any, expected: str) -> None:
    with pytest.raises(blocks.ParameterError, match=expected):
        block(learning=wrong, **({"weights": 0.1} if block is blocks.Weights else {}))


def voja(rate: float, tau: Any, synapse: Any) -> tuple[dict[str, Any], Any]:
    rule = {"rule": "voja", "learning_rate": rate, "tau": tau}
    return rule, nengo.Voja(rate, post_synapse=synapse)


FAST, SLOW = voja(0.05, 0.0, None), voja(0.02, 0.01, 0.01)
SLOWER = voja(0.03, 0.02, 0.02)


@pytest.mark.parametrize("seconds", LENGTHS)
@pytest.mark.parametrize(
    "rules",
    [[FAST], [SLOW], [voja(0.05, "alpha(0.01)", nengo.Alpha(0.01))], [FAST, SLOW, SLOWER]],
    ids=["no filter", "lowpass", "alpha", "three"],
)
def test_voja_is_nengos(seconds: float, rules: Any) -> None:
    fixed = drawn(N, 2, 3)
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 2)))
        population = ensemble(N, 2, fixed, radius=1.2)
        link = nengo.Connection(
            x, population, synapse=None, learning_rule_type=[theirs for _, theirs in rules]
        )
        learnt = nengo.Probe(link.learning_rule[0], "scaled_encoders")
        spikes = nengo.Probe(population.neurons)
    data = simulated(model, seconds).data
    rule = [ours for ours, _ in rules] if len(rules) > 1 else rules[0][0]
    made = graph(seconds).add("x", Wave(size=2))
    made = made.add("snn", blocks.Ensemble(neurons=N, radius=1.2, learning=rule, **fixed))
    made = made.connect("x.out", "snn.input").probe("snn.fired").probe("snn.scaled_encoders")
    ours = made.run()
    same(ours, made, "snn.scaled_encoders")
    assert np.array_equal(ours["snn.fired"], data[spikes])
    found = np.swapaxes(ours["snn.scaled_encoders"], 1, 2)
    np.testing.assert_allclose(found, data[learnt], rtol=0.0, atol=1e-10)


def same(python: runtime.Result, made: runtime.Graph, probe: str) -> None:
    """Whether both engines learn the same."""
    compiled = made.run(engine="compiled")
    np.testing.assert_allclose(compiled[probe], python[probe], rtol=1e-12, atol=1e-15)


ALPHA = nengo.Alpha(0.01)
POST = {"tau": 0.002, "post_tau": 0.02}


@pytest.mark.parametrize(
    ("rule", "theirs"),
    [
        ({"rule": "bcm", "learning_rate": 1e-9}, nengo.BCM(1e-9)),
        ({"rule": "oja", "learning_rate": 1e-6, "beta": 2}, nengo.Oja(1e-6, beta=2.0)),
        (
            {"rule": "oja", "tau": 0, "post_tau": "alpha(0.01)"},
            nengo.Oja(pre_synapse=nengo.Lowpass(0), post_synapse=ALPHA),
        ),
        (
            {"rule": "bcm", "tau": "alpha(0.01)", "post_tau": 0.02, "theta_tau": "alpha(0.01)"},
            nengo.BCM(pre_synapse=ALPHA, post_synapse=0.02, theta_synapse=ALPHA),
        ),
        (
            [{"rule": "bcm", "theta_tau": 0.1, **POST}, {"rule": "oja", **POST}],
            [nengo.BCM(1e-9, 0.002, 0.02, 0.1), nengo.Oja(1e-6, 0.002, 0.02)],
        ),
    ],
    ids=["bcm", "oja", "oja post", "bcm filters", "both"],
)
def test_rules_without_an_error_are_nengos(rule: Any, theirs: Any) -> None:
    before, after = drawn(N, 2, 4), drawn(12, 1, 5)
    initial = weights(12, N, 6) * 0.1
    with nengo.Network(seed=1) as model:
        x = nengo.Node(ticks(lambda t: wave(t, 2)))
        first, second = ensemble(N, 2, before, radius=1.2), ensemble(12, 1, after)
        nengo.Connection(x, first, synapse=None)
        link = nengo.Connection(
            first.neurons,
            second.neurons,
            transform=initial,
            synapse=0.005,
            learning_rule_type=theirs,
        )
        learnt, spikes = nengo.Probe(link, "weights"), nengo.Probe(second.neurons)
    data = simulated(model, 0.5).data
    made = graph(0.5).add("x", Wave(size=2)).add("b", blocks.Constant(value=[0.0], signal="Vector"))
    made = made.add("first", blocks.Ensemble(neurons=N, radius=1.2, **before))
    made = made.add("second", blocks.Ensemble(neurons=12, **after))
    made = made.add("w", blocks.Weights(weights=initial, learning=rule))
    made = made.connect("x.out", "first.input").connect("first.spikes", "w.spikes")
    made = made.connect("w.current", "second.current").connect("second.spikes", "w.post")
    made = made.connect("b.value", "second.input")
    made = made.probe("w.weights").probe("second.fired")
    ours = made.run()
    same(ours, made, "w.weights")
    assert np.array_equal(ours["second.fired"], data[spikes])
    np.testing.assert_allclose(ours["w.weights"][1:], data[learnt][:-1], rtol=1e-11, atol=1e-14)


def pair(fixed: dict[str, Any], rate: float) -> runtime.Graph:
    """A fused AdaptiveEnsemble, and Ensemble and Decoder in its place, each in a closed loop."""
    made = graph(1.0).add("x", Wave(size=2))
    fused = blocks.AdaptiveEnsemble(
        neurons=N, learning_rate=rate, tau_syn=0.02, radius=1.2, **fixed
    )
    made = made.add("fused", fused).connect("x.out", "fused.input")
    made = made.add("one", blocks.Sum(signs=[1, -1])).connect("fused.output", "one.terms")
    made = made.connect("x.out", "one.terms").connect("one.out", "fused.error")
    made = made.add("snn", blocks.Ensemble(neurons=N, radius=1.2, **fixed))
    decoder = blocks.Decoder(
        weights=np.zeros((2, N)),
        synapse=0.02,
        filter="spikes",
        learning={"rule": "pes", "learning_rate": rate},
    )
    made = made.add("out", decoder).connect("x.out", "snn.input")
    made = made.connect("snn.spikes", "out.spikes").add("two", blocks.Sum(signs=[1, -1]))
    made = made.connect("out.value", "two.terms").connect("x.out", "two.terms")
    return made.connect("two.out", "out.error").probe("fused.output").probe("out.value")


def test_the_fused_ensemble_is_the_pair() -> None:
    found = pair(drawn(N, 2, 7), 1e-3).run()
    assert np.abs(found["fused.output"]).max() > 0.1
    np.testing.assert_allclose(found["out.value"], found["fused.output"], rtol=0.0, atol=1e-12)


def test_a_rate_of_zero_freezes() -> None:
    fixed, initial = drawn(N, 2, 1), weights(2, N, 2)
    for rule in ("pes", "rls"):
        frozen = learner(0.1, fixed, initial, learning={"rule": rule, "learning_rate": 0})
        np.testing.assert_array_equal(frozen.run()["out.weights"][-1], initial)
    made = learner(0.1, fixed, initial, learning="pes").add("off", blocks.Constant(value=0.0))
    paused = made.connect("off.value", "out.learn").run()
    np.testing.assert_array_equal(paused["out.weights"][-1], initial)


def test_functions_are_decoded() -> None:
    made = graph(0.5).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=300, radius=1.4))
    product = blocks.Decoder(function="x[0]*x[1]", synapse=0.02)
    made = made.add("product", product).add(
        "both", blocks.Decoder(function=["x[1]", "x[0]**2"], transform=[[1, 0], [0, 2], [1, 1]])
    )
    made = made.connect("x.out", "snn.input").connect("snn.spikes", "product.spikes")
    made = made.connect("snn.spikes", "both.spikes").probe("product.value").probe("both.value")
    found = made.run()
    x = np.array([wave(k * 0.001, 2) for k in range(500)])
    lag = x[60:-20]
    assert np.sqrt(np.mean((found["product.value"][80:, 0] - lag[:, 0] * lag[:, 1]) ** 2)) < 0.12
    assert found["both.value"].shape == (500, 3)
    lag = x[95:-5]
    expected = np.stack([lag[:, 1], 2 * lag[:, 0] ** 2, lag[:, 1] + lag[:, 0] ** 2], axis=1)
    assert np.sqrt(np.mean((found["both.value"][100:] - expected) ** 2)) < 0.35


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"function": "x[0] +"}, "out.function: "),
        ({"function": "x[2]"}, "out.function: "),
        ({"function": "y"}, "out.function: "),
        ({"function": "x[0]", "weights": [[1.0] * 9]}, "weights that are given are used as they"),
        ({"filter": "spikes", "synapse": "none"}, "synapse: expected a lowpass"),
        ({"learning": "pes"}, "pes learns from an error"),
        ({"learning": {"rule": "pse"}}, "did you mean 'pes'"),
        ({"learning": {"rule": "pes", "rate": 1}}, "learning.rate: unknown"),
    ],
)
def test_wrong_decoders(parameters: dict[str, Any], message: str) -> None:
    with pytest.raises((runtime.GraphError, blocks.ParameterError), match=message):
        made = graph(0.1).add("x", Wave(size=2)).add("snn", blocks.Ensemble(neurons=9))
        made = made.add("out", blocks.Decoder(**parameters)).connect("x.out", "snn.input")
        made.connect("snn.spikes", "out.spikes").check()


def test_an_error_that_nothing_learns_from_is_an_error() -> None:
    with pytest.raises(runtime.GraphError, match="'error' is wired but nothing learns"):
        learner(0.1, drawn(N, 2, 1), weights(2, N, 2)).check()


@pytest.mark.parametrize(
    ("function", "radius", "fails"),
    [
        ("log(x[0])", 1.0, True),
        # defined within a circle of 1.5
        ("sqrt(2.25 - x[0]**2 - x[1]**2)", 1.4, False),
        ("sqrt(2.25 - x[0]**2 - x[1]**2)", 1.8, True),
    ],
)
def test_a_function_that_fails_within_the_radius_is_an_error_before_the_run(
    function: str, radius: float, fails: bool
) -> None:
    made = graph(0.1).add("x", Wave(size=2))
    made = made.add("snn", blocks.Ensemble(neurons=9, radius=radius)).connect("x.out", "snn.input")
    made = made.add("out", blocks.Decoder(function=function)).connect("snn.spikes", "out.spikes")
    if fails:
        message = r"blocks.out.function: the function fails at x = \[.*inside the radius"
        with pytest.raises(runtime.GraphError, match=message):
            made.check()
    else:
        made.check()


def test_a_function_that_fails_at_a_given_point_says_where() -> None:
    made = graph(0.1).add("x", Wave(size=1)).add("snn", blocks.Ensemble(neurons=9))
    points = np.linspace(-1, 1, 20)[:, None].tolist()
    given = blocks.Decoder(function="1/(x + 1)", eval_points=points)
    made = made.add("out", given).connect("x.out", "snn.input").connect("snn.spikes", "out.spikes")
    with pytest.raises(runtime.GraphError, match=r"function fails at x = \[-1\]"):
        made.check()


def test_weights_between_ensembles_are_solved_as_nengos() -> None:
    """On other points than Nengo's, of which there are many, and for a function of the input."""
    before, after = drawn(N, 2, 4), drawn(12, 1, 5)
    with nengo.Network(seed=1) as model:
        first, second = ensemble(N, 2, before, radius=1.2), ensemble(12, 1, after, radius=2.0)
        link = nengo.Connection(
            first,
            second,
            function=lambda x: x[0] - 0.5 * x[1],
            solver=nengo.solvers.LstsqL2(weights=True),
        )
    # Nengo's are straight into the neurons: the gain is in them.
    expected = simulated(model, 0.001).data[link].weights / after["gain"][:, None]
    made = graph(0.01).add("x", Wave(size=2))
    made = made.add("first", blocks.Ensemble(neurons=N, radius=1.2, **before))
    made = made.add("second", blocks.Ensemble(neurons=12, dimensions=1, radius=2.0, **after))
    made = made.add("w", blocks.Weights(solver="l2", function="x[0] - 0.5*x[1]"))
    made = made.connect("x.out", "first.input").connect("first.spikes", "w.spikes")
    made = made.connect("w.current", "second.current").connect("second.spikes", "w.post")
    ours = made.probe("w.weights").run()["w.weights"][0]
    np.testing.assert_allclose(ours, expected, rtol=0.0, atol=0.05 * np.abs(expected).max())
    with pytest.raises(runtime.GraphError, match="give one of the two"):
        made.set("w.weights", 0.1).check()
    with pytest.raises(runtime.GraphError, match="'w.post' is not connected"):
        made.without("second").check()
    with pytest.raises(runtime.SimulationError, match="the function has 2 components"):
        made.set("w.function", ["x[0]", "x[1]"]).run()
