"""Populations of neurons against nengo: five models, both engines, one run."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from typing import Any

import numpy as np

import blocks
import runtime
from benchmarks.agreement import DisagreementError
from benchmarks.contests import COMPILED, NENGO, NUMBA, PYTHON
from benchmarks.tables import Goal, figure
from benchmarks.timing import take_turns

DT = 0.001
ENGINES = {PYTHON: "python", COMPILED: "compiled"}
DIMENSIONS = 32


class Sine(blocks.Block):
    """A sine in each component, of another phase."""

    out = blocks.Output(blocks.Vector("size"))
    size: int = blocks.param(1, doc="length")

    def output(self, state: Any, t: float) -> Any:
        found = np.empty(self.size)
        for i in range(self.size):
            found[i] = 0.5 * np.sin(8.0 * t + i)
        return found


def channel() -> runtime.Graph:
    """100 neurons pass a sine on to 100 others."""
    graph = _graph("channel").add("x", Sine()).add("a", blocks.Ensemble(neurons=100))
    graph = graph.add("ab", blocks.Decoder()).add("b", blocks.Ensemble(neurons=100))
    graph = graph.add("out", blocks.Decoder(synapse=0.01)).connect("x.out", "a.input")
    graph = graph.connect("a.spikes", "ab.spikes").connect("ab.value", "b.input")
    return graph.connect("b.spikes", "out.spikes").probe("out.value")


def lorenz() -> runtime.Graph:
    """The Lorenz attractor in 2000 neurons."""
    function = [
        "0.1*10*(x[1] - x[0]) + x[0]",
        "0.1*(-x[0]*x[2] - x[1]) + x[1]",
        "0.1*(x[0]*x[1] - 8/3*(x[2] + 28) - 28) + x[2]",
    ]
    state = blocks.Ensemble(neurons=2000, radius=60, dimensions=3)
    graph = _graph("lorenz").add("state", state)
    graph = graph.add("back", blocks.Decoder(synapse=0.1, function=function))
    graph = graph.connect("back.value", "state.input").connect("state.spikes", "back.spikes")
    return graph.probe("back.value")


def learning() -> runtime.Graph:
    """10,000 neurons learn a communication channel by PES, from nothing."""
    graph = _graph("learning").add("x", Sine()).add("a", blocks.Ensemble(neurons=10_000))
    graph = graph.add("out", blocks.Decoder(function="0", synapse=0.01, learning="pes"))
    graph = graph.add("error", blocks.Sum(signs=[1, -1])).connect("x.out", "a.input")
    graph = graph.connect("a.spikes", "out.spikes").connect("out.value", "error.terms")
    graph = graph.connect("x.out", "error.terms").connect("error.out", "out.error")
    return graph.probe("out.value")


def convolution() -> runtime.Graph:
    """The circular convolution of two vectors of 32 numbers: products of their Fourier transforms.

    ab = (u^2 - v^2) / 2 with u, v = (a +- b) / sqrt(2), each square in a population of its own.
    """
    to_a, to_b, back = transforms(DIMENSIONS)
    half = np.sqrt(0.5)
    graph = _graph("convolution").add("x", Sine(size=DIMENSIONS)).add("y", Sine(size=DIMENSIONS))
    graph = graph.add("a", blocks.Gain(gain=half * np.vstack([to_a, to_a])))
    graph = graph.add("b", blocks.Gain(gain=half * np.vstack([to_b, -to_b])))
    graph = graph.add("squares", blocks.Ensemble(neurons=100, groups=2 * len(to_a), radius=2.0))
    graph = graph.add("squared", blocks.Decoder(function="x**2"))
    graph = graph.add("out", blocks.Gain(gain=0.5 * np.hstack([back, -back])))
    graph = graph.connect("x.out", "a.input").connect("y.out", "b.input")
    graph = graph.connect("a.out", "squares.input").connect("b.out", "squares.input")
    graph = graph.connect("squares.spikes", "squared.spikes")
    return graph.connect("squared.value", "out.input").probe("out.out")


def transforms(d: int) -> tuple[Any, Any, Any]:
    """Matrices to the factors of the products of two real Fourier transforms, and back."""
    frequencies = d // 2 + 1
    angles = 2.0 * np.pi * np.outer(np.arange(frequencies), np.arange(d)) / d
    real, imaginary = np.cos(angles), -np.sin(angles)
    to_a = np.vstack([real, imaginary, real, imaginary]) / np.sqrt(d)
    to_b = np.vstack([real, imaginary, imaginary, real]) / np.sqrt(d)
    weight = np.where((np.arange(frequencies) % (d // 2)) == 0, 1.0, 2.0)
    cosines, sines = weight * real.T, weight * imaginary.T
    return to_a, to_b, np.hstack([cosines, -cosines, sines, sines])


# Nuclei of the basal ganglia with the inputs where their neurons start to fire; and decoders: from,
# to, function, time constant (s).
NUCLEI = {"d1": 0.2, "d2": 0.2, "stn": -0.25, "gpe": -0.2, "gpi": -0.2}
PATHS = {
    "d1_gpi": ("d1", "gpi", "-(x - 0.2) if x > 0.2 else 0", 0.008),
    "d2_gpe": ("d2", "gpe", "-(x - 0.2) if x > 0.2 else 0", 0.008),
    "gpe_gpi": ("gpe", "gpi", "-0.3*(x + 0.2) if x > -0.2 else 0", 0.008),
    "gpe_stn": ("gpe", "stn", "-(x + 0.2) if x > -0.2 else 0", 0.008),
    "stn_out": ("stn", "", "0.9*(x + 0.25) if x > -0.25 else 0", 0.002),
    "out": ("gpi", "", "-3*(x + 0.2) if x > -0.2 else 0", 0.008),
}
ACTIONS = 10


def basal_ganglia() -> runtime.Graph:
    """Basal ganglia with ten actions, each population a block of its own: 50 of 50 neurons."""
    graph = _graph("basal_ganglia").add("x", Sine(size=ACTIONS))
    for i in range(ACTIONS):
        for name, start in NUCLEI.items():
            fires = f"uniform({start}, 0.99)"
            made = blocks.Ensemble(neurons=50, encoders=1, radius=1.5, intercepts=fires)
            graph = graph.add(f"{name}_{i}", made)
        for name, (source, target, function, synapse) in PATHS.items():
            made = blocks.Decoder(function=function, synapse=synapse)
            graph = graph.add(f"{name}_{i}", made)
            graph = graph.connect(f"{source}_{i}.spikes", f"{name}_{i}.spikes")
            if target:
                graph = graph.connect(f"{name}_{i}.value", f"{target}_{i}.input")
        for name, gain in (("d1", 1.2), ("d2", 0.8), ("stn", 1.0)):
            graph = graph.add(f"to_{name}_{i}", blocks.Gain(gain=gain))
            graph = graph.connect(f"x.out[{i}:{i + 1}]", f"to_{name}_{i}.input")
            graph = graph.connect(f"to_{name}_{i}.out", f"{name}_{i}.input")
    graph = graph.add("stn_all", blocks.Sum())
    for i in range(ACTIONS):
        graph = graph.connect(f"stn_out_{i}.value", "stn_all.terms").probe(f"out_{i}.value")
        for name in ("gpe", "gpi"):
            graph = graph.connect("stn_all.out", f"{name}_{i}.input")
    return graph


def _graph(name: str) -> runtime.Graph:
    return runtime.Graph(name, dt=DT, until=1.0)


def nengo_model(name: str) -> Any:
    """The same model in nengo, as its users write it."""
    import nengo

    with nengo.Network(seed=1) as model:
        size = {"convolution": DIMENSIONS, "basal_ganglia": ACTIONS}.get(name, 1)
        x = nengo.Node(lambda t: 0.5 * np.sin(8.0 * t + np.arange(size)))
        if name == "channel":
            a, b = nengo.Ensemble(100, 1), nengo.Ensemble(100, 1)
            nengo.Connection(x, a, synapse=None)
            nengo.Connection(a, b)
            nengo.Probe(b, synapse=0.01)
        elif name == "lorenz":
            state = nengo.Ensemble(2000, 3, radius=60)
            nengo.Connection(state, state, function=_lorenz, synapse=0.1)
            nengo.Probe(state, synapse=0.1)
        elif name == "learning":
            a, out, error = nengo.Ensemble(10_000, 1), nengo.Node(size_in=1), nengo.Node(size_in=1)
            solver = nengo.solvers.NoSolver(np.zeros((10_000, 1)))
            nengo.Connection(x, a, synapse=None)
            rule = nengo.PES(1e-4)
            learnt = nengo.Connection(a, out, synapse=0.01, solver=solver, learning_rule_type=rule)
            nengo.Connection(out, error, synapse=None)
            nengo.Connection(x, error, transform=-1, synapse=None)
            nengo.Connection(error, learnt.learning_rule, synapse=None)
            nengo.Probe(out)
        elif name == "basal_ganglia":
            network = nengo.networks.BasalGanglia(ACTIONS, n_neurons_per_ensemble=50)
            nengo.Connection(x, network.input, synapse=None)
            nengo.Probe(network.output)
        else:
            network = nengo.networks.CircularConvolution(200, DIMENSIONS)
            nengo.Connection(x, network.input_a, synapse=None)
            nengo.Connection(x, network.input_b, synapse=None)
            nengo.Probe(network.output)
    return model


def _lorenz(x: Any) -> list[float]:
    dx = 10 * (x[1] - x[0]), -x[0] * x[2] - x[1], x[0] * x[1] - 8 / 3 * (x[2] + 28) - 28
    return [0.1 * rate + value for rate, value in zip(dx, x, strict=True)]


MODELS: dict[str, tuple[Callable[[], runtime.Graph], int]] = {
    "channel": (channel, 4000),
    "lorenz": (lorenz, 2000),
    "learning": (learning, 1000),
    "convolution": (convolution, 400),
    "basal_ganglia": (basal_ganglia, 1000),
}


def run_ours(graph: runtime.Graph, engine: str, ticks: int) -> float:
    """Seconds for the ticks, without building."""
    result = graph.run(until=ticks * DT, engine=engine)
    return float(result.manifest["us_per_tick"]) * 1e-6 * ticks


def nengo_runner(name: str, ticks: int) -> Callable[[], float]:
    import nengo

    simulator = nengo.Simulator(nengo_model(name), progress_bar=False)

    def run() -> float:
        began = time.perf_counter()
        simulator.run_steps(ticks, progress_bar=False)
        return time.perf_counter() - began

    return run


def population() -> runtime.Graph:
    """One Ensemble of 10,000 LIF neurons, which represents a sine."""
    graph = _graph("population").add("x", Sine()).add("a", blocks.Ensemble(neurons=10_000))
    return graph.connect("x.out", "a.input").probe("x.out", every=10)


def by_hand(rounds: int, ticks: int) -> str:
    """The row and the goal of one population against a loop that knows nothing else.

    Raises
    ------
    DisagreementError : the voltages differ after all ticks.
    """
    from benchmarks.by_hand import numba_lif

    graph = population().set("run.until", ticks * DT).set("run.engine", "compiled").check()
    drawn = graph.set("run.engine", "python").set("run.until", DT)
    for state in ("scaled_encoders", "bias", "voltage"):
        drawn = drawn.probe(f"a.{state}", every=1)
    first = drawn.run()
    encoders, bias, voltage = (
        first[f"a.{state}"][0].ravel() for state in ("scaled_encoders", "bias", "voltage")
    )
    loop = partial(numba_lif, encoders, bias, voltage, DT, ticks)
    apart = float(np.abs(graph.run().states["a.voltage"] - loop()[1]).max())
    if apart > 1e-9:
        raise DisagreementError(f"voltages differ by {apart:.1g} from those of the loop by hand")
    runs = {COMPILED: partial(run_ours, graph, "compiled", ticks), NUMBA: lambda: loop()[0]}
    taken = take_turns(runs, rounds, ticks)
    cells = " | ".join(figure(taken[title], 1e6, "µs") for title in (COMPILED, NUMBA))
    ratio = taken[COMPILED].median / taken[NUMBA].median
    goal = Goal("one population: compiled engine against a numba loop by hand", ratio, most=1.3)
    head = f"\n| model | {COMPILED} | {NUMBA} |\n|---|---|---|\n"
    return f"{head}| {population.__doc__} | {cells} |\n\n{goal.line()}"


def section(rounds: int, quick: bool = False) -> str:
    """The section of docs/performance.md."""
    text = (
        "\n## Populations of neurons\n\nMicroseconds per tick of 1 ms; the ratio is to nengo.\n\n"
    )
    text += f"| model | {PYTHON} | {COMPILED} | {NENGO} |\n|---|---|---|---|\n"
    goals = []
    for name, (make, full) in MODELS.items():
        ticks = 50 if quick else full
        graph = make()
        runs: dict[str, Callable[[], float]] = {
            title: partial(run_ours, graph, engine, ticks) for title, engine in ENGINES.items()
        }
        if find_spec("nengo"):
            runs[NENGO] = nengo_runner(name, ticks)
        taken = take_turns(runs, rounds, ticks)
        cells = [
            figure(taken[title], 1e6, "µs") if title in taken else "" for title in (*ENGINES, NENGO)
        ]
        text += f"| {(make.__doc__ or name).splitlines()[0]} | {' | '.join(cells)} |\n"
        if NENGO in taken:
            medians = {title: each.median for title, each in taken.items()}
            goals += list(_goals(name, neurons_in(graph), medians))
    text += "\n" + "".join(goal.line() for goal in goals)
    return text + (by_hand(rounds, 50 if quick else 1000) if find_spec("numba") else "")


def neurons_in(graph: runtime.Graph) -> int:
    """The number of neurons of all populations."""
    network = graph.network
    made = {name: entry.block for name, entry in network.entries.items()}
    return sum(
        each.neurons * network.lengths[name]["groups"]
        for name, each in made.items()
        if isinstance(each, blocks.Ensemble)
    )


def _goals(name: str, neurons: int, medians: dict[str, float]) -> list[Goal]:
    """Python: 0.7 of nengo's time; compiled: 1/10, and 1/3 from 10,000 neurons on.

    Many small blocks are where an interpreter is slowest: nengo's time is then the goal.
    """
    theirs = medians[NENGO]
    title = f"{name}, {neurons:,} neurons"
    goal, most = ("1/3", 1.0 / 3.0) if neurons >= 10_000 else ("1/10", 0.1)
    return [
        Goal(
            f"{title}: Python engine, of nengo's time",
            medians[PYTHON] / theirs,
            most=1.0 if name == "basal_ganglia" else 0.7,
        ),
        Goal(
            f"{title}: compiled engine, {goal} of nengo's time",
            medians[COMPILED] / theirs,
            most=most,
        ),
    ]
