"""Nengo's examples as its documentation describes them; each returns the probe that is compared."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import nengo
import numpy as np
from nengo.dists import Choice, Uniform
from scipy.signal import cont2discrete

Model = Callable[[], nengo.Probe]
MODELS: dict[str, Model] = {}
# Several processes test at once; its cache on disk leaves files open when they meet.
nengo.rc["decoder_cache"]["enabled"] = "False"


def model(function: Model) -> Model:
    MODELS[function.__name__] = function
    return function


def sine() -> nengo.Node:
    return nengo.Node(lambda t: np.sin(8 * t))


def decoded(source: Any, synapse: float = 0.01) -> nengo.Probe:
    return nengo.Probe(source, synapse=synapse)


@model
def single_neuron() -> nengo.Probe:
    neuron = nengo.Ensemble(
        1, 1, intercepts=Uniform(-0.5, -0.5), max_rates=Uniform(100, 100), encoders=[[1]]
    )
    nengo.Connection(nengo.Node(lambda t: np.cos(8 * t)), neuron, synapse=None)
    return decoded(neuron, 0.1)


@model
def two_neurons() -> nengo.Probe:
    neurons = nengo.Ensemble(
        2, 1, intercepts=Uniform(-0.5, -0.5), max_rates=Uniform(100, 100), encoders=[[1], [-1]]
    )
    nengo.Connection(sine(), neurons, synapse=None)
    return decoded(neurons, 0.1)


@model
def many_neurons() -> nengo.Probe:
    neurons = nengo.Ensemble(100, 1)
    nengo.Connection(sine(), neurons, synapse=None)
    return decoded(neurons)


@model
def communication_channel() -> nengo.Probe:
    a, b = nengo.Ensemble(100, 1), nengo.Ensemble(100, 1)
    nengo.Connection(sine(), a, synapse=None)
    nengo.Connection(a, b)
    return decoded(b)


@model
def addition() -> nengo.Probe:
    a, b, c = (nengo.Ensemble(100, 1) for _ in range(3))
    nengo.Connection(nengo.Node(0.5), a, synapse=None)
    nengo.Connection(nengo.Node(0.3), b, synapse=None)
    nengo.Connection(a, c)
    nengo.Connection(b, c)
    return decoded(c)


@model
def squaring() -> nengo.Probe:
    a, b = nengo.Ensemble(100, 1), nengo.Ensemble(100, 1)
    nengo.Connection(sine(), a, synapse=None)
    nengo.Connection(a, b, function=np.square)
    return decoded(b)


@model
def multiplication() -> nengo.Probe:
    first = nengo.Node(lambda t: 0 if t < 1.25 else (10 if t < 1.75 else -10))
    second = nengo.Node(lambda t: 10 if t < 1 else 2)
    a, b = nengo.Ensemble(100, 1, radius=10), nengo.Ensemble(100, 1, radius=10)
    corners = Choice([[1, 1], [-1, 1], [1, -1], [-1, -1]])
    both = nengo.Ensemble(224, 2, radius=15, encoders=corners)
    d = nengo.Ensemble(100, 1, radius=100)
    nengo.Connection(first, a, synapse=None)
    nengo.Connection(second, b, synapse=None)
    nengo.Connection(a, both[0])
    nengo.Connection(b, both[1])
    nengo.Connection(both, d, function=lambda x: x[0] * x[1])
    return decoded(d)


@model
def combining() -> nengo.Probe:
    a, b, both = nengo.Ensemble(100, 1), nengo.Ensemble(100, 1), nengo.Ensemble(200, 2, radius=2)
    nengo.Connection(nengo.Node(np.sin), a, synapse=None)
    nengo.Connection(nengo.Node(np.cos), b, synapse=None)
    nengo.Connection(a, both[0])
    nengo.Connection(b, both[1])
    return decoded(both)


def circle() -> nengo.Node:
    return nengo.Node(lambda t: [np.sin(8 * t), np.cos(8 * t)])


@model
def two_dimensions() -> nengo.Probe:
    neurons = nengo.Ensemble(100, 2)
    nengo.Connection(circle(), neurons, synapse=None)
    return decoded(neurons)


@model
def integrator() -> nengo.Probe:
    steps = nengo.Node(lambda t: 0 if t < 0.2 else (1 if t < 1 else (0 if t < 2 else -2)))
    a = nengo.Ensemble(100, 1)
    nengo.Connection(a, a, synapse=0.1)
    nengo.Connection(steps, a, transform=0.1, synapse=0.1)
    return decoded(a)


@model
def oscillator() -> nengo.Probe:
    neurons = nengo.Ensemble(200, 2)
    kick = nengo.Node(lambda t: [1.0 if t < 0.1 else 0.0, 0.0])
    nengo.Connection(kick, neurons, synapse=None)
    nengo.Connection(neurons, neurons, transform=[[1, 1], [-1, 1]], synapse=0.1)
    return decoded(neurons, 0.1)


def pulses() -> nengo.Node:
    def value(t: float) -> list[float]:
        return [0.5 if 0.2 < t < 0.3 or 0.6 < t < 0.7 else (-1.0 if 1.0 < t < 1.1 else 0.0), 0.0]

    return nengo.Node(value)


def _controlled(control: float, function: Any) -> nengo.Probe:
    a = nengo.Ensemble(225, 2, radius=1.5)
    nengo.Connection(pulses(), a, synapse=0.1)
    nengo.Connection(nengo.Node([0.0, control]), a, synapse=None)
    nengo.Connection(a, a, function=function, synapse=0.1)
    return decoded(a)


@model
def controlled_integrator() -> nengo.Probe:
    return _controlled(1.0, lambda x: [x[0] * x[1], 0.0])


@model
def controlled_integrator2() -> nengo.Probe:
    return _controlled(0.0, lambda x: [x[0] * x[1] + x[0], 0.0])


@model
def controlled_oscillator() -> nengo.Probe:
    neurons = nengo.Ensemble(500, 3, radius=1.7)
    kick = nengo.Node(lambda t: [1.0 if t < 0.15 else 0.0, 0.0, 0.0])
    frequency = nengo.Node(lambda t: [0.0, 0.0, 1.0 if t < 1.5 else 0.5])
    nengo.Connection(kick, neurons, synapse=None)
    nengo.Connection(frequency, neurons, synapse=None)
    nengo.Connection(
        neurons,
        neurons,
        synapse=0.1,
        function=lambda x: [x[0] - x[2] * x[1], x[1] + x[2] * x[0], 0.0],
    )
    return decoded(neurons, 0.03)


@model
def lorenz_attractor() -> nengo.Probe:
    state = nengo.Ensemble(2000, 3, radius=60)

    def step(x: Any) -> list[float]:
        dx0 = 10 * (x[1] - x[0])
        dx1 = -x[0] * x[2] - x[1]
        dx2 = x[0] * x[1] - 8 / 3 * (x[2] + 28) - 28
        return [0.1 * dx0 + x[0], 0.1 * dx1 + x[1], 0.1 * dx2 + x[2]]

    nengo.Connection(state, state, function=step, synapse=0.1)
    return decoded(state, 0.1)


def _learning(n: int, d: int, zero: Any, wanted: Any) -> nengo.Probe:
    stimulus = nengo.Node(lambda t: [np.sin(3 * t), 0.8 * np.cos(2 * t)])
    pre, post = nengo.Ensemble(n, 2), nengo.Ensemble(60, d)
    error = nengo.Ensemble(60, d)
    nengo.Connection(stimulus, pre, synapse=None)
    learnt = nengo.Connection(pre, post, function=zero, learning_rule_type=nengo.PES(3e-4))
    nengo.Connection(post, error)
    nengo.Connection(pre, error, function=wanted, transform=-1)
    nengo.Connection(error, learnt.learning_rule)
    return decoded(post)


@model
def learn_communication_channel() -> nengo.Probe:
    return _learning(60, 2, lambda x: [0, 0], lambda x: x)


@model
def learn_square() -> nengo.Probe:
    return _learning(60, 2, lambda x: [0, 0], lambda x: x**2)


@model
def learn_product() -> nengo.Probe:
    return _learning(120, 1, lambda x: 0, lambda x: x[0] * x[1])


@model
def learn_unsupervised() -> nengo.Probe:
    pre, posts = nengo.Ensemble(20, 1), [nengo.Ensemble(20, 1) for _ in range(2)]
    nengo.Connection(sine(), pre, synapse=None)
    both = nengo.Node(size_in=2)
    for i, rule in enumerate((nengo.BCM(5e-10), nengo.Oja(6e-8))):
        solver = nengo.solvers.LstsqL2(weights=True)
        nengo.Connection(pre, posts[i], solver=solver, learning_rule_type=rule)
        nengo.Connection(posts[i], both[i], synapse=0.05)
    return decoded(both, None)


@model
def learn_associations() -> nengo.Probe:
    turn = 2.0 * np.pi / 5.0
    item = lambda t: int((t - 0.001) / 0.3 + 1e-9)  # noqa: E731
    key = nengo.Node(lambda t: [np.cos(turn * item(t)), np.sin(turn * item(t))])
    wanted = nengo.Node(
        lambda t: [
            *(0.8 * np.cos(2 * turn * item(t)), 0.8 * np.sin(2 * turn * item(t))),
            0.6 * np.cos(turn * item(t)),
        ]
    )
    still = nengo.Node(lambda t: -float(t > 3.0))
    memory = nengo.Ensemble(200, 2, intercepts=Choice([0.5]))
    voja = nengo.Voja(learning_rate=0.05, post_synapse=None)
    into = nengo.Connection(key, memory, synapse=None, learning_rule_type=voja)
    nengo.Connection(still, into.learning_rule, synapse=None)
    recall = nengo.Node(size_in=3)
    out = nengo.Connection(
        memory, recall, function=lambda x: np.zeros(3), learning_rule_type=nengo.PES(1e-3)
    )
    error = nengo.networks.EnsembleArray(200, 3)
    nengo.Connection(recall, error.input, synapse=None)
    nengo.Connection(wanted, error.input, transform=-1, synapse=None)
    nengo.Connection(error.output, out.learning_rule)
    for population in error.ea_ensembles:
        nengo.Connection(still, population.neurons, transform=10 * np.ones((200, 1)), synapse=None)
    return decoded(recall, None)


@model
def force_learning() -> nengo.Probe:
    pre, out, error = nengo.Ensemble(100, 1), nengo.Node(size_in=1), nengo.Node(size_in=1)
    target = sine()
    nengo.Connection(target, pre, synapse=None)
    learnt = nengo.Connection(
        pre, out, function=lambda x: 0, synapse=0.02, learning_rule_type=nengo.RLS(1e-3)
    )
    nengo.Connection(out, error, synapse=None)
    nengo.Connection(target, error, transform=-1, synapse=None)
    nengo.Connection(error, learnt.learning_rule, synapse=None)
    return nengo.Probe(out)


@model
def ensemble_array() -> nengo.Probe:
    array = nengo.networks.EnsembleArray(100, 2)
    both = nengo.Node(lambda t: [np.cos(8 * t), np.sin(8 * t)])
    nengo.Connection(both, array.input, synapse=None)
    return decoded(array.output)


@model
def matrix_multiplication() -> nengo.Probe:
    a, b = nengo.networks.EnsembleArray(100, 2), nengo.networks.EnsembleArray(100, 4)
    corners = Choice([[1, 1], [-1, 1], [1, -1], [-1, -1]])
    pairs = nengo.networks.EnsembleArray(200, 4, ens_dimensions=2, radius=1.4, encoders=corners)
    d = nengo.networks.EnsembleArray(100, 2)
    nengo.Connection(nengo.Node([0.5, -0.5]), a.input, synapse=None)
    nengo.Connection(nengo.Node([0.58, -1.0, 0.7, 0.1]), b.input, synapse=None)
    for j in range(2):
        for k in range(2):
            nengo.Connection(a.output[k], pairs.input[4 * j + 2 * k])
            nengo.Connection(b.output[2 * k + j], pairs.input[4 * j + 2 * k + 1])
    product = pairs.add_output("product", lambda x: x[0] * x[1])
    nengo.Connection(product, d.input, transform=[[1, 1, 0, 0], [0, 0, 1, 1]])
    return decoded(d.output)


@model
def inhibitory_gating() -> nengo.Probe:
    a, b, c = (nengo.Ensemble(30, 1) for _ in range(3))
    gate = nengo.Node(lambda t: 0 if t < 0.5 else (1 if t < 1 else (0 if t < 1.5 else 1)))
    nengo.Connection(sine(), a, synapse=None)
    nengo.Connection(gate, c, synapse=None)
    nengo.Connection(a, b)
    nengo.Connection(c, a.neurons, transform=[[-2.5]] * 30)
    return decoded(b)


@model
def izhikevich() -> nengo.Probe:
    neurons = nengo.Ensemble(
        100, 1, max_rates=Uniform(20, 35), neuron_type=nengo.Izhikevich(reset_recovery=0)
    )
    nengo.Connection(sine(), neurons, synapse=None)
    return decoded(neurons, 0.1)


@model
def delay_node() -> nengo.Probe:
    a, b = nengo.Ensemble(50, 1), nengo.Ensemble(50, 1)
    history = [np.zeros(1)] * 50

    def later(t: float, x: Any) -> Any:
        history.append(np.array(x))
        return history.pop(0)

    delay = nengo.Node(later, size_in=1)
    nengo.Connection(sine(), a, synapse=None)
    nengo.Connection(a, delay)
    nengo.Connection(delay, b, synapse=None)
    return decoded(b)


@model
def nef_algorithm() -> nengo.Probe:
    a = nengo.Ensemble(
        50,
        1,
        max_rates=Uniform(75, 100),
        intercepts=Uniform(-1, 0.95),
        encoders=Choice([[-1], [1]]),
    )
    out = nengo.Node(size_in=1)
    nengo.Connection(nengo.Node(lambda t: np.sin(2 * np.pi * t)), a, synapse=None)
    nengo.Connection(a, out, function=np.square, synapse=0.05)
    return nengo.Probe(out)


@model
def rates_and_functions() -> nengo.Probe:
    a, out = nengo.Ensemble(100, 1, neuron_type=nengo.LIFRate()), nengo.Node(size_in=2)
    nengo.Connection(sine(), a, synapse=None)
    nengo.Connection(a, out, function=lambda x: [x[0] ** 2, np.sin(3 * x[0])], synapse=0.01)
    return nengo.Probe(out)


@model
def integrator_network() -> nengo.Probe:
    steps = nengo.Node(lambda t: 0 if t < 0.2 else (1 if t < 1 else (0 if t < 2 else -2)))
    population = nengo.Ensemble(100, 1)
    nengo.Connection(population, population, synapse=0.1)
    nengo.Connection(steps, population, transform=0.1, synapse=0.1)
    return decoded(population)


@model
def product_network() -> nengo.Probe:
    network = nengo.networks.Product(200, 1)
    nengo.Connection(sine(), network.input_a, synapse=None)
    nengo.Connection(nengo.Node(lambda t: np.cos(3 * t)), network.input_b, synapse=None)
    return nengo.Probe(network.output, synapse=0.005)


@model
def basal_ganglia() -> nengo.Probe:
    def utilities(t: float) -> list[float]:
        second = 0.3 if t < 0.5 else (0.8 if t < 1 else 0.4)
        return [0.8 if t < 0.5 else 0.3, second, 0.2 if t < 1 else 0.9]

    network = nengo.networks.BasalGanglia(3)
    nengo.Connection(nengo.Node(utilities), network.input, synapse=None)
    return nengo.Probe(network.output, synapse=0.008)


@model
def rectified_linear() -> nengo.Probe:
    neurons = nengo.Ensemble(
        60, 1, neuron_type=nengo.SpikingRectifiedLinear(), max_rates=Uniform(250, 300)
    )
    nengo.Connection(sine(), neurons, synapse=None)
    return decoded(neurons, 0.02)


@model
def processes() -> nengo.Probe:
    signal = nengo.Node(nengo.processes.WhiteSignal(2.0, high=5.0, rms=0.5))
    neurons, error = nengo.Ensemble(100, 1), nengo.Node(lambda t, x: x**2, size_in=1)
    nengo.Connection(signal, neurons, synapse=None)
    nengo.Connection(neurons, error, synapse=0.01)
    nengo.Connection(signal, error, synapse=0.01, transform=-1)
    return nengo.Probe(error)


@model
def tuning_curves() -> nengo.Probe:
    circle = nengo.Node(lambda t: [np.sin(8 * t), np.cos(8 * t)])
    two = nengo.Ensemble(100, 2, intercepts=Uniform(-0.3, 0.3))
    nengo.Connection(circle, two, synapse=None)
    return decoded(two, 0.02)


@model
def functions_and_tuning_curves() -> nengo.Probe:
    ramp, out = nengo.Node(lambda t: t - 1.0), nengo.Node(size_in=2)
    plain = nengo.Ensemble(150, 1)
    fitting = nengo.Ensemble(150, 1, encoders=Choice([[1]]), intercepts=Uniform(-0.05, 0.2))
    for i, ensemble in enumerate((plain, fitting)):
        nengo.Connection(ramp, ensemble, synapse=None)
        nengo.Connection(ensemble, out[i], function=lambda x: float(x[0] > 0.0), synapse=0.005)
    return nengo.Probe(out)


@model
def nef_summary() -> nengo.Probe:
    a, b, c = nengo.Ensemble(100, 1), nengo.Ensemble(100, 1), nengo.Ensemble(200, 1)
    out = nengo.Node(size_in=3)
    sine = nengo.Node(lambda t: 0.9 * np.sin(2 * np.pi * t))
    nengo.Connection(sine, a, synapse=None)
    nengo.Connection(a, b, function=np.square, synapse=0.01)
    nengo.Connection(a, c, transform=0.4, synapse=0.1)
    nengo.Connection(c, c, transform=0.8, synapse=0.1)
    for i, ensemble in enumerate((a, b, c)):
        nengo.Connection(ensemble, out[i], synapse=0.03)
    return nengo.Probe(out)


class _LegendreMemory:
    """The memory with a window of 1 s, discretised for inputs that hold."""

    def __init__(self, order: int, dt: float) -> None:
        i = np.arange(order)
        rates = 2.0 * i + 1.0
        signs = np.where(i[:, None] < i, -1.0, (-1.0) ** (i[:, None] - i + 1.0))
        a, b = rates[:, None] * signs, rates * (-1.0) ** i
        self.a, self.b, *_ = cont2discrete((a, b[:, None], np.eye(order), np.zeros((order, 1))), dt)
        self.state = np.zeros(order)

    def __call__(self, t: float, x: Any) -> Any:
        self.state = self.a @ self.state + self.b[:, 0] * x[0]
        return self.state


@model
def lmu() -> nengo.Probe:
    def value(t: float) -> float:
        return float(0.4 * np.sin(np.pi * t) + 0.3 * np.sin(3 * np.pi * t + 1.0))

    signal, memory = nengo.Node(value), nengo.Node(_LegendreMemory(6, 0.001), size_in=1)
    delayed = nengo.Node(lambda t: value(t - 0.5) if t >= 0.5 else 0.0)
    neurons, out = nengo.Ensemble(200, 6), nengo.Node(size_in=1)
    error = nengo.Node(lambda t, x: x if t < 4.0 else 0.0 * x, size_in=1)
    nengo.Connection(signal, memory, synapse=None)
    nengo.Connection(memory, neurons, synapse=None)
    learnt = nengo.Connection(
        *(neurons, out), function=lambda x: 0.0, synapse=0.005, learning_rule_type=nengo.RLS(0.01)
    )
    nengo.Connection(out, error, synapse=None)
    nengo.Connection(delayed, error, transform=-1, synapse=None)
    nengo.Connection(error, learnt.learning_rule, synapse=None)
    return decoded(out)
