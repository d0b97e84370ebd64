"""Where a graph has what a probe of Nengo records.

In: a probe, and the conversion with the blocks so far. Out: :class:`Recording`; blocks are added
where the graph does not compute the signal, a Decoder for what an ensemble represents::

    Probe(a.neurons, "voltage")    ->    a.voltage, a row late: a state is recorded before its step
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Protocol

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from spikeblocks.nengo.decoding import Probed
from spikeblocks.nengo.flow import Decoded, Flow, Terms, holds_gains, is_direct, is_full, rule_of
from spikeblocks.nengo.populations import synapse_entry

STATES = {"input": "drive", "refractory_time": "refractory", "adaptation": "recovery"}
RULE_STATES = {"inv_gamma": "inverse", "theta": "theta"}


class Conversion(Protocol):
    """What adds blocks to a graph, and names the signals that they have."""

    flow: Flow
    simulator: Any
    options: Any

    def zeros(self, name: str, size: int) -> str: ...
    def total(self, name: str, terms: Terms, size: int) -> str: ...
    def decoder(self, source: Decoded, consumer: str) -> str: ...
    def learner(self, connection: Any) -> str: ...


@dataclass(frozen=True)
class Recording:
    """A signal of a graph, and how Nengo's rows are made of its values.

    late : how many ticks later a row is that of Nengo's probe.
    first, size, whole : which components of how many belong to what is probed.
    synapse : a filter of the graph's own probe. then : what the rows (steps, ...) go through.
    every : steps between two rows. constant : whether a graph records it once.
    differs : how a graph's own rows differ, in words.
    """

    probe: Any
    address: str
    late: int = 0
    first: int = 0
    size: int = 0
    whole: int = 0
    synapse: Any = None
    then: Callable[[FloatArray], FloatArray] | None = None
    every: int = 1
    constant: bool = False
    differs: str = ""

    @property
    def chosen(self) -> Any:
        """The components that the probe records."""
        within = slice(None) if self.probe.slice is None else self.probe.slice
        return self.first + np.arange(self.size)[within]

    def part(self) -> str:
        """The address with these components."""
        chosen = self.chosen
        if len(chosen) == self.whole:
            return self.address
        if not np.array_equal(chosen, chosen[0] + np.arange(len(chosen))):
            raise UsageError(f"{self.probe}: only ranges of components are probed")
        end = f":{chosen[-1] + 1}" if len(chosen) > 1 else ""
        return f"{self.address}[{chosen[0]}{end}]"

    def rows(self, values: FloatArray) -> FloatArray:
        """Nengo's rows, of the values of the whole signal in each step."""
        if self.then is not None:
            return self.then(values)
        values = values.reshape(len(values), math.prod(values.shape[1:]))
        return values[:, self.chosen] if self.whole else values


def recording(conversion: Conversion, probe: Any, name: str) -> Recording:
    """Where to record a probe of this name.

    Raises
    ------
    UsageError : the graph has no such signal.
    """
    target, attribute = probe.obj, probe.attr
    if isinstance(target, nengo.ensemble.Neurons):
        return _of_neurons(conversion, probe)
    if isinstance(target, nengo.connection.LearningRule):
        return _of_rule(conversion, probe, name)
    if isinstance(target, nengo.Connection):
        if attribute == "weights":
            return _of_weights(conversion, probe, name)
        if attribute == "output":
            return _of_connection(conversion, probe, name)
        raise UsageError(f"{probe}: the input of a connection is not read; probe what it is of")
    if attribute == "scaled_encoders":
        return _of_encoders(conversion, probe, target)
    if isinstance(target, nengo.Ensemble) and not is_direct(target) and attribute != "input":
        return _decoded(conversion, probe, name)
    flow = conversion.flow
    terms = flow.reaching(target)
    if isinstance(target, nengo.Node) and target.output is not None:
        terms = [(flow.node_output(target), np.eye(target.size_out))]
    return _of_terms(conversion, probe, terms, name)


def sampled(probe: Any, options: Any) -> int:
    """The steps between two rows of a graph's probe.

    Raises
    ------
    UsageError : those of Nengo's are no whole number, and the graph is written for a user.
    """
    steps = float(probe.sample_every or options.dt) / float(options.dt)
    every = max(1, round(steps))
    if steps <= 1.0 or abs(steps - every) < 1e-6:
        return every
    if options.live:
        return 1  # the simulator chooses of all rows
    raise UsageError(
        f"{probe}: its sample_every={probe.sample_every!r} is not read; expected whole steps "
        f"of {options.dt:g} s, got {steps:g}"
    )


def _of_connection(conversion: Conversion, probe: Any, name: str) -> Recording:
    connection, terms = probe.obj, conversion.flow.through(probe.obj)
    if is_full(connection):
        gain = conversion.simulator.data[connection.post_obj].gain[:, None]
        terms = [(source, gain * matrix) for source, matrix in terms]
    # Nengo's row has a synapse's output after the step, which comes to its end in the next one.
    late = int(probe.synapse is None and connection.synapse is not None)
    return replace(_of_terms(conversion, probe, terms, name), late=late)


def _of_terms(conversion: Conversion, probe: Any, terms: Terms, name: str) -> Recording:
    flow, size = conversion.flow, len(terms[0][1]) if terms else probe.obj.size_out
    terms = [(flow.filtered(s, probe.synapse), m) for s, m in terms]
    return Recording(probe, conversion.total(name, terms, size), size=size, whole=size)


def _of_neurons(conversion: Conversion, probe: Any) -> Recording:
    ensemble = probe.obj.ensemble
    population, index = conversion.flow.of[ensemble]
    n = ensemble.n_neurons
    known = (*ensemble.neuron_type.probeable, "input", "spikes")
    if probe.attr not in known or probe.attr == "rate_out":
        raise UsageError(f"{probe}: its '{probe.attr}' is not read")
    fired = probe.attr in ("output", "spikes")
    is_filtered = probe.synapse is not None
    # Nengo's filter takes the spikes of a step in the next one, and so does one of `spikes` here.
    # An event is recorded in each step or not at all; the output has it a step later.
    is_output = is_filtered or sampled(probe, conversion.options) > 1
    state = ("spikes" if is_output else "fired") if fired else STATES.get(probe.attr, probe.attr)
    synapse = synapse_entry(probe.synapse, conversion.simulator.dt) if is_filtered else None
    late = 0 if is_filtered or (fired and not is_output) else 1
    address = f"{population.name}.{state}"
    return Recording(probe, address, late, index * n, n, n * population.groups, synapse)


def _of_encoders(conversion: Conversion, probe: Any, ensemble: Any) -> Recording:
    population, index = conversion.flow.of[ensemble]
    members = slice(index * ensemble.n_neurons, (index + 1) * ensemble.n_neurons)
    address = f"{population.name}.scaled_encoders"
    return Recording(
        probe,
        address,
        then=lambda v: np.swapaxes(v, 1, 2)[:, members],
        differs="with a column, in place of a row, for each neuron",
    )


def _of_weights(conversion: Conversion, probe: Any, name: str) -> Recording:
    connection = probe.obj
    fixed = conversion.simulator.data[connection].weights
    if rule_of(connection) is None:
        # No rule changes them, and often no block has them alone.
        fixed = np.asarray(fixed.toarray() if hasattr(fixed, "toarray") else fixed, dtype=float)
        address = conversion.zeros(name, 1)
        return Recording(
            probe,
            address,
            then=lambda v: np.repeat(fixed[None], len(v), axis=0),
            constant=True,
            differs="as one 0: nothing changes these weights, which are in the arrays",
        )
    address = f"{conversion.learner(connection)}.weights"
    source = conversion.flow.through(connection)[0][0]
    late = int(not (isinstance(source, Decoded) and source.is_prompt))
    if is_full(connection) and not holds_gains(connection):
        gain = conversion.simulator.data[connection.post_obj].gain[:, None]
        without = "without the gains, by which the Ensemble behind multiplies the currents"
        return Recording(probe, address, late, then=lambda v: v * gain, differs=without)
    return Recording(probe, address, late, then=lambda v: v)


def _of_rule(conversion: Conversion, probe: Any, name: str) -> Recording:
    connection, attribute = probe.obj.connection, probe.attr
    if attribute == "error":
        terms, size = conversion.flow.into(probe.obj), probe.obj.size_in
        return Recording(probe, conversion.total(name, terms, size), size=size, whole=size)
    if attribute == "scaled_encoders":
        return _of_encoders(conversion, probe, connection.post_obj)
    if attribute in ("activities", "pre_filtered", "post_filtered"):
        return _filtered(conversion, probe, attribute == "post_filtered")
    if attribute not in RULE_STATES:
        raise UsageError(f"{probe}: its '{attribute}' is not read")
    address = f"{conversion.learner(connection)}.{RULE_STATES[attribute]}"
    return Recording(probe, address, 1, then=lambda v: v)


def _filtered(conversion: Conversion, probe: Any, is_post: bool) -> Recording:
    """The spikes that a rule sees, those of the step included."""
    connection = probe.obj.connection
    rule = probe.obj.learning_rule_type
    seen = rule.post_synapse if is_post or isinstance(rule, nengo.Voja) else rule.pre_synapse
    if seen is None and isinstance(rule, (nengo.BCM, nengo.Oja)):
        seen = rule.pre_synapse  # Nengo's default behind the weights
    end = connection.post_obj if is_post else connection.pre_obj
    part = connection.post_slice if is_post else connection.pre_slice
    ensemble = getattr(end, "ensemble", end)
    population, index = conversion.flow.of[ensemble]
    chosen = np.arange(ensemble.n_neurons)[part if end is not ensemble else slice(None)]
    synapse = synapse_entry(seen, conversion.simulator.dt)
    first = index * ensemble.n_neurons
    return Recording(
        probe,
        f"{population.name}.fired",
        synapse=None if synapse == "none" else synapse,
        then=lambda v: v[:, first + chosen],
    )


def _decoded(conversion: Conversion, probe: Any, name: str) -> Recording:
    ensemble = probe.obj
    population, index = conversion.flow.of[ensemble]
    built = conversion.simulator.data[ensemble]
    points, rates = nengo.utils.ensemble.tuning_curves(
        ensemble, conversion.simulator, inputs=built.eval_points
    )
    decoders: FloatArray = np.array(probe.solver(rates, points)[0].T)
    weights: list[FloatArray | None] = [None] * population.groups
    weights[index] = decoders
    d = ensemble.dimensions
    source = Decoded(population, probe.synapse, Probed(ensemble, probe.synapse), weights, d)
    address = conversion.decoder(source, name)
    # Without a synapse, Nengo's row has the spikes of its own step, which arrive a tick later here.
    late = int(probe.synapse is None)
    return Recording(probe, address, late, index * d, d, d * population.groups)
