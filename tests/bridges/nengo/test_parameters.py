"""Each parameter of each public class of Nengo is read, or refused by name, when it is set.

``python -m tests.bridges.nengo.test_parameters`` writes the counts into docs/coming-from-nengo.md.
"""

from __future__ import annotations

import inspect
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

nengo = pytest.importorskip("nengo")

from nengo import dists, processes, solvers  # noqa: E402
from nengo.params import Parameter  # noqa: E402

from runtime.errors import UsageError  # noqa: E402
from spikeblocks.nengo.importing import import_network, is_equal  # noqa: E402

PAGE = Path(__file__).parents[3] / "docs" / "coming-from-nengo.md"
BEGIN, END = "<!-- begin: Nengo's parameters -->\n", "<!-- end: Nengo's parameters -->\n"
ROOMS = {
    "objects": nengo,
    "neurons": nengo.neurons,
    "synapses": nengo.synapses,
    "learning rules": nengo.learning_rules,
    "distributions": dists,
    "processes": processes,
    "solvers": solvers,
    "transforms": nengo.transforms,
    "networks": nengo.networks,
}
# Classes of which no object is made, and data of a transform.
BASES = {
    *("Process", "NeuronType", "RatesToSpikesNeuronType", "Synapse", "LearningRuleType"),
    *("Solver", "SparseMatrix"),
}
UNTIL, D = 0.03, dists
UNIFORM = D.Uniform(-0.9, 0.8)
DEFAULTS = {"default_dt": 0.002, "default_size_in": 1, "default_size_out": 1, "seed": 5}
NEURON: dict[str, Any] = {
    **{"amplitude": 0.7, "tau_rc": 0.03, "tau_ref": 0.003, "min_voltage": -0.5},
    **{"tau_n": 0.5, "inc_n": 0.02, "tau_recovery": 0.03, "coupling": 0.25},
    **{"reset_voltage": -60.0, "reset_recovery": 7.0, "base_type": nengo.LIFRate(tau_rc=0.03)},
}
# A value for each parameter that is not its default, by class and name, or by name alone.
VALUES: dict[str, Any] = {
    **DEFAULTS,
    **NEURON,
    **{"label": "named", "seed": 9, "learning_rate": 3e-4, "beta": 0.5, "size_in": 2},
    **{"pre_synapse": nengo.Alpha(0.0123456789), "post_synapse": 0.02, "theta_synapse": 0.1},
    **{"tau": 0.0123456789, "t": 0.004, "num": [1.0, 2.0], "den": [1e-4, 0.03, 1.0]},
    **{"analog": False, "method": "bilinear", "synapse": 0.0123456789},
    **{"low": -0.987654321, "high": 0.987654321, "integer": True, "mean": 0.1, "std": 0.2},
    **{"scale": 0.5, "shift": -0.5, "surface": True, "min_magnitude": 0.3, "m": 3, "n": 4},
    **{"base": D.QuasirandomSequence(), "options": [0.3, -0.6], "weights": True},
    **{"samples": np.linspace(-0.5, 0.5, 20)[:, None], "p": [0.5, 0.5], "x": [-0.5, 0.5]},
    **{"dist": D.Gaussian(0.1, 0.2), "period": 0.5, "high": 20.0, "rms": 0.3, "y0": 0.1},
    **{"inputs": [[0.5], [-0.5]], "presentation_time": 0.01, "data": {0.0: [0.0], 0.01: [0.5]}},
    **{"interpolation": "linear", "reg": 0.2, "noise": 0.2, "l1": 1e-3, "l2": 1e-5, "drop": 0.5},
    **{"rcond": 0.1, "solver": solvers.lstsq.SVD(), "solver1": solvers.LstsqL2(reg=0.3)},
    **{"solver2": solvers.LstsqL2(reg=0.3), "values": np.full((20, 2), 1e-3)},
    **{"kernel_size": (2, 2), "strides": (2, 2), "padding": "same", "channels_last": False},
    **{"groups": 1, "init": D.Uniform(-0.5, 0.5), "n_filters": 3},
}
VALUES |= {
    "Ensemble.n_neurons": 25,
    "Ensemble.dimensions": 2,
    "Ensemble.radius": 1.5,
    "Ensemble.encoders": D.Choice([[1.0, 0.0], [0.0, -1.0]]),
    "Ensemble.intercepts": UNIFORM,
    "Ensemble.max_rates": D.Uniform(100, 180),
    "Ensemble.eval_points": D.Uniform(-0.5, 0.5),
    "Ensemble.n_eval_points": 77,
    "Ensemble.neuron_type": nengo.LIFRate(),
    "Ensemble.gain": D.Uniform(1, 2),
    "Ensemble.bias": D.Uniform(0, 1),
    "Ensemble.noise": processes.WhiteNoise(D.Choice([[0.01] * 20])),
    "Ensemble.normalize_encoders": False,
    "Connection.synapse": nengo.Triangle(0.0043219),
    "Connection.function_info": lambda x: x**2,
    "Connection.transform": [[0.5, 0.1], [0.0, -0.3]],
    "Connection.solver": solvers.LstsqL2(reg=0.3),
    "Connection.learning_rule_type": nengo.PES(),
    "Connection.eval_points": D.Uniform(-0.5, 0.5),
    "Connection.scale_eval_points": False,
    "Connection.pre": "pre",
    "Connection.post": "post",
    "Node.output": lambda t: [np.sin(30 * t), 0.1],
    "Node.size_in": 2,
    "Node.size_out": 2,
    "Probe.attr": "input",
    "Probe.sample_every": 0.004,
    "Probe.solver": solvers.LstsqL2(reg=0.5),
    "Probe.synapse": 0.0123456789,
    "Probe.target": "neurons",
    "Exponential.high": 0.9,
    "Choice.weights": [0.25, 0.75],
    "WhiteSignal.high": 30.0,
    "Uniform.high": 0.987654321,
    "WhiteNoise.scale": False,
    "FilteredNoise.scale": False,
    "ScatteredHypersphere.method": "sct",
    "ConvolutionTranspose.output_shape": (3, 3, 2),
    "Convolution.input_shape": (3, 3, 2),
    "ConvolutionTranspose.input_shape": (2, 2, 1),
    "Dense.shape": (2, 2),
    "Dense.init": [[0.5, 0.1], [0.0, -0.3]],
    "Sparse.shape": (2, 2),
    "Sparse.init": [0.4, -0.6],
    "LinearFilter.analog": False,
    "Alpha.num": None,
}
STATES = {
    "voltage": D.Uniform(0.2, 0.7),
    "refractory_time": D.Uniform(0, 0.004),
    "adaptation": D.Uniform(0, 20),
    "recovery": D.Uniform(-5, 5),
}
# What a class needs beside the parameter that is set.
NEEDED: dict[str, dict[str, Any]] = {
    "PoissonSpiking": {"base_type": nengo.LIFRate()},
    "RegularSpiking": {"base_type": nengo.LIFRate()},
    "StochasticSpiking": {"base_type": nengo.LIFRate()},
    "Lowpass": {"tau": 0.01},
    "Alpha": {"tau": 0.01},
    "LinearFilter": {"num": [1.0], "den": [0.02, 1.0]},
    "Triangle": {"t": 0.003},
    "Uniform": {"low": -1.0, "high": 0.9},
    "Gaussian": {"mean": 0.0, "std": 0.1},
    "Exponential": {"scale": 0.2, "shift": -0.9, "high": 0.95},
    "Choice": {"options": [0.3, -0.7]},
    "PDF": {"x": [-0.5, 0.0, 0.5], "p": [0.3, 0.4, 0.3]},
    "Samples": {"samples": np.linspace(-0.5, 0.5, 20)[:, None]},
    "SqrtBeta": {"n": 3},
    "SubvectorLength": {"dimensions": 5},
    "CosineSimilarity": {"dimensions": 5},
    "WhiteSignal": {"period": 1.0, "high": 20.0},
    "PresentInput": {"inputs": [[0.1], [0.2]], "presentation_time": 0.02},
    "Piecewise": {"data": {0.0: [0.1], 0.01: [0.3]}},
    "FilteredNoise": {"synapse": nengo.Lowpass(0.01)},
    "NoSolver": {"values": np.full((20, 2), 2e-3)},
    "Convolution": {"n_filters": 2, "input_shape": (3, 3, 1)},
    "ConvolutionTranspose": {"n_filters": 2, "input_shape": (2, 2, 2)},
    "Dense": {"shape": (2, 2)},
    "Sparse": {"shape": (2, 2), "indices": [[0, 0], [1, 1]], "init": [0.5, 0.7]},
    "AssociativeMemory": {"input_vectors": np.eye(2)},
    "BasalGanglia": {"dimensions": 2, "n_neurons_per_ensemble": 20},
    "Thalamus": {"dimensions": 2, "n_neurons_per_ensemble": 20},
    "CircularConvolution": {"n_neurons": 10, "dimensions": 2},
    "EnsembleArray": {"n_neurons": 10, "n_ensembles": 2},
    "Product": {"n_neurons": 10, "dimensions": 2},
    "InputGatedMemory": {"n_neurons": 10, "dimensions": 2},
}
# Another constructor has these, and objects with them are of another class.
NOT_GIVEN = {
    **{key: {"num", "den"} for key in ("Alpha", "Lowpass")},
    **{key: {"n", "m"} for key in ("SubvectorLength", "CosineSimilarity")},
    "BrownNoise": {"synapse", "scale"},
}


def classes() -> Iterator[tuple[str, type]]:
    """The public classes with parameters, each in the room that it is named in last."""
    found: dict[type, str] = {}
    for room, module in ROOMS.items():
        names = getattr(module, "__all__", None) or [n for n in vars(module) if n[0] != "_"]
        for name in names:
            kind = getattr(module, name)
            if inspect.isclass(kind) and kind.__module__.startswith("nengo."):
                found[kind] = room
    for kind, room in found.items():
        if parameters(kind) and kind.__name__ not in BASES:
            yield room, kind


def parameters(kind: type) -> list[str]:
    """Those that Nengo declares, and the others that a constructor takes."""
    declared = {n for n in dir(kind) if isinstance(inspect.getattr_static(kind, n), Parameter)}
    return sorted(declared - NOT_GIVEN.get(kind.__name__, set()))


def network(kind: type, name: str, value: Any) -> Any:
    """A network in which an object of this class has this value."""
    given = {**NEEDED.get(kind.__name__, {}), name: value}
    with nengo.Network(seed=3) as made:
        u = nengo.Node(lambda t: [np.sin(30 * t), np.cos(20 * t)])
        if issubclass(kind, nengo.Network):
            part = kind(**given)
            with part:
                inside = part.all_ensembles[0] if part.all_ensembles else nengo.Ensemble(20, 1)
            ends = [n for n in part.nodes if n.size_in]
            nengo.Connection(u[0], ends[0][0] if ends else inside)
            nengo.Probe(inside.neurons)
        elif kind in (nengo.Ensemble, nengo.Connection, nengo.Node, nengo.Probe):
            _object(kind, name, value, u)
        else:
            _within(kind(**given), u)
    return made


def _object(kind: type, name: str, value: Any, u: Any) -> None:
    """A network of two ensembles, in which one object has the value."""

    def options(of: type) -> dict[str, Any]:
        given = {} if of is not kind else {name: value}
        if "function_info" in given:
            given["function"] = given.pop("function_info")
        if "gain" in given or "bias" in given:
            given = {"gain": D.Uniform(1, 2), "bias": D.Uniform(0, 1)}
        return given

    first = {"n_neurons": 20, "dimensions": 2, **options(nengo.Ensemble)}
    a = nengo.Ensemble(**first)
    b = nengo.Ensemble(20, 2)
    if kind is nengo.Node:
        how = options(nengo.Node)
        node = nengo.Node(**({"output": lambda t, *x: [0.3, t], **how}))
        nengo.Connection(node, b)
    nengo.Connection(u, a)
    how = options(nengo.Connection)
    ends = {"pre": a.neurons if name == "pre" else a, "post": b.neurons if name == "post" else b}
    how = {k: v for k, v in how.items() if k not in ends}
    if name in ("pre", "post"):
        how["transform"] = np.full((ends["post"].size_in, ends["pre"].size_out), 1e-3)
    made = nengo.Connection(ends["pre"], ends["post"], **how)
    if "learning_rule_type" in how:
        nengo.Connection(b, made.learning_rule)
    how = options(nengo.Probe)
    target = b.neurons if how.pop("target", None) else b
    nengo.Probe(target, **{"synapse": 0.01, **how})


def _within(made: Any, u: Any) -> None:
    """Where an object of this kind is used."""
    how: dict[str, Any] = {}
    if isinstance(made, nengo.neurons.NeuronType):
        how = {"neuron_type": made, "max_rates": D.Uniform(210, 290)}
    elif isinstance(made, dists.Distribution):
        how = {"intercepts": made}
        if isinstance(made, (dists.UniformHypersphere, dists.ScatteredHypersphere)):
            how = {"encoders": made}
    elif isinstance(made, processes.WhiteNoise):
        how = {"noise": made}
    a, b = nengo.Ensemble(20, 2, **how), nengo.Ensemble(20, 2)
    synapse = made if isinstance(made, nengo.synapses.Synapse) else 0.01
    nengo.Connection(u, a, synapse=synapse)
    if isinstance(made, nengo.learning_rules.LearningRuleType):
        unsupervised = isinstance(made, (nengo.BCM, nengo.Oja))
        weights = np.random.default_rng(1).normal(0, 1e-3, (20, 20))
        ends = (a.neurons, b.neurons, weights) if unsupervised else (a, b, 1)
        link = nengo.Connection(*ends[:2], transform=ends[2], learning_rule_type=made)
        if isinstance(made, (nengo.PES, nengo.RLS)):
            nengo.Connection(b, link.learning_rule)
        nengo.Probe(link, "weights")
    elif isinstance(made, nengo.transforms.Transform):
        size = made.size_out
        out = nengo.Node(size_in=size)
        nengo.Connection(nengo.Node(np.linspace(-1, 1, made.size_in)), out, transform=made)
        nengo.Probe(out)
    elif isinstance(made, nengo.Process) and not isinstance(made, nengo.synapses.Synapse):
        node = nengo.Node(made, size_out=1)
        nengo.Connection(node, b[0])
        nengo.Probe(node)
    else:
        solver = made if isinstance(made, solvers.Solver) else solvers.LstsqL2()
        nengo.Connection(a, b, synapse=synapse, solver=solver, transform=np.eye(2))
    nengo.Probe(b, synapse=0.01)
    nengo.Probe(a.neurons)


def values_of(kind: Any, name: str) -> list[Any]:
    if name == "initial_state":
        known = [state for state in kind.state if state in STATES]
        return [{state: STATES[state]} for state in known] or [{}]
    key = f"{kind.__name__}.{name}"
    if key in VALUES or name in VALUES:
        return [VALUES.get(key, VALUES.get(name))]
    raise AssertionError(f"a new parameter, {key}: give it a value in VALUES")


def outcome(kind: type, name: str, folder: Path) -> str:
    """mapped: import and Nengo compute the same; refused: by the name of parameter or class."""
    found = set()
    for value in values_of(kind, name):
        try:
            made = network(kind, name, value)
            nengo.Simulator(made, progress_bar=False).close()
        except Exception as error:  # noqa: BLE001 -- whatever Nengo says of such a value
            found.add(f"not possible in Nengo ({error})")
            continue
        try:
            done = import_network(made, folder / "my.yaml", until=UNTIL)
        except UsageError as error:
            assert name in str(error) or kind.__name__ in str(error), str(error)
            found.add("refused")
            continue
        differs = {k: v for k, v in done.compare(engine="python").items() if not is_equal(v)}
        found.add(f"differs: {differs}" if differs else "mapped")
    return " and ".join(sorted(found))


CASES = [(room, kind, name) for room, kind in classes() for name in parameters(kind)]
# What is drawn in each step is drawn from another generator: equal in distribution alone.
DRAWN = {"PoissonSpiking", "StochasticSpiking", "WhiteNoise", "FilteredNoise"}


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "name"), [c[1:] for c in CASES], ids=str)
def test_each_parameter_is_read_or_refused(kind: type, name: str, tmp_path: Path) -> None:
    told = outcome(kind, name, tmp_path)
    if kind.__name__ in DRAWN and told.startswith("differs"):
        return
    assert told in ("mapped", "refused") or told.startswith("not possible"), told


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"eval_points": D.Uniform(-0.5, 0.5)}, "its eval_points is not read"),
        ({"n_eval_points": 77}, "its n_eval_points is not read"),
        ({"intercepts": D.Uniform(-1, 1, integer=True)}, "its integer is not read"),
        ({"intercepts": D.Choice([0.1, 0.2], weights=[0.3, 0.7])}, "its weights is not read"),
        ({"encoders": D.UniformHypersphere(min_magnitude=0.5)}, "its min_magnitude is not read"),
        ({"max_rates": D.Samples(np.full((20, 1), 100.0))}, "is not read as a distribution"),
    ],
    ids=lambda given: str(*given) if isinstance(given, dict) else "",
)
def test_neurons_that_cannot_be_drawn_alike_are_refused(
    tmp_path: Path, given: Any, expected: str
) -> None:
    made = network(nengo.Ensemble, *next(iter(given.items())))
    with pytest.raises(UsageError, match=expected):
        import_network(made, tmp_path / "my.yaml", redraw=True)


def test_numbers_of_distributions_and_synapses_have_all_digits(tmp_path: Path) -> None:
    first = {"adaptation": D.Uniform(0, 1.23456789012)}
    with nengo.Network(seed=1) as made:
        a = nengo.Ensemble(20, 1, neuron_type=nengo.AdaptiveLIF(initial_state=first))
        nengo.Connection(a, a, synapse=nengo.Alpha(0.0123456789012))
    text = import_network(made, tmp_path / "my.yaml", redraw=True).files[0].read_text("utf-8")
    assert 'recovery: "uniform(0, 1.23456789012)"' in text
    assert "alpha(0.0123456789012)" in text


def test_a_class_of_ones_own_is_refused(tmp_path: Path) -> None:
    class Lowpass(nengo.Lowpass):  # type: ignore[name-defined, misc]
        """Computes otherwise, for all that is known."""

        def make_step(self, *arguments: Any, **named: Any) -> Any:
            return super().make_step(*arguments, **named)

    with nengo.Network() as made:
        a = nengo.Ensemble(20, 1)
        nengo.Connection(a, a, synapse=Lowpass(0.1))
    with pytest.raises(UsageError, match="is not read; expected a Lowpass"):
        import_network(made, tmp_path / "my.yaml")


def table(rows: Callable[[type, str], str]) -> str:
    counts: dict[str, Counter[str]] = {}
    for room, kind, name in CASES:
        counts.setdefault(room, Counter())[rows(kind, name)] += 1
    words = ("mapped", "in distribution", "refused", "not possible")
    lines = ["| parameters of | " + " | ".join(words) + " |", "|---|" + "---|" * len(words)]
    for room, found in [*counts.items(), ("all", sum(counts.values(), Counter()))]:
        lines.append(f"| {room} | " + " | ".join(str(found[word]) for word in words) + " |")
    return "\n".join(lines) + "\n"


def word(kind: type, name: str) -> str:
    with tempfile.TemporaryDirectory() as folder:
        told = outcome(kind, name, Path(folder))
    if told.startswith("differs") and kind.__name__ in DRAWN:
        return "in distribution"
    return "not possible" if told.startswith("not possible") else told


def main() -> None:
    """Write the counts, and say each outcome."""

    def said(kind: type, name: str) -> str:
        told = word(kind, name)
        print(f"{kind.__name__}.{name}: {told}", file=sys.stderr)
        return told

    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    after = rest.partition(END)[2]
    PAGE.write_text(before + BEGIN + table(said) + END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
