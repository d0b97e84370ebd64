"""What reaches each population, node and rule of a Nengo network, with passthrough nodes folded.

In: a network and its built simulator. Out: for each place that receives, a sum of matrices times
sources: outputs of nodes, decoded spikes, and filtered sources::

    node -> passthrough -> b[1]        b receives  [[0], [1]] @ node
    arrays of ensembles                one source for a connection that each of them has
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import nengo
import networkx as nx
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from spikeblocks.nengo.attributes import is_exactly
from spikeblocks.nengo.convolution import TRANSFORMS, convolution_matrix

# Bytes of one transform. Connections in a row are multiplied as matrices, which also a convolution
# is: 28 x 28 x 1 to 26 x 26 x 32 takes 136 MB, a second such layer 6.4 GB.
LARGEST = 1 << 30


@dataclass(eq=False)
class Population:
    """One ensemble, or the ensembles of an array, which are one block with groups."""

    members: list[Any]
    name: str = ""

    @property
    def first(self) -> Any:
        return self.members[0]

    @property
    def groups(self) -> int:
        return len(self.members)


@dataclass(eq=False)
class NodeOutput:
    """What a node that computes, or is given, puts out."""

    node: Any
    size: int


@dataclass(eq=False)
class Decoded:
    """Weighted spikes of a population, through a synapse.

    weights : (rows, n) for each member, or None where a member has no such connection.
    connection : one of the network's that has them, of which function and rule are read.
    """

    population: Population
    synapse: Any
    connection: Any
    weights: list[FloatArray | None]
    rows: int

    @property
    def size(self) -> int:
        return self.rows * self.population.groups

    @property
    def scales(self) -> bool:
        """Whether its weights may be multiplied: a rule learns those that Nengo has."""
        return self.connection.learning_rule_type is None

    @property
    def is_prompt(self) -> bool:
        """Whether it has no synapse, and a graph the spikes of its own step."""
        connection, neurons = self.connection, self.population.first
        if self.synapse is not None or connection.post_obj is None or neurons.noise is not None:
            return False
        if isinstance(neurons.neuron_type, (nengo.StochasticSpiking, nengo.PoissonSpiking)):
            return False
        rule = rule_of(connection)
        return rule is None or isinstance(rule, (nengo.PES, nengo.RLS))

    @property
    def is_single(self) -> bool:
        """Whether its population is one ensemble."""
        return self.population.groups == 1


@dataclass(eq=False)
class Filtered:
    """A source through a synapse of its own."""

    source: Source
    synapse: Any

    @property
    def size(self) -> int:
        return self.source.size


@dataclass(eq=False)
class Computed:
    """A function of a connection that comes from a node."""

    function: Any
    terms: Terms
    length: int
    size: int


@dataclass(eq=False)
class Junction:
    """What reaches a passthrough node, or an ensemble without neurons, that is in a loop."""

    of: Any

    @property
    def size(self) -> int:
        return int(self.of.size_in)


Source = NodeOutput | Decoded | Filtered | Computed | Junction
Terms = list[tuple[Source, FloatArray]]


@dataclass
class Flow:
    """The sums that reach the receivers of a network."""

    network: Any
    simulator: Any
    populations: list[Population] = field(default_factory=list)
    sources: dict[Any, Source] = field(default_factory=dict)
    decoded: dict[Any, Decoded] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.incoming: dict[Any, list[Any]] = {}
        for each in self.network.all_connections:
            self.incoming.setdefault(each.post_obj, []).append(each)
        self.of: dict[Any, tuple[Population, int]] = {}
        arrays = [n for n in self.network.all_networks if _is_array(n, self.network)]
        for members in [n.ea_ensembles for n in arrays]:
            self._add(Population(list(members)))
        for ensemble in self.network.all_ensembles:
            if ensemble not in self.of and not is_direct(ensemble):
                self._add(Population([ensemble]))
        self.array_of = {m: n for n in arrays for m in n.ea_ensembles}
        self.sources |= {each: Junction(each) for each in self._looped()}

    @property
    def junctions(self) -> list[Junction]:
        return [each for each in self.sources.values() if isinstance(each, Junction)]

    def _looped(self) -> list[Any]:
        """What would be folded, but is in a loop of such objects alone."""
        folded = {n for n in self.network.all_nodes if n.output is None}
        folded |= {e for e in self.network.all_ensembles if is_direct(e)}
        wires = [(c.pre_obj, c.post_obj) for c in self.network.all_connections]
        graph = nx.DiGraph(wire for wire in wires if folded.issuperset(wire))
        loops = (c for c in nx.strongly_connected_components(graph) if len(c) > 1)
        found = set().union(*loops, nx.nodes_with_selfloops(graph))
        return [o for o in (*self.network.all_nodes, *self.network.all_ensembles) if o in found]

    def reaching(self, folded: Any) -> Terms:
        """What a passthrough node, or an ensemble without neurons, passes on."""
        source = self.sources.get(folded)
        return self.into(folded) if source is None else [(source, np.eye(source.size))]

    def _add(self, population: Population) -> None:
        self.populations.append(population)
        for i, member in enumerate(population.members):
            self.of[member] = (population, i)

    def into(self, receiver: Any) -> Terms:
        """What reaches an ensemble, its neurons, a node or a rule of learning."""
        terms: Terms = []
        of = getattr(receiver, "ensemble", None)
        for each in (c for c in self.incoming.get(of, ()) if is_full(c)):
            terms += self.through(each)
        for each in self.incoming.get(receiver, ()):
            if is_full(each):
                continue
            rows = np.arange(receiver.size_in)[each.post_slice]
            for source, matrix in self.through(each):
                placed = np.zeros((receiver.size_in, matrix.shape[1]))
                np.add.at(placed, rows, matrix)  # an index may be there twice
                terms.append((source, placed))
        return summed(terms)

    def into_population(self, population: Population, neurons: bool = False) -> Terms:
        """What reaches all members, one after the other."""
        receivers = [m.neurons if neurons else m for m in population.members]
        each = receivers[0].size_in
        terms: Terms = []
        for i, receiver in enumerate(receivers):
            for source, matrix in self.into(receiver):
                place = np.zeros((each * len(receivers), matrix.shape[1]))
                place[i * each : (i + 1) * each] = matrix
                terms.append((source, place))
        return summed(terms)

    def through(self, connection: Any) -> Terms:
        """What a connection brings, with its function, its transform and its synapse."""
        before = connection.pre_obj
        is_neurons = isinstance(before, nengo.ensemble.Neurons)
        ensemble = before.ensemble if is_neurons else before
        if isinstance(ensemble, nengo.Ensemble) and not is_direct(ensemble):
            return self._decoded(connection, ensemble, is_neurons)
        matrix = self.matrix(connection, connection.size_mid)
        if isinstance(before, nengo.Node) and before.output is not None:
            terms: Terms = [(self.node_output(before), np.eye(before.size_out))]
        else:
            terms = self.reaching(before)
        chosen = np.arange(before.size_out)[connection.pre_slice]
        terms = [(source, m[chosen]) for source, m in terms]
        if connection.function is not None:
            computed = Computed(connection.function, terms, len(chosen), connection.size_mid)
            source = self.sources.setdefault(connection, computed)
            terms = [(source, np.eye(connection.size_mid))]
        terms = [(source, matrix @ m) for source, m in terms]
        return [(self.filtered(source, connection.synapse), m) for source, m in terms]

    def node_output(self, node: Any) -> Source:
        """The source that a node with an output is."""
        return self.sources.setdefault(node, NodeOutput(node, node.size_out))

    def matrix(self, connection: Any, columns: int) -> FloatArray:
        """The transform of a connection as a matrix.

        Raises
        ------
        UsageError : the matrix is larger than ``LARGEST``, or the transform is not read.
        """
        # After neurons, a square matrix places the components among those of the population.
        is_square = isinstance(connection.pre_obj, nengo.ensemble.Neurons)
        shape = connection.size_out, max(columns, connection.size_out if is_square else 0)
        if 8 * math.prod(shape) > LARGEST:
            raise UsageError(
                f"{connection}: its transform needs a matrix of {shape[0]} x {shape[1]}, "
                f"{8 * math.prod(shape) / 2**30:.1f} GiB; at most {LARGEST >> 30} GiB is: use "
                "fewer filters, larger strides or a smaller input"
            )
        weights = self.simulator.data[connection].weights
        if weights is None:
            return np.eye(connection.size_out, columns)
        if hasattr(weights, "toarray"):
            weights = weights.toarray()
        weights = np.asarray(weights, dtype=float)
        if isinstance(connection.transform, TRANSFORMS):
            return convolution_matrix(connection.transform, weights)
        if weights.ndim < 2:
            return np.diag(weights) if weights.ndim else weights * np.eye(columns)
        if weights.shape != (connection.size_out, columns):
            raise UsageError(f"{connection}: a {type(connection.transform).__name__} is not read")
        return weights

    def _decoded(self, connection: Any, ensemble: Any, is_neurons: bool) -> Terms:
        population, index = self.of[ensemble]
        family: tuple[Any, ...] = (connection,)
        if population.groups > 1:
            post = self.array_of.get(connection.post_obj, connection.post_obj)
            same = [
                each
                for each in self.network.all_connections
                if each.pre_obj is ensemble
                and self.array_of.get(each.post_obj, each.post_obj) is post
            ]
            family = (population, post, same.index(connection), connection.size_out)
            family += (connection.synapse,)
        weights = self._weights(connection, ensemble, is_neurons)
        rows, groups = len(weights), population.groups
        source = self.decoded.get(family)
        if source is None:
            source = Decoded(population, connection.synapse, connection, [None] * groups, rows)
            self.decoded[family] = source
        source.weights[index] = weights
        matrix = np.zeros((rows, source.size))
        factors = 1.0 / self._gains(connection) if holds_gains(connection) else np.ones(rows)
        matrix[:, index * rows : (index + 1) * rows] = np.diag(factors)
        return [(source, matrix)]

    def _weights(self, connection: Any, ensemble: Any, is_neurons: bool) -> FloatArray:
        if not is_neurons:
            weights = np.asarray(self.simulator.data[connection].weights, dtype=float)
            if is_full(connection) and not holds_gains(connection):
                # Nengo multiplies such weights by the gains, and so does an Ensemble its currents.
                weights = weights / self._gains(connection)[:, None]
            return weights
        columns = np.arange(ensemble.n_neurons)[connection.pre_slice]
        weights = np.zeros((connection.size_out, ensemble.n_neurons))
        weights[:, columns] = self.matrix(connection, len(columns))
        return weights

    def _gains(self, connection: Any) -> FloatArray:
        """The gains after a connection's weights; infinite where 0, for 1/gain is 0 then."""
        gain = np.asarray(self.simulator.data[connection.post_obj].gain, dtype=float)
        return np.where(gain == 0.0, np.inf, gain)

    def filtered(self, source: Source, synapse: Any) -> Source:
        """A source through one more synapse; that of decoded spikes is their own."""
        if synapse is None:
            return source
        found = self.sources.get((source, synapse))
        if found is None:
            if isinstance(source, Decoded) and source.synapse is None:
                found = Decoded(
                    source.population, synapse, source.connection, source.weights, source.rows
                )
            else:
                found = Filtered(source, synapse)
            self.sources[source, synapse] = found
        return found


def is_inside(source: Source) -> bool:
    """Whether a source comes from a loop of passthrough nodes, through synapses alone."""
    while isinstance(source, Filtered):
        source = source.source
    return isinstance(source, Junction)


def summed(terms: Iterable[tuple[Source, FloatArray]]) -> Terms:
    """Terms with one matrix for each source."""
    total: dict[Source, FloatArray] = {}
    for source, matrix in terms:
        total[source] = total[source] + matrix if source in total else matrix
    return [(source, matrix) for source, matrix in total.items() if matrix.any()]


def are_equal(terms: Terms, others: Terms) -> bool:
    """Whether two sums have the same matrices of the same sources."""
    pairs = dict(others)
    return len(terms) == len(others) and all(
        source in pairs and np.array_equal(matrix, pairs[source]) for source, matrix in terms
    )


def selected(matrix: FloatArray) -> str:
    """The index, or the range, of the components that a matrix selects; '' if it does not."""
    rows, columns = matrix.nonzero()
    if len(rows) != len(matrix) or not np.array_equal(rows, np.arange(len(matrix))):
        return ""
    if not np.array_equal(columns, columns[0] + np.arange(len(columns))):
        return ""
    if not (matrix[rows, columns] == 1.0).all():
        return ""
    return f"{columns[0]}" if len(columns) == 1 else f"{columns[0]}:{columns[-1] + 1}"


def rules_of(connection: Any) -> list[tuple[Any, Any]]:
    """The rules of a connection, each with what its error or factor is connected to."""
    rules, signals = connection.learning_rule_type, connection.learning_rule
    if rules is None:
        return []
    if isinstance(rules, dict):
        rules, signals = list(rules.values()), [signals[name] for name in rules]
    if not isinstance(rules, (list, tuple)):
        return [(rules, signals)]
    # Nengo builds equal rules once.
    pairs = list(zip(rules, signals, strict=True))
    return [pair for i, pair in enumerate(pairs) if pair[0] not in rules[:i]]


def weight_rules(connection: Any) -> list[tuple[Any, Any]]:
    """The rules that change a connection's weights; Voja changes encoders.

    Raises
    ------
    UsageError : they are not of one kind.
    """
    if connection.learning_rule_type is None:
        return []
    found = [pair for pair in rules_of(connection) if not is_exactly(pair[0], nengo.Voja)]
    rules = [rule for rule, _ in found]
    if len(rules) < 2:
        return found
    errors = all(is_exactly(rule, nengo.PES) for rule in rules)
    if errors and len({rule.pre_synapse for rule in rules}) == 1:
        return found
    if not all(is_exactly(rule, nengo.BCM, nengo.Oja) for rule in rules):
        known = "several PES with one pre_synapse, or a BCM and an Oja"
        raise UsageError(f"{connection}: its rules are not read together; expected {known}")
    return found


def rule_of(connection: Any) -> Any:
    """The first rule that changes a connection's weights, or None."""
    found = weight_rules(connection)
    return found[0][0] if found else None


def is_full(connection: Any) -> bool:
    """Whether a connection between ensembles has a weight for each pair of neurons."""
    solver = getattr(connection, "solver", None)
    return (
        isinstance(connection.pre_obj, nengo.Ensemble)
        and not is_direct(connection.pre_obj)  # nothing is solved there
        and isinstance(connection.post_obj, nengo.Ensemble)
        and bool(getattr(solver, "weights", False))
    )


def holds_gains(connection: Any) -> bool:
    """Whether a rule changes the weights of a solver as Nengo has them, times the gains.

    Oja's rule and BCM do; the currents are then divided by the gains, which an Ensemble multiplies
    by. PES changes decoders, in front of the gains.
    """
    rule = rule_of(connection)
    return is_full(connection) and isinstance(rule, (nengo.BCM, nengo.Oja))


def is_direct(ensemble: Any) -> bool:
    """Whether an ensemble computes without neurons."""
    return isinstance(ensemble, nengo.Ensemble) and isinstance(ensemble.neuron_type, nengo.Direct)


def _is_array(network: Any, whole: Any) -> bool:
    """Whether an EnsembleArray can be one block: equal members, no rules, no single neurons."""
    if not isinstance(network, nengo.networks.EnsembleArray) or len(network.ea_ensembles) < 2:
        return False
    members = set(network.ea_ensembles)
    kinds = {
        (e.n_neurons, e.dimensions, e.radius, repr(e.neuron_type), repr(e.noise)) for e in members
    }
    if len(kinds) > 1 or is_direct(network.ea_ensembles[0]):
        return False
    for each in whole.all_connections:
        of = getattr(each.pre_obj, "ensemble", None)
        touched = {each.pre_obj, each.post_obj} & members
        if of in members or (touched and each.learning_rule_type is not None):
            return False
    return True
