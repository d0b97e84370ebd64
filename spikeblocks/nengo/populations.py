"""Ensembles, synapses and rules of Nengo as entries of a graph.

In: an ensemble of a network and what its simulator drew. Out: plain values, with arrays for what
was drawn, or distributions where neurons are to be drawn anew::

    {type: Ensemble, neurons: 50, radius: 2.0, gain: <array 50 ...>, ...}
"""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np
from scipy.signal import cont2discrete

from runtime.errors import UsageError
from spikeblocks.nengo.attributes import is_exactly, number, only_reads
from spikeblocks.nengo.flow import Population

# Parameters of an ensemble that are read; its points of evaluation are in what was solved.
READ = {
    *("n_neurons", "dimensions", "radius", "encoders", "intercepts", "max_rates", "gain", "bias"),
    *("eval_points", "n_eval_points", "neuron_type", "noise", "normalize_encoders"),
}
# Our model for each of Nengo's, and our parameters for its attributes.
MODELS: dict[str, tuple[str, dict[str, str]]] = {
    "LIF": ("LIF", {"tau_rc": "tau_rc", "tau_ref": "tau_ref", "min_voltage": "min_voltage"}),
    "LIFRate": ("LIFRate", {"tau_rc": "tau_rc", "tau_ref": "tau_ref"}),
    "RectifiedLinear": ("ReLU", {}),
    "SpikingRectifiedLinear": ("SpikingReLU", {}),
    "Sigmoid": ("Sigmoid", {"tau_ref": "tau_ref"}),
    "Tanh": ("Tanh", {"tau_ref": "tau_ref"}),
}
MODELS["AdaptiveLIF"] = ("AdaptiveLIF", {**MODELS["LIF"][1], "tau_n": "tau_n", "inc_n": "inc_n"})
MODELS["AdaptiveLIFRate"] = (
    "AdaptiveLIFRate",
    {**MODELS["LIFRate"][1], "tau_n": "tau_n", "inc_n": "inc_n"},
)
MODELS["Izhikevich"] = (
    "Izhikevich",
    {name: name for name in ("tau_recovery", "coupling", "reset_voltage", "reset_recovery")},
)
EMISSIONS = (
    (nengo.RegularSpiking, "regular"),
    (nengo.StochasticSpiking, "stochastic"),
    (nengo.PoissonSpiking, "poisson"),
)
RULES = {
    "PES": ("pes", {"learning_rate": "learning_rate", "tau": "pre_synapse"}),
    "RLS": ("rls", {"learning_rate": "learning_rate", "tau": "pre_synapse"}),
    "Voja": ("voja", {"learning_rate": "learning_rate", "tau": "post_synapse"}),
    "BCM": (
        "bcm",
        {
            "learning_rate": "learning_rate",
            "tau": "pre_synapse",
            "post_tau": "post_synapse",
            "theta_tau": "theta_synapse",
        },
    ),
    "Oja": (
        "oja",
        {
            "learning_rate": "learning_rate",
            "tau": "pre_synapse",
            "post_tau": "post_synapse",
            "beta": "beta",
        },
    ),
}
# States of Nengo's neurons, and our names of their first values.
STATES = {
    "voltage": "voltage",
    "refractory_time": "refractory",
    "adaptation": "recovery",
    "recovery": "recovery",
}


def synapse_entry(synapse: Any, dt: float) -> Any:
    """A synapse as a Decoder takes it."""
    if synapse is None:
        return "none"
    if is_exactly(synapse, nengo.synapses.Triangle):
        only_reads(synapse, "t")
        return f"triangle({number(synapse.t)})"
    kinds = (nengo.Lowpass, nengo.Alpha, nengo.LinearFilter)
    if not is_exactly(synapse, *kinds):
        known = "a Lowpass, Alpha, Triangle or LinearFilter"
        raise UsageError(f"{synapse!r} is not read; expected {known}")
    only_reads(synapse, "tau", "num", "den", "analog", "method")
    exact = synapse.analog and synapse.method == "zoh"
    if exact and is_exactly(synapse, nengo.Lowpass):
        return float(synapse.tau) if synapse.tau > 0.0 else "none"
    if exact and is_exactly(synapse, nengo.Alpha):
        return f"alpha({number(synapse.tau)})"
    num, den = np.asarray(synapse.num, dtype=float), np.asarray(synapse.den, dtype=float)
    if len(den) == 1:
        raise UsageError(f"{synapse!r} is a gain, which is not read; put it into the transform")
    if synapse.analog and not exact:
        # By another rule than that of a graph, which takes the result for its step.
        num, den, _ = cont2discrete((num, den), dt, method=synapse.method)
        num = np.ravel(num)
    first = int(np.flatnonzero(num)[0]) if num.any() else len(num) - 1
    entry = {"type": "linear", "num": num[first:].tolist(), "den": den.tolist()}
    return entry if exact else {**entry, "discrete": True}


def neuron_entry(neuron: Any) -> Any:
    """A neuron model, with the parameters that differ from the model's own."""
    emission = next((word for kind, word in EMISSIONS if is_exactly(neuron, kind)), "")
    base = neuron.base_type if emission else neuron
    name = type(base).__name__
    if name not in MODELS or not is_exactly(base, getattr(nengo, name)):
        raise UsageError(f"{neuron!r} is not read; expected one of {', '.join(MODELS)}")
    kind, names = MODELS[name]
    if emission:
        only_reads(neuron, "base_type", "amplitude", "initial_state")
        only_reads(base, *names.values(), "amplitude", "initial_state")
    else:
        only_reads(neuron, *names.values(), "amplitude", "initial_state")
    default = type(base)()
    entry: dict[str, Any] = {
        ours: float(getattr(base, theirs))
        for ours, theirs in names.items()
        if getattr(base, theirs) != getattr(default, theirs)
    }
    if emission:
        if getattr(base, "amplitude", 1) != 1:
            raise UsageError(f"{neuron!r} is not read; give the spikes an amplitude, not the rates")
        entry["spikes"] = emission
    if getattr(neuron, "amplitude", 1) != 1:
        entry["amplitude"] = float(neuron.amplitude)
    return {"type": kind, **entry} if entry else kind


def noise_entry(process: Any, dt: float) -> dict[str, Any]:
    """The noise of an ensemble, and its filter.

    Nengo divides what is drawn by the root of the step, or with ``scale=False`` does not.
    """
    kinds = (nengo.processes.WhiteNoise, nengo.processes.FilteredNoise)
    if not is_exactly(process, *kinds):
        known = "WhiteNoise or FilteredNoise"
        raise UsageError(f"{process!r} is not read as noise of an ensemble; expected {known}")
    only_reads(process, "dist", "scale", "synapse")
    only_reads(process.dist, "mean", "std", "low", "high", "scale", "shift", "options")
    root = 1.0 if process.scale else float(np.sqrt(dt))
    dists, drawn = nengo.dists, process.dist
    if isinstance(drawn, dists.Gaussian):
        drawn = dists.Gaussian(drawn.mean * root, drawn.std * root)
    elif isinstance(drawn, dists.Uniform):
        drawn = dists.Uniform(drawn.low * root, drawn.high * root)
    elif isinstance(drawn, dists.Exponential):
        drawn = dists.Exponential(drawn.scale * root, drawn.shift * root, drawn.high * root)
    elif isinstance(drawn, dists.Choice) and np.size(drawn.options) == 1:
        return {"noise": float(np.ravel(drawn.options)[0]) * root} | _noise_synapse(process, dt)
    else:
        raise UsageError(f"{drawn!r} is not read as noise of an ensemble")
    return {"noise": distribution_entry(drawn)} | _noise_synapse(process, dt)


def _noise_synapse(process: Any, dt: float) -> dict[str, Any]:
    synapse = synapse_entry(getattr(process, "synapse", None), dt)
    return {} if synapse == "none" else {"noise_synapse": synapse}


def rule_entry(rule: Any, dt: float) -> dict[str, Any]:
    """A rule of learning."""
    name = type(rule).__name__
    if name not in RULES or not is_exactly(rule, getattr(nengo, name)):
        raise UsageError(f"{rule!r} is not read; expected one of {', '.join(RULES)}")
    label, names = RULES[name]
    only_reads(rule, "size_in", *names.values())
    entry: dict[str, Any] = {"rule": label}
    for ours, theirs in names.items():
        value = getattr(rule, theirs)
        if ours == "post_tau" and value is None:
            continue  # that of the other side
        entry[ours] = synapse_entry(value, dt) if ours.endswith("tau") else float(value)
    return entry


def rule_entries(rules: list[Any], dt: float) -> Any:
    """The rules of one connection, or of one ensemble, that add up."""
    entries = [rule_entry(rule, dt) for rule in rules]
    return entries if len(entries) > 1 else entries[0]


def ensemble_entry(population: Population, simulator: Any, redraw: bool) -> dict[str, Any]:
    """One block for all members."""
    first, groups = population.first, population.groups
    entry: dict[str, Any] = {"type": "Ensemble", "neurons": int(first.n_neurons)}
    if first.dimensions * groups > 1:
        entry["dimensions"] = int(first.dimensions * groups)
    if groups > 1:
        entry["groups"] = groups
    if first.radius != 1.0:
        entry["radius"] = float(first.radius)
    neuron = neuron_entry(first.neuron_type)
    if neuron != "LIF":
        entry["neuron"] = neuron
    if first.noise is not None:
        entry |= noise_entry(first.noise, simulator.dt)
    if not first.normalize_encoders:
        entry["normalize"] = False
    only_reads(first, *READ)
    if redraw:
        return entry | _distributions(first)
    built = [simulator.data[member] for member in population.members]
    for name, attribute in (("gain", "gain"), ("bias", "bias"), ("encoders", "encoders")):
        entry[name] = np.concatenate([np.asarray(getattr(b, attribute), float) for b in built])
    for theirs, ours in STATES.items():
        begin = [simulator.model.sig[m.neurons].get(theirs) for m in population.members]
        if all(each is not None for each in begin):
            values = np.concatenate([np.asarray(b.initial_value, float) for b in begin])
            if ours == "voltage" or values.any():
                entry[ours] = values
    return entry


DISTRIBUTIONS = {
    nengo.dists.Uniform: ("uniform", ("low", "high")),
    nengo.dists.Gaussian: ("normal", ("mean", "std")),
    nengo.dists.Exponential: ("exponential", ("scale", "shift", "high")),
}


def _distributions(ensemble: Any) -> dict[str, Any]:
    """The distributions that an ensemble gives; those that it leaves to Nengo are ours as well."""
    only_reads(ensemble, *(READ - {"eval_points", "n_eval_points"}))
    entry: dict[str, Any] = {}
    names = ["max_rates", "intercepts", "encoders", "gain", "bias"]
    for name in names:
        value = getattr(ensemble, name)
        default = getattr(nengo.Ensemble, name).default
        if value is not None and (isinstance(value, np.ndarray) or value != default):
            entry[name] = distribution_entry(value)
    given = (getattr(ensemble.neuron_type, "base_type", None), ensemble.neuron_type)
    for neuron in filter(None, given):
        for theirs, value in (neuron.initial_state or {}).items():
            entry[STATES[theirs]] = distribution_entry(value)
    return entry


def distribution_entry(value: Any) -> Any:
    """Numbers, or a distribution, as a parameter of an Ensemble takes them."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return np.asarray(value, dtype=float)
    dists = nengo.dists
    for kind, (name, arguments) in DISTRIBUTIONS.items():
        if is_exactly(value, kind):
            only_reads(value, *arguments)
            given = [getattr(value, each) for each in arguments]
            shown = [number(each) for each in given if np.isfinite(each)]
            return f"{name}({', '.join(shown)})"
    if is_exactly(value, dists.Choice):
        only_reads(value, "options")
        options = np.asarray(value.options, dtype=float)
        options = options[:, 0] if options.ndim == 2 and options.shape[1] == 1 else options
        return f"choice({options.tolist()})"
    if is_exactly(value, dists.CosineSimilarity):
        return f"cosine({value.dimensions})"
    if is_exactly(value, dists.ScatteredHypersphere, dists.UniformHypersphere):
        only_reads(value, "surface")
        return "sphere" if value.surface else "ball"
    raise UsageError(f"{value!r} is not read as a distribution")


SOLVERS = {
    "LstsqL2": "l2",
    "LstsqL2nz": "l2_nz",
    "LstsqNoise": "l2_noise",
    "Nnls": "nnls",
    "NnlsL2": "nnls_l2",
    "NnlsL2nz": "nnls_l2_nz",
    "LstsqL1": "lasso",
}


def solver_entry(solver: Any) -> Any:
    """A solver of decoders; None for the default."""
    name = type(solver).__name__
    if name not in SOLVERS or not is_exactly(solver, getattr(nengo.solvers, name)):
        raise UsageError(f"{solver!r} is not read; expected one of {', '.join(SOLVERS)}")
    only_reads(solver, "weights", "reg", "noise", "l1", "l2")
    given = {n: float(getattr(solver, n)) for n in ("reg", "noise", "l1", "l2") if
             isinstance(getattr(solver, n, None), (int, float))}  # fmt: skip
    default = type(solver)()
    given = {n: v for n, v in given.items() if v != getattr(default, n)}
    if not given and SOLVERS[name] == "l2":
        return None
    return {"type": SOLVERS[name], **given} if given else SOLVERS[name]
