"""A Nengo network as blocks, wires and probes of a graph.

In: a network, with the names of its objects. Out: :class:`Converted`, plain values with NumPy
arrays, texts for comments and for an own Python file, and notes about what differs::

    convert(network, names, Options(dt=0.001, until=1.0)).blocks["a"]
    # {'type': 'Ensemble', 'neurons': 50, 'gain': array([...]), ...}
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.nengo import nodes
from runtime.nengo.decoding import Probed, between_neurons, decoder_entry
from runtime.nengo.flow import (
    Computed,
    Decoded,
    Filtered,
    Flow,
    NodeOutput,
    Population,
    Source,
    Terms,
    is_direct,
    is_full,
)
from runtime.nengo.populations import ensemble_entry, rule_entry, synapse_entry


@dataclass(frozen=True)
class Options:
    """How to convert: dt and until (s), a seed of the network, whether neurons are drawn anew."""

    dt: float = 0.001
    until: float = 1.0
    seed: int | None = None
    redraw: bool = False


@dataclass
class Converted:
    """What a graph consists of.

    late : for each probe how many ticks later its row is that of Nengo's probe.
    spikes : for each ensemble's block the members, in order.
    """

    blocks: dict[str, dict[str, Any]] = field(default_factory=dict)
    wires: dict[str, dict[str, Any]] = field(default_factory=dict)
    probes: dict[str, Any] = field(default_factory=dict)
    comments: dict[str, str] = field(default_factory=dict)
    classes: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    tables: dict[str, FloatArray] = field(default_factory=dict)
    late: dict[str, tuple[Any, int]] = field(default_factory=dict)
    populations: dict[str, Population] = field(default_factory=dict)


def convert(network: Any, names: dict[Any, str], options: Options) -> Converted:
    """Convert a network, which is built for it.

    Raises
    ------
    UsageError : it contains what graphs do not have; the message names it.
    """
    simulator = nengo.Simulator(
        network, dt=options.dt, seed=options.seed, progress_bar=False, optimize=False
    )
    try:
        return _Conversion(network, names, options, simulator).whole()
    finally:
        simulator.close()


class _Conversion:
    def __init__(self, network: Any, names: dict[Any, str], options: Options, simulator: Any):
        self.network, self.names, self.options = network, names, options
        self.simulator, self.result = simulator, Converted()
        self.flow = Flow(network, simulator)
        self.addresses: dict[Any, str] = {}
        self.unrecorded: list[Any] = []

    def whole(self) -> Converted:
        for population in self.flow.populations:
            self.population(population)
        for population in self.flow.populations:
            self.inputs(population)
        for probe in self.network.all_probes:
            self.probe(probe)
        for node in self.network.all_nodes:
            if node.size_in and node.output is not None and node not in self.addresses:
                self.base(self.flow.sources.setdefault(node, NodeOutput(node, node.size_out)))
        self.tables()
        return self.result

    def add(self, name: str, entry: dict[str, Any], comment: str = "") -> str:
        """A block under a name that no other has."""
        unique, number = name, 2
        while unique in self.result.blocks:
            unique, number = f"{name}{number}", number + 1
        self.result.blocks[unique] = entry
        if comment:
            self.result.comments[unique] = comment
        return unique

    # Populations

    def population(self, population: Population) -> None:
        first = population.first
        array = self.flow.array_of.get(first)
        population.name = self.names[first if population.groups == 1 else array]
        entry = ensemble_entry(population, self.simulator, self.options.redraw)
        population.name = self.add(population.name, entry)
        self.result.populations[population.name] = population

    def inputs(self, population: Population) -> None:
        entry = self.result.blocks[population.name]
        terms = self.flow.into_population(population)
        if terms:
            self.wire(population.name, "input", terms)
        else:
            entry["dimensions"] = population.first.dimensions * population.groups
        currents = self.flow.into_population(population, neurons=True)
        if currents:
            self.wire(population.name, "current", currents)
        for each in self.network.all_connections:
            rule = each.learning_rule_type
            if isinstance(rule, nengo.Voja) and each.post_obj is population.first:
                entry["learning"] = rule_entry(rule)
                factor = self.flow.into(each.learning_rule)
                if factor:
                    # Nengo's signal is added to 1: -1 stops learning.
                    name = self.add(f"{population.name}_learn", {"type": "Function"})
                    self.result.blocks[name]["expression"] = "1 + u"
                    self.wire(name, "u", factor)
                    self.result.wires.setdefault(population.name, {})["learn"] = f"{name}.out"

    def wire(self, consumer: str, port: str, terms: Terms) -> None:
        sources = [self.term(source, matrix, consumer) for source, matrix in terms]
        self.result.wires.setdefault(consumer, {})[port] = (
            sources if len(sources) > 1 else sources[0]
        )

    # Sources

    def term(self, source: Source, matrix: FloatArray, consumer: str) -> str:
        """The address of a matrix times a source."""
        key = (source, matrix.shape, matrix.tobytes())
        if key not in self.addresses:
            self.addresses[key] = self._term(source, matrix, consumer)
        return self.addresses[key]

    def _term(self, source: Source, matrix: FloatArray, consumer: str) -> str:
        square = matrix.shape[0] == matrix.shape[1]
        is_number = square and np.array_equal(matrix, matrix[0, 0] * np.eye(len(matrix)))
        if is_number and matrix[0, 0] == 1.0:
            return self.base(source, consumer)
        if isinstance(source, Decoded) and source.scales and (is_number or source.is_single):
            return self.decoder(source, consumer, matrix)
        is_constant = isinstance(source, NodeOutput) and isinstance(source.node.output, np.ndarray)
        if isinstance(source, NodeOutput) and is_constant and not is_number:
            value = matrix @ np.atleast_1d(source.node.output)
            name = self.add(f"{self.names[source.node]}_{consumer}", {"type": "Constant"})
            self.result.blocks[name]["value"] = value
            return f"{name}.value"
        address = self.base(source, consumer)
        chosen = _selected(matrix)
        if chosen and source.size > 1:
            return f"{address}[{chosen}]"
        gain: Any = float(matrix[0, 0]) if is_number else matrix
        name = address.split(".")[0]
        name = f"{name}_gain" if consumer in name else f"{name}_{consumer}"
        name = self.add(name, {"type": "Gain", "gain": gain})
        self.result.wires[name] = {"input": address}
        return f"{name}.out"

    def base(self, source: Source, consumer: str = "") -> str:
        """The address of a source itself."""
        if source not in self.addresses:
            if isinstance(source, Decoded):
                self.addresses[source] = self.decoder(source, consumer)
            elif isinstance(source, Filtered):
                self.addresses[source] = self.lowpass(source, consumer)
            elif isinstance(source, NodeOutput):
                self.addresses[source] = self.node(source.node)
            else:
                self.addresses[source] = self.computed(source, consumer)
        return self.addresses[source]

    def lowpass(self, source: Filtered, consumer: str) -> str:
        tau = synapse_entry(source.synapse)
        if not isinstance(tau, float):
            raise UsageError(f"{source.synapse!r} after a node is not read; expected a Lowpass")
        inner = self.base(source.source, consumer)
        name = self.add(f"{inner.split('.')[0]}_filtered", {"type": "Lowpass", "tau": tau})
        self.result.wires[name] = {"input": inner}
        return f"{name}.out"

    def decoder(self, source: Decoded, consumer: str, matrix: FloatArray | None = None) -> str:
        """A Decoder, or Weights between neurons, with the matrix in its weights."""
        weights, population = self.weights(source, matrix), source.population
        synapse, rule = synapse_entry(source.synapse), source.connection.learning_rule_type
        key = (population, str(synapse), weights.shape, weights.tobytes())
        if key in self.addresses and rule is None:
            return self.addresses[key]
        name = f"{population.name}_{consumer}".rstrip("_")
        if is_full(source.connection) and rule is not None:
            # Nengo's rule changes weights that hold the gains, ours those before the gains.
            message = "a rule on weights of a solver is not read; connect the neurons"
            raise UsageError(f"{source.connection}: {message}")
        if between_neurons(source.connection) and matrix is None:
            entry = {"type": "Weights", "weights": weights, "synapse": synapse}
            name = self.add(name, entry)
            self.result.wires[name] = {"spikes": f"{population.name}.spikes"}
            if rule is not None:
                entry["learning"] = rule_entry(rule)
                post = self.flow.of[source.connection.post_obj.ensemble][0]
                self.result.wires[name]["post"] = f"{post.name}.spikes"
            address = f"{name}.current"
        else:
            entry, comment = decoder_entry(
                source, weights, matrix, self.simulator, self.options.redraw
            )
            name = self.add(name, {**entry, "synapse": synapse}, comment)
            address = self.addresses[key] = f"{name}.value"
            self.result.wires[name] = {"spikes": f"{population.name}.spikes"}
            if rule is not None and not isinstance(rule, nengo.Voja):
                self.addresses[source] = address  # an error may come from the learnt value
                self.learning(name, source, rule)
        if source.synapse is None and not isinstance(source.connection, Probed):
            note = "its value is a tick later than Nengo's: give the connection a synapse"
            self.result.notes.append(f"{name} has no synapse; {note}")
        return address

    def learning(self, name: str, source: Decoded, rule: Any) -> None:
        if isinstance(rule, (list, tuple, dict)):
            raise UsageError(f"{source.connection}: {rule!r} is not read here")
        self.result.blocks[name]["learning"] = rule_entry(rule)
        terms = self.flow.into(source.connection.learning_rule)
        if not terms:
            raise UsageError(f"{source.connection}: nothing is connected to its {rule!r}")
        self.wire(name, "error", terms)

    def weights(self, source: Decoded, matrix: FloatArray | None) -> FloatArray:
        n = source.population.first.n_neurons
        rows = [np.zeros((source.rows, n)) if w is None else w for w in source.weights]
        whole = np.concatenate(rows, axis=1)
        if matrix is None:
            return whole
        factor = matrix[0, 0] if source.population.groups > 1 else None
        return np.asarray(matrix @ whole if factor is None else factor * whole)

    # Nodes

    def node(self, node: Any) -> str:
        name, options = self.names[node], self.options
        if isinstance(node.output, np.ndarray):
            name = self.add(name, {"type": "Constant", "value": np.atleast_1d(node.output)})
            return f"{name}.value"
        if nodes.is_process(node):
            return self.table(node, name, "a process")
        text = (
            nodes.of_input(node, options.dt)
            if node.size_in
            else nodes.of_time(node, options.dt, options.until)
        )
        if text is not None:
            name = self.add(name, {"type": "Function", "expression": text})
        else:
            own = nodes.own_block(name, node.output, node.size_in, node.size_out, True)
            if own is None and not node.size_in:
                return self.table(node, name, "a function that is not plain")
            if own is None:
                own = nodes.stub(name, node.size_in, node.size_out)
                self.result.notes.append(
                    f"{name}: its function is not plain (it uses objects from around it): "
                    f"write class {nodes.class_name(name)} by hand"
                )
            self.result.classes.append(own)
            name = self.add(name, {"type": nodes.class_name(name), "module": ""})
        self.addresses[self.flow.sources.setdefault(node, NodeOutput(node, node.size_out))] = (
            f"{name}.out"
        )
        if node.size_in:
            terms = self.flow.into(node)
            if terms:
                self.wire_components(name, terms, node.size_in)
        return f"{name}.out"

    def wire_components(self, name: str, terms: Terms, size: int) -> None:
        """Wire the sum of terms to ``u``, to which wires do not add up."""
        if len(terms) > 1:
            total = self.add(f"{name}_input", {"type": "Sum"})
            self.wire(total, "terms", terms)
            self.result.wires.setdefault(name, {})["u"] = f"{total}.out"
        else:
            self.wire(name, "u", terms)

    def computed(self, source: Computed, consumer: str) -> str:
        text = nodes.of_values(source.function, source.length, "u")
        name = f"function_{consumer}".rstrip("_")
        if text is not None:
            name = self.add(name, {"type": "Function", "expression": text})
        else:
            name = self.add(name, {"type": nodes.class_name(name), "module": ""})
            own = nodes.own_block(name, source.function, source.length, source.size, False)
            if own is None:
                own = nodes.stub(name, source.length, source.size)
                self.result.notes.append(f"{name}: write class {nodes.class_name(name)} by hand")
            self.result.blocks[name]["type"] = nodes.class_name(name)
            self.result.classes.append(own)
        self.wire_components(name, source.terms, source.length)
        return f"{name}.out"

    def table(self, node: Any, name: str, why: str) -> str:
        name = self.add(name, {"type": "FromFile"})
        self.unrecorded.append((node, name))
        note = f"{name}: {why}; recorded for {self.options.until:g} s (--until), then held"
        self.result.notes.append(note)
        return f"{name}.out"

    def tables(self) -> None:
        """Record the nodes whose values are a table."""
        if not self.unrecorded:
            return
        steps = max(2, round(self.options.until / self.options.dt) + 1)
        values = nodes.recorded(self.simulator, [node for node, _ in self.unrecorded], steps)
        self.result.tables["time"] = np.array([k * self.options.dt for k in range(steps)])
        for node, name in self.unrecorded:
            self.result.tables[name] = values[node]
            self.result.blocks[name] |= {
                "file": "", "time": "time", "columns": name, "method": "hold", "outside": "hold"
            }  # fmt: skip

    # Probes

    def probe(self, probe: Any) -> None:
        name, entry, late = self.names[probe], {}, 0
        target = probe.obj
        every = round(probe.sample_every / self.options.dt) if probe.sample_every else 1
        if isinstance(target, nengo.ensemble.Neurons):
            attribute = "fired" if probe.attr in ("output", "spikes") else probe.attr
            population, index = self.flow.of[target.ensemble]
            n = target.ensemble.n_neurons
            address = f"{population.name}.{attribute}"
            address = _part(address, index * n, n, n * population.groups, probe)
            late = 0 if attribute == "fired" else 1  # a state is recorded before its step
            if probe.synapse is not None:
                entry["synapse"] = synapse_entry(probe.synapse)
        elif isinstance(target, nengo.Connection):
            source = self.flow.through(target)[0][0]
            address = f"{self.base(source).split('.')[0]}.weights"
            late = 1
        elif isinstance(target, nengo.Ensemble) and not is_direct(target):
            address = self.decoded_probe(target, probe, name)
        elif isinstance(target, (nengo.Node, nengo.Ensemble)):
            terms = self.flow.into(target)
            if isinstance(target, nengo.Node) and target.output is not None:
                node = NodeOutput(target, target.size_out)
                terms = [(self.flow.sources.setdefault(target, node), np.eye(target.size_out))]
            terms = [(self.flow.filtered(s, probe.synapse), m) for s, m in terms]
            total = self.add(f"{name}_sum", {"type": "Sum"}) if len(terms) > 1 else ""
            address = f"{total}.out" if total else self.term(*terms[0], name)
            address = _part(address, 0, target.size_out, target.size_out, probe)
            if total:
                self.wire(total, "terms", terms)
        else:
            self.result.notes.append(f"the probe {name} of {target} is left out")
            return
        if every > 1:
            entry["every"] = every
        self.result.probes[name] = {"of": address, **entry} if entry else address
        self.result.late[name] = (probe, late)

    def decoded_probe(self, ensemble: Any, probe: Any, name: str) -> str:
        population, index = self.flow.of[ensemble]
        points, rates = nengo.utils.ensemble.tuning_curves(
            ensemble, self.simulator, inputs=self.simulator.data[ensemble].eval_points
        )
        decoders: FloatArray = np.array(nengo.solvers.LstsqL2()(rates, points)[0].T)
        weights: list[FloatArray | None] = [None] * population.groups
        weights[index] = decoders
        connection = Probed(ensemble, probe.synapse)
        d = ensemble.dimensions
        source = Decoded(population, probe.synapse, connection, weights, d)
        return _part(self.decoder(source, name), index * d, d, d * population.groups, probe)


def _part(address: str, first: int, size: int, whole: int, probe: Any) -> str:
    """The components of an address, ``size`` from ``first`` on, that a probe records."""
    chosen = first + np.arange(size)[slice(None) if probe.slice is None else probe.slice]
    if len(chosen) == whole:
        return address
    if not np.array_equal(chosen, chosen[0] + np.arange(len(chosen))):
        raise UsageError(f"{probe}: only ranges of components are probed")
    end = f":{chosen[-1] + 1}" if len(chosen) > 1 else ""
    return f"{address}[{chosen[0]}{end}]"


def _selected(matrix: FloatArray) -> str:
    """The index, or the range, of the components that a matrix selects; '' if it does not."""
    rows, columns = matrix.nonzero()
    if len(rows) != len(matrix) or not np.array_equal(rows, np.arange(len(matrix))):
        return ""
    if not np.array_equal(columns, columns[0] + np.arange(len(columns))):
        return ""
    if not (matrix[rows, columns] == 1.0).all():
        return ""
    return f"{columns[0]}" if len(columns) == 1 else f"{columns[0]}:{columns[-1] + 1}"
