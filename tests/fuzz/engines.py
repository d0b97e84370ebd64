"""Random graphs of shipped blocks do the same under both engines.

Blocks are added one after another; each input takes an output that fits, or a new source of its
type, or a ``UnitDelay`` that is wired to a later output in the end and so closes a loop. Numbers
and seeds are arguments of compiled text, but every other graph is another plan to compile, which
takes seconds: so the same graph runs with several seeds.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

import numpy as np
from hypothesis import reject
from hypothesis import strategies as st

import runtime
from blocks.core.block import Block
from blocks.core.params import ParameterError
from blocks.core.signals import Pose, Same, Scalar, SignalType, Twist
from blocks.library.index import TYPES
from blocks.library.registry import BUILTIN
from runtime.document.node import dump_yaml
from runtime.errors import GraphError, SimulationError
from runtime.solvers import SOLVERS
from tests.blocks.direct import REQUIRED
from tests.fuzz.campaign import Record, campaign

EXPLICIT = [name for name, method in SOLVERS.items() if not method.is_implicit]
TITLE = "Both engines"
WHAT = (
    "Random well-typed graphs of shipped blocks, with loops, two rates, continuous states, every "
    "solver and random parameters, run under the Python engine and the compiled engine for 200 "
    "ticks."
)
HOLDS = (
    "All recorded signals are equal to 1e-12, spikes exactly; a run that fails does so in the same "
    "block and port, at the same tick, with the same recording before."
)
PORT = re.compile(r"output '(\w+)' is not finite")
TICKS = 200
TOLERANCE = 1e-12
DT = 0.01
ROOM = {"room": [[-3, -3], [3, -3], [3, 3], [-3, 3]], "circles": [[1.5, 1.0, 0.3]]}
SWITCHES = ("Enable", "Trigger")  # they need a part around them
# How many numbers go into their inputs, as their matrices in ``REQUIRED`` say.
COUNTS: dict[str, dict[str, int]] = {
    "KalmanFilter": {"measurement": 1, "stamp": 1},
    "ExtendedKalmanFilter": {"measurement": 1, "control": 1, "stamp": 1},
    "SteadyStateKalman": {"measurement": 2, "control": 2},
    "DiscreteSteadyStateKalman": {"measurement": 2, "control": 2},
    "LinearDisturbanceObserver": {"measurement": 1, "control": 1},
    "LinearQuadraticRegulator": {"states": 2},
    "LinearMPC": {"states": 2},
    "LinearL1": {"states": 2},
}
SIZES: dict[str, int] = {"samples": 150, "beams": 24, "neurons": 8, "wall_points": 20}
# Blocks that give a signal of a type from nothing, or from what can be had from nothing.
SOURCES: dict[str, tuple[str, str]] = {
    "Scalar": ("Constant", "value"),
    "Vector": ("Constant", "value"),
    "Twist": ("Constant", "value"),
    "Pose": ("DifferentialDrive", "pose"),
    "WheelSpeeds": ("DifferentialDrive", "wheels"),
    "TrackingState": ("TrackingError", "state"),
    "Path": ("SinePath", "path"),
    "Scan": ("Lidar", "scan"),
}
LOOPS, LOOPED = ("loop0", "loop1"), ("Scalar", "Twist", "Pose")
NUMBERS = st.sampled_from([0.0, 0.5, 1.0, -1.0, 0.1, 2.0, -0.3])


@dataclass(frozen=True)
class Case:
    """A graph, as a mapping, and the seed of its run."""

    graph: dict[str, Any]
    seed: int

    def __repr__(self) -> str:
        return f"# seed {self.seed}\n{dump_yaml(self.graph)}"


class Grower:
    """Grows a graph block by block; knows the type of every output."""

    def __init__(self, draw: st.DrawFn) -> None:
        self.draw = draw
        self.blocks: dict[str, dict[str, Any]] = {}
        self.wires: dict[str, dict[str, Any]] = {}
        self.outputs: dict[str, SignalType] = {}
        self.loops: dict[str, SignalType] = {}
        self.dimensions: dict[str, int] = {}  # of each Ensemble

    def switched(self, kind: str) -> str:
        """A part with one block that an Enable or a Trigger switches."""
        name = f"b{len(self.blocks)}"
        held = ["UnitDelay", "Gain", "DiscreteIntegrator"]
        # A Trigger runs single ticks, between which nothing is integrated.
        flowing = ["Integrator", "Derivative"] if kind == "Enable" else []
        inside = self.draw(st.sampled_from([*held, *flowing]))
        needed = {"Gain": {"gain": 2.0}, "Derivative": {"tau": 0.05}}.get(inside, {})
        entry: dict[str, Any] = {"type": kind}
        for parameter, declared in BUILTIN[kind].spec.params.items():
            entry[parameter] = self.draw(st.sampled_from(declared.choices))
        self.blocks[name] = {
            "inputs": {"gate": "Scalar", "x": "Scalar"},
            "outputs": {"out": "inner.out"},
            "blocks": {"switch": entry, "inner": {"type": inside, **needed}},
            "wires": {"switch": {"input": "inputs.gate"}, "inner": {"input": "inputs.x"}},
        }
        self.wires[name] = {"gate": self.output_of(Scalar), "x": self.output_of(Scalar)}
        self.outputs[f"{name}.out"] = Scalar
        return name

    def add(self, kind: str, **given: SignalType) -> str:
        """A block with all its inputs wired; ``given`` settles type variables."""
        if kind in SWITCHES:
            return self.switched(kind)
        cls = BUILTIN[kind]
        name = f"b{len(self.blocks)}"
        entry: dict[str, Any] = {"type": kind, **self.parameters(cls, given)}
        if self.draw(st.integers(0, 4)) == 0 and not cls.spec.continuous:
            entry["dt"] = 5 * DT
        self.blocks[name] = entry
        made = constructed(cls, entry)
        own = {} if made is None else made.variables
        variables = given | {key: kind for key, kind in own.items() if not kind.symbol}
        # What the parameters settle, as those of a linear system.
        lengths = SIZES | ({} if made is None else made.sizes())
        if kind == "InverseFourierTransform":
            lengths["m"] = 1 + self.small()
        wires: dict[str, Any] = {}
        for port, declared in cls.spec.inputs.items():
            if declared.default is not None and self.draw(st.booleans()):
                continue
            kind_of = declared.type if made is None else made.port_type(port)
            if port == "spikes":  # what an Ensemble publishes with them is needed, too
                population = self.add("Ensemble")
                wires[port] = f"{population}.spikes"
                lengths |= {"n": SIZES["neurons"], "k": self.dimensions[population]}
                lengths["m"] = len(entry.get("weights", ()))
                continue
            if declared.optional and port in ("error", "post") and "learning" not in entry:
                continue
            if port == "control" and port not in COUNTS.get(kind, {"control": 1}):
                continue
            if isinstance(kind_of, Same) and kind in COUNTS:
                wanted = Scalar
            elif isinstance(kind_of, Same):
                wanted = variables.setdefault(kind_of.variable, self.some_type())
            elif kind_of.symbol in lengths:
                wanted = kind_of.sized(lengths[str(kind_of.symbol)])
            elif kind_of.symbol:
                size = SIZES["samples"] if kind_of.name == "Path" else self.small()
                wanted = kind_of.sized(lengths.setdefault(kind_of.symbol, size))
            else:
                wanted = kind_of
            if declared.variadic:
                number = len(entry["signs"]) if "signs" in entry else self.draw(st.integers(1, 3))
                number = COUNTS.get(kind, {}).get(port, number)
                wires[port] = [self.output_of(wanted) for _ in range(number)]
                if declared.spread:
                    lengths[declared.spread] = number
            else:
                wires[port] = self.output_of(wanted)
        if wires:
            self.wires[name] = wires
        lengths |= {} if made is None else made.infer(lengths)
        if kind == "Ensemble":
            self.dimensions[name] = lengths["d"]
        for port, out in cls.spec.outputs.items():
            kind_of = out.type if made is None else made.port_type(port)
            if isinstance(kind_of, Same):
                kind_of = variables.setdefault(kind_of.variable, Scalar)
            self.outputs[f"{name}.{port}"] = (
                kind_of.sized(lengths[str(kind_of.symbol)]) if kind_of.symbol else kind_of
            )
        return name

    def small(self) -> int:
        return self.draw(st.integers(1, 3))

    def some_type(self) -> SignalType:
        """The type of an output that there is, or a common one."""
        usual = [kind for kind in self.outputs.values() if kind.finite]
        return self.draw(st.sampled_from([*usual, Scalar, Pose, Twist]))

    def output_of(self, kind: SignalType) -> str:
        """An address that gives signals of a type."""
        fitting = [name for name, made in self.outputs.items() if made == kind]
        way = self.draw(st.sampled_from(["there", "there", "there", "loop", "new"]))
        if fitting and way == "there":
            return self.draw(st.sampled_from(fitting))
        if way == "loop" and len(self.loops) < len(LOOPS) and kind.name in LOOPED:
            name = LOOPS[len(self.loops)]
            self.blocks[name] = {"type": self.draw(st.sampled_from(["UnitDelay", "Integrator"]))}
            self.loops[name] = kind
            return f"{name}.out"
        if kind.name not in SOURCES:  # such as spikes, which come from a population only
            if not fitting:
                reject()
            return self.draw(st.sampled_from(fitting))
        source, port = SOURCES[kind.name]
        name = self.add(source, T=kind) if source == "Constant" else self.add(source)
        return f"{name}.{port}"

    def parameters(self, cls: type[Block], given: dict[str, SignalType]) -> dict[str, Any]:
        """Required parameters, sizes that keep runs short, and some others."""
        found: dict[str, Any] = {}
        for name, declared in cls.spec.params.items():
            if name in SIZES:
                found[name] = SIZES[name]
            elif declared.choices:
                found[name] = self.draw(st.sampled_from(declared.choices))
            elif declared.required and declared.kind == "float":
                found[name] = self.draw(st.sampled_from([0.05, 0.3, 2.0]))
        for name, value in REQUIRED.get(cls.__name__, {}).items():
            # A Decoder's weights are for one size of population, and it has others without.
            if cls.spec.params[name].required or cls.__name__ in (*COUNTS, "Select"):
                found.setdefault(name, value)
        if "tau_ref" in cls.spec.params:  # spikes need a step below it, and rates below its inverse
            found.update(tau_ref=0.06, max_rates=[5.0, 12.0])
        if cls.__name__ == "AlgebraicConstraint":
            found.update(low=-1e3, high=1e3)
        if cls.__name__ == "Decoder" and self.draw(st.booleans()):
            found["learning"] = {"rule": "pes", "learning_rate": 1e-3}
        if "low" in found and "high" in found:
            found["low"], found["high"] = sorted((found["low"], found["high"]))
        if cls.__name__ == "Broadcast":
            found["n"] = self.small()
        if cls.__name__ == "Butterworth" and found["band"].startswith("band"):
            found["cutoff"] = [2.0, 5.0]
        if cls.__name__ == "WhiteSignal":
            found.update(period=1.0, high=5.0)
        if cls.__name__ == "Weights":
            rows, columns = self.small(), SIZES["neurons"]
            found["weights"] = [
                [0.1 * ((i + j) % 5 - 2) for j in range(columns)] for i in range(rows)
            ]
        if cls.__name__.endswith("Ensemble") and "neuron" in cls.spec.params:
            found.update(neuron={"type": "LIF", "tau_ref": 0.06}, max_rates="uniform(5, 12)")
        if cls.__name__ == "Constant":
            kind = given["T"]
            values = [self.draw(NUMBERS) for _ in range(int(np.prod(kind.shape)))]
            found = {"signal": kind.name, "value": values if kind.shape else values[0]}
        elif cls.__name__ == "WaypointPath":
            found["points"] = [[0, 0], [1, 0.5], [2, 0], [3, 1], [4, 0]]
        elif cls.__name__ == "Sum":
            signs = self.draw(st.lists(st.sampled_from([1, -1]), min_size=1, max_size=3))
            found["signs"] = signs
        elif cls.__name__ == "Gain":
            found["gain"] = self.draw(st.sampled_from([0.5, -0.9, 1.5]))
        elif cls.__name__ == "DifferentialDrive":
            found["body_radius"] = self.draw(st.sampled_from([0.0, 0.2]))
        return found

    def close(self) -> None:
        """Wire each delay of a loop to something of its type."""
        for name in LOOPS:  # wiring one may add the other
            if name not in self.loops:
                continue
            kind = self.loops[name]
            fitting = [a for a, made in self.outputs.items() if made == kind]
            if not fitting:
                source, port = SOURCES[kind.name]
                made = self.add(source, T=kind) if source == "Constant" else self.add(source)
                fitting = [f"{made}.{port}"]
            self.wires[name] = {"input": self.draw(st.sampled_from(fitting))}


def constructed(cls: type[Block], entry: dict[str, Any]) -> Block | None:
    """The block of an entry; None if its parameters are wrong."""
    try:
        return cls(**{key: value for key, value in entry.items() if key not in ("type", "dt")})
    except ParameterError:
        return None


@st.composite
def graphs(draw: st.DrawFn, most: int = 5, kinds: tuple[str, ...] = ()) -> Case:
    """A graph of up to ``most`` drawn blocks, beside what these need as sources."""
    grower = Grower(draw)
    there = sorted(kinds or TYPES)
    for kind in draw(st.lists(st.sampled_from(there), min_size=1, max_size=most)):
        if kind == "Constant":
            grower.add(kind, T=Scalar)
        else:
            grower.add(kind)
    grower.close()
    probes = {address.replace(".", "_"): address for address in grower.outputs}
    graph = {
        "graph": "random",
        "run": {"dt": DT, "until": TICKS * DT, "solver": draw(st.sampled_from(EXPLICIT))},
        "world": ROOM,
        "blocks": grower.blocks,
        "wires": grower.wires,
        "probes": probes,
    }
    return Case(graph, draw(st.integers(0, 2)))


def check(case: Case) -> str:
    """Run a graph under both engines; returns how it ended."""
    try:
        graph = runtime.load(case.graph).check()
    except GraphError as error:
        usual = (
            *("is open; wire a typed signal", "algebraic loop"),
            *("a record or a vector, got Path", "'not' takes one input"),
        )
        assert all(any(u in p.text for u in usual) for p in error.problems), str(error)
        return "refused"
    return compare(graph, case.seed)


def compare(graph: runtime.Graph, seed: int) -> str:
    """Hold the engines against each other on one graph."""
    ended = []
    for engine in ("python", "compiled"):
        try:
            ended.append((graph.run(seed=seed, engine=engine), None))
        except SimulationError as error:
            port = PORT.search(str(error))
            ended.append((error.result, (error.block, port and port[1], error.tick)))
    (a, failed), (b, failed_too) = ended
    assert failed == failed_too, f"python: {failed}, compiled: {failed_too}"
    for name, recorded in a.probes.items():
        x, y = recorded.values, b.probes[name].values
        assert x.shape == y.shape, name
        if "Spikes" in " ".join(recorded.kinds):
            assert np.array_equal(x, y), name
        np.testing.assert_allclose(y, x, rtol=TOLERANCE, atol=TOLERANCE, err_msg=name)
    return "failed alike" if failed else "equal"


def run(examples: int, seed: int) -> Record:
    """Try graphs; shrinking would compile hundreds more."""
    return campaign("engines", graphs(), check, examples, seed, shrink=False)
