"""Ensembles, synapses and rules of Nengo as entries of a graph.

In: an ensemble of a network and what its simulator drew. Out: plain values, with arrays for what
was drawn, or distributions where neurons are to be drawn anew::

    {type: Ensemble, neurons: 50, radius: 2.0, gain: <array 50 ...>, ...}
"""

from __future__ import annotations

from typing import Any

import nengo
import numpy as np

from runtime.errors import UsageError
from runtime.nengo.flow import Population

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
        {"learning_rate": "learning_rate", "tau": "pre_synapse", "theta_tau": "theta_synapse"},
    ),
    "Oja": ("oja", {"learning_rate": "learning_rate", "tau": "pre_synapse", "beta": "beta"}),
}


def synapse_entry(synapse: Any) -> Any:
    """A synapse as a Decoder takes it."""
    if synapse is None:
        return "none"
    if isinstance(synapse, nengo.Lowpass):
        return float(synapse.tau) if synapse.tau > 0.0 else "none"
    if isinstance(synapse, nengo.Alpha):
        return f"alpha({synapse.tau:g})"
    if isinstance(synapse, nengo.Triangle):
        return f"triangle({synapse.t:g})"
    if isinstance(synapse, nengo.LinearFilter):
        num, den = (np.asarray(each, dtype=float).tolist() for each in (synapse.num, synapse.den))
        if len(den) == 1:
            raise UsageError(f"{synapse!r} is a gain, which is not read; put it into the transform")
        discrete = {} if synapse.analog else {"discrete": True}
        return {"type": "linear", "num": num, "den": den, **discrete}
    raise UsageError(
        f"{synapse!r} is not read; expected a Lowpass, Alpha, Triangle or LinearFilter"
    )


def neuron_entry(neuron: Any) -> Any:
    """A neuron model, with the parameters that differ from the model's own."""
    emission = next((word for kind, word in EMISSIONS if isinstance(neuron, kind)), "")
    base = neuron.base_type if emission else neuron
    name = type(base).__name__
    if name not in MODELS:
        raise UsageError(f"{neuron!r} is not read; expected one of {', '.join(MODELS)}")
    kind, names = MODELS[name]
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
    if not isinstance(process, kinds):
        known = "WhiteNoise or FilteredNoise"
        raise UsageError(f"{process!r} is not read as noise of an ensemble; expected {known}")
    root = 1.0 if process.scale else float(np.sqrt(dt))
    dists, drawn = nengo.dists, process.dist
    if isinstance(drawn, dists.Gaussian):
        drawn = dists.Gaussian(drawn.mean * root, drawn.std * root)
    elif isinstance(drawn, dists.Uniform):
        drawn = dists.Uniform(drawn.low * root, drawn.high * root)
    elif isinstance(drawn, dists.Exponential):
        drawn = dists.Exponential(drawn.scale * root, drawn.shift * root, drawn.high * root)
    elif isinstance(drawn, dists.Choice) and np.size(drawn.options) == 1:
        return {"noise": float(np.ravel(drawn.options)[0]) * root} | _noise_synapse(process)
    else:
        raise UsageError(f"{drawn!r} is not read as noise of an ensemble")
    return {"noise": distribution_entry(drawn)} | _noise_synapse(process)


def _noise_synapse(process: Any) -> dict[str, Any]:
    synapse = synapse_entry(getattr(process, "synapse", None))
    return {} if synapse == "none" else {"noise_synapse": synapse}


def rule_entry(rule: Any) -> dict[str, Any]:
    """A rule of learning."""
    name = type(rule).__name__
    if name not in RULES:
        raise UsageError(f"{rule!r} is not read; expected one of {', '.join(RULES)}")
    label, names = RULES[name]
    entry: dict[str, Any] = {"rule": label}
    for ours, theirs in names.items():
        value = getattr(rule, theirs)
        if ours.endswith("tau"):
            value = 0.0 if value is None or value == nengo.Lowpass(0) else synapse_entry(value)
            if not isinstance(value, float):
                raise UsageError(f"{rule!r}: its {theirs} is not read; expected a Lowpass")
        entry[ours] = value if ours.endswith("tau") else float(value)
    return entry


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
    if redraw:
        return entry | _distributions(first)
    built = [simulator.data[member] for member in population.members]
    for name, attribute in (("gain", "gain"), ("bias", "bias"), ("encoders", "encoders")):
        entry[name] = np.concatenate([np.asarray(getattr(b, attribute), float) for b in built])
    voltages = [simulator.model.sig[m.neurons].get("voltage") for m in population.members]
    if all(v is not None for v in voltages):
        entry["voltage"] = np.concatenate([np.asarray(v.initial_value, float) for v in voltages])
    return entry


def _distributions(ensemble: Any) -> dict[str, Any]:
    """The distributions that an ensemble gives; those that it leaves to Nengo are ours as well."""
    entry: dict[str, Any] = {}
    names = ["max_rates", "intercepts", "encoders", "gain", "bias"]
    for name in names:
        value = getattr(ensemble, name)
        default = getattr(nengo.Ensemble, name).default
        if value is not None and (isinstance(value, np.ndarray) or value != default):
            entry[name] = distribution_entry(value)
    return entry


def distribution_entry(value: Any) -> Any:
    """Numbers, or a distribution, as a parameter of an Ensemble takes them."""
    if isinstance(value, (list, tuple, np.ndarray)):
        return np.asarray(value, dtype=float)
    dists = nengo.dists
    if isinstance(value, dists.Uniform):
        return f"uniform({value.low:g}, {value.high:g})"
    if isinstance(value, dists.Gaussian):
        return f"normal({value.mean:g}, {value.std:g})"
    if isinstance(value, dists.Exponential):
        return f"exponential({value.scale:g}, {value.shift:g}, {value.high:g})"
    if isinstance(value, dists.Choice):
        options = np.asarray(value.options, dtype=float)
        options = options[:, 0] if options.ndim == 2 and options.shape[1] == 1 else options
        return f"choice({options.tolist()})"
    if isinstance(value, dists.CosineSimilarity):
        return f"cosine({value.dimensions})"
    if isinstance(value, (dists.ScatteredHypersphere, dists.UniformHypersphere)):
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
    if name not in SOLVERS:
        raise UsageError(f"{solver!r} is not read; expected one of {', '.join(SOLVERS)}")
    given = {n: float(getattr(solver, n)) for n in ("reg", "noise", "l1", "l2") if
             isinstance(getattr(solver, n, None), (int, float))}  # fmt: skip
    default = type(solver)()
    given = {n: v for n, v in given.items() if v != getattr(default, n)}
    if not given and SOLVERS[name] == "l2":
        return None
    return {"type": SOLVERS[name], **given} if given else SOLVERS[name]
