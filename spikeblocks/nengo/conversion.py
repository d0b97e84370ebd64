"""A Nengo network as blocks, wires and probes of a graph.

In: a network, with the names of its objects. Out: :class:`Converted`, plain values with NumPy
arrays, texts for comments and for an own Python file, and notes about what differs::

    convert(network, names, Options(dt=0.001, until=1.0)).blocks["a"]
    # {'type': 'Ensemble', 'neurons': 50, 'gain': array([...]), ...}
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from spikeblocks.nengo import decoding, live, nodes
from spikeblocks.nengo.attributes import is_exactly
from spikeblocks.nengo.converted import Converted, Options
from spikeblocks.nengo.decoding import Probed, between_neurons, decoder_entry
from spikeblocks.nengo.flow import (
    Computed,
    Decoded,
    Filtered,
    Flow,
    Junction,
    NodeOutput,
    Population,
    Source,
    Terms,
    are_equal,
    is_full,
    is_inside,
    rule_of,
    rules_of,
    selected,
    summed,
    weight_rules,
)
from spikeblocks.nengo.populations import (
    ensemble_entry,
    rule_entries,
    rule_entry,
    synapse_entry,
)
from spikeblocks.nengo.probing import recording, sampled


def convert(network: Any, names: dict[Any, str], options: Options, built: Any = None) -> Converted:
    """Convert a network, which is built for it unless Nengo's simulator of it is given.

    Raises
    ------
    UsageError : it contains what graphs do not have; the message names it.
    """
    how = {"dt": options.dt, "seed": options.seed, "progress_bar": False, "optimize": False}
    simulator = nengo.Simulator(network, **how) if built is None else built
    try:
        return Conversion(network, names, options, simulator).whole()
    finally:
        simulator.close()


class Conversion:
    """The conversion of one network: a method for each kind of object adds its blocks."""

    def __init__(self, network: Any, names: dict[Any, str], options: Options, simulator: Any):
        self.network, self.names, self.options = network, names, options
        self.simulator, self.result = simulator, Converted(simulator=simulator)
        self.flow = Flow(network, simulator)
        self.addresses: dict[Any, str] = {}
        self.unrecorded: list[Any] = []
        self.learners: dict[Any, str] = {}

    def whole(self) -> Converted:
        for population in self.flow.populations:
            self.population(population)
        for each in self.flow.junctions:
            self.base(each)
        for population in self.flow.populations:
            self.inputs(population)
        for probe in self.network.all_probes:
            self.probe(probe)
        for node in self.network.all_nodes:
            runs = node.output is not None and not isinstance(node.output, np.ndarray)
            if runs and (node.size_in or self.options.live):
                self.base(self.flow.node_output(node))
        if not self.result.blocks:
            self.zeros("nothing", 1)
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
        # A decoder that is solved for has the length of what it comes from.
        if all(getattr(source, "population", None) is population for source, _ in terms):
            entry["dimensions"] = population.first.dimensions * population.groups
        currents = self.flow.into_population(population, neurons=True)
        if currents:
            self.wire(population.name, "current", currents)
        self.encoder_rules(population)

    def encoder_rules(self, population: Population) -> None:
        """The rules that turn the encoders, and the factor on their rates."""
        found = [
            (pair[0], self.flow.into(pair[1]))
            for each in self.network.all_connections
            if each.post_obj is population.first
            for pair in rules_of(each)
            if is_exactly(pair[0], nengo.Voja)
        ]
        if not found:
            return
        rules, factors = zip(*found, strict=True)
        if any(not are_equal(factors[0], factor) for factor in factors):
            raise UsageError(
                f"{population.first}: Voja rules with signals of their own are not read together; "
                "connect one signal to all of them"
            )
        name = population.name
        self.result.blocks[name]["learning"] = rule_entries(list(rules), self.options.dt)
        if factors[0]:
            # Nengo's signal is added to 1: -1 stops learning.
            learn = self.add(f"{name}_learn", {"type": "Function", "expression": "1 + u"})
            self.wire(learn, "u", factors[0])
            self.result.wires.setdefault(name, {})["learn"] = f"{learn}.out"

    def wire(self, consumer: str, port: str, terms: Terms) -> None:
        sources = [self.term(source, matrix, consumer) for source, matrix in terms]
        self.result.wires.setdefault(consumer, {})[port] = (
            sources if len(sources) > 1 else sources[0]
        )

    def zeros(self, name: str, size: int) -> str:
        """A signal of zeros, of what nothing is connected to."""
        name = self.add(f"{name}_zero", {"type": "Constant", "value": np.zeros(size)})
        return f"{name}.value"

    def total(self, name: str, terms: Terms, size: int) -> str:
        """The address of a sum."""
        if not terms:
            return self.zeros(name, size)
        if len(terms) == 1:
            return self.term(*terms[0], name)
        name = self.add(f"{name}_sum", {"type": "Sum"})
        self.wire(name, "terms", terms)
        return f"{name}.out"

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
        chosen = selected(matrix)
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
            elif isinstance(source, Junction):
                self.junction(source)
            else:
                self.addresses[source] = self.computed(source, consumer)
        return self.addresses[source]

    def junction(self, source: Junction) -> None:
        """A sum in a loop, whose address is known before what is added up."""
        name = self.add(self.names[source.of], {"type": "Sum"})
        self.addresses[source] = f"{name}.out"
        terms = self.flow.into(source.of)
        self.wire(name, "terms", terms)
        if all(is_inside(each) for each, _ in terms):
            # Nothing else says how long the vector is that goes round.
            wires = self.result.wires[name]
            given = wires["terms"] if isinstance(wires["terms"], list) else [wires["terms"]]
            wires["terms"] = [*given, self.zeros(name, source.size)]

    def lowpass(self, source: Filtered, consumer: str) -> str:
        """A synapse after a node, whose output has the inputs of the steps before."""
        inner, synapse = (
            self.base(source.source, consumer),
            synapse_entry(source.synapse, self.options.dt),
        )
        name = f"{inner.split('.')[0]}_filtered"
        if isinstance(synapse, float):
            name = self.add(name, {"type": "Lowpass", "tau": synapse})
            self.result.wires[name] = {"input": inner}
            return f"{name}.out"
        name = self.add(f"{name}_delay", {"type": "UnitDelay"})
        self.result.wires[name] = {"input": inner}
        inner = f"{name}.out"
        if synapse == "none":
            return inner
        name = self.add(name.removesuffix("_delay"), {"type": "SynapticFilter", "synapse": synapse})
        self.result.wires[name] = {"input": inner}
        return f"{name}.out"

    def decoder(self, source: Decoded, consumer: str, matrix: FloatArray | None = None) -> str:
        """A Decoder, or Weights between neurons, with the matrix in its weights."""
        weights, population = decoding.weights_of(source, matrix), source.population
        connection = source.connection
        synapse, rule = synapse_entry(source.synapse, self.options.dt), rule_of(connection)
        supervised = isinstance(rule, (nengo.PES, nengo.RLS))
        port = self.port(source)
        key = (population, port, str(synapse), weights.shape, weights.tobytes())
        if key in self.addresses and rule is None:
            return self.addresses[key]
        name = f"{population.name}_{consumer}".rstrip("_")
        spikes = f"{population.name}.{port}"
        if between_neurons(connection) and matrix is None and not supervised:
            entry = {"type": "Weights", "weights": weights, "synapse": synapse}
            name = self.add(name, entry)
            self.result.wires[name] = {"spikes": spikes}
            if rule is not None:
                rules = [each for each, _ in weight_rules(connection)]
                entry["learning"] = rule_entries(rules, self.options.dt)
                post = self.flow.of[getattr(connection.post_obj, "ensemble", connection.post_obj)][
                    0
                ]
                self.result.wires[name]["post"] = f"{post.name}.spikes"
                self.learners.setdefault(connection, name)
            address = f"{name}.current"
        else:
            if supervised and isinstance(connection.pre_obj, nengo.ensemble.Neurons):
                spikes, weights = decoding.sliced_spikes(connection, spikes, weights)
            entry, comment = decoder_entry(
                source, weights, matrix, self.simulator, self.options.redraw, self.options.live
            )
            name = self.add(name, {**entry, "synapse": synapse}, comment)
            address = self.addresses[key] = f"{name}.value"
            self.result.wires[name] = {"spikes": spikes}
            if rule is not None and supervised:
                self.addresses[source] = address  # an error may come from the learnt value
                self.learners.setdefault(connection, name)
                self.learning(name, source, rule)
        return address

    def port(self, source: Decoded) -> str:
        """The spikes that a connection takes; without a synapse, those of its own step."""
        name = source.population.name
        if source.is_prompt:
            self.result.blocks[name]["type"] = "FeedthroughEnsemble"
            return "now"
        if source.synapse is None and not isinstance(source.connection, Probed):
            note = "a connection without a synapse is a tick later than Nengo's: give it one"
            self.result.notes.append(f"{name}: {note}")
        return "spikes"

    def learner(self, connection: Any) -> str:
        """The block whose weights a connection's rule changes."""
        if connection not in self.learners:
            for source, _ in self.flow.through(connection):
                self.base(source)
        if connection not in self.learners:
            raise UsageError(f"{connection}: nothing of its rule is read")
        return self.learners[connection]

    def learning(self, name: str, source: Decoded, rule: Any) -> None:
        connection, rows = source.connection, source.rows
        self.result.blocks[name]["learning"] = rule_entry(rule, self.options.dt)
        receiver, terms = weight_rules(connection)[0][1], []
        for other, signal in weight_rules(connection):
            # Errors of several rules add up, each by its own rate.
            scale = 1.0 if other is rule else other.learning_rate / rule.learning_rate
            terms += [(term, scale * matrix) for term, matrix in self.flow.into(signal)]
        terms = summed(terms)
        if receiver.size_in != rows:
            # Of the represented vector: each neuron's error is that along its encoder.
            post = connection.post_obj
            built = self.simulator.data[getattr(post, "ensemble", post)]
            if is_full(connection):
                encoders = (built.encoders / post.radius)[:, connection.post_slice]
            else:
                encoders = built.scaled_encoders[connection.post_slice]
            terms = [(s, encoders @ m) for s, m in terms]
        if terms:
            self.wire(name, "error", terms)
        else:
            self.result.wires[name]["error"] = self.zeros(f"{name}_error", rows)

    # Nodes

    def node(self, node: Any) -> str:
        name, options = self.names[node], self.options
        if isinstance(node.output, np.ndarray):
            name = self.add(name, {"type": "Constant", "value": np.atleast_1d(node.output)})
            return f"{name}.value"
        if options.live:
            call = live.checked(node.output, node.size_out) if callable(node.output) else None
            if nodes.is_process(node):
                seed = self.simulator.seed if options.seed is None else options.seed
                call = live.stepped(node.output, node.size_in, node.size_out, options.dt, seed)
            name = self.called(name, call, node.size_in, node.size_out, True)
            return self.fed(node, name)
        if nodes.is_process(node):
            return self.table(node, name, "a process")
        text = (
            nodes.of_input(node, options.dt)
            if node.size_in
            else nodes.of_time(node, options.dt, options.until)
        )
        if text is not None:
            return self.fed(node, self.add(name, {"type": "Function", "expression": text}))
        own = nodes.own_block(name, node.output, node.size_in, node.size_out, True)
        if own is None and not node.size_in:
            return self.table(node, name, "a function that is not plain")
        return self.fed(node, self.own(name, own, node.size_in, node.size_out))

    def fed(self, node: Any, name: str) -> str:
        """The address of a node's block, which is wired to what reaches the node."""
        self.addresses[self.flow.node_output(node)] = f"{name}.out"
        if node.size_in:
            self.wire_components(name, self.flow.into(node), node.size_in)
        return f"{name}.out"

    def own(self, name: str, text: str | None, size_in: int, size: int) -> str:
        """A block of the graph's own file, or a stub in it."""
        name = self.add(name, {"module": ""})
        if text is None:
            text = nodes.stub(name, size_in, size)
            self.result.notes.append(
                f"{name}: its function is not plain (it uses objects from around it): "
                f"write class {nodes.class_name(name)} by hand"
            )
        self.result.blocks[name] = {"type": nodes.class_name(name), "module": ""}
        self.result.classes.append(text)
        return name

    def called(self, name: str, call: Any, size_in: int, size: int, takes_time: bool) -> str:
        """A block that calls a Python function of this process."""
        name = self.add(name, {})
        number = live.registered(call)
        self.result.calls.append(number)
        text = nodes.calling(f"call_{number}", number, size_in, max(size, 1), takes_time)
        self.result.blocks[name] = {"type": nodes.class_name(f"call_{number}"), "module": ""}
        self.result.classes.append(text)
        return name

    def wire_components(self, name: str, terms: Terms, size: int) -> None:
        """Wire the sum of terms to ``u``, to which wires do not add up."""
        self.result.wires.setdefault(name, {})["u"] = self.total(f"{name}_input", terms, size)

    def computed(self, source: Computed, consumer: str) -> str:
        name, size_in, size = f"function_{consumer}".rstrip("_"), source.length, source.size
        if self.options.live:
            function = live.checked(source.function, size)
            name = self.called(name, function, size_in, size, False)
        else:
            text = nodes.of_values(source.function, size_in, "u")
            if text is not None:
                name = self.add(name, {"type": "Function", "expression": text})
            else:
                own = nodes.own_block(name, source.function, size_in, size, False)
                name = self.own(name, own, size_in, size)
        self.wire_components(name, source.terms, size_in)
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
        known = [node for node, _ in self.unrecorded]
        values = nodes.recorded(self.simulator, known, self.options.dt, self.options.until)
        self.result.tables["time"] = values["time"]
        for node, name in self.unrecorded:
            self.result.tables[name] = values[node]
            self.result.blocks[name] |= nodes.of_table(name)

    # Probes

    def probe(self, probe: Any) -> None:
        name = self.names[probe]
        found = recording(self, probe, name)
        entry: dict[str, Any] = {} if found.synapse is None else {"synapse": found.synapse}
        every = 1 if found.constant else sampled(probe, self.options)
        if every > 1:
            # Nengo's first row is that of the last step of a period.
            entry["every"] = {"period": every, "offset": every - 1 + found.late}
        self.result.recordings[name] = found = replace(found, every=every)
        if found.differs and not self.options.live:
            self.result.notes.append(f"{name}: recorded {found.differs}")
        # A simulator chooses components of what is recorded.
        address = found.address if self.options.live or not found.whole else found.part()
        self.result.probes[name] = {"of": address, **entry} if entry else address
