"""A graph of populations as a graph of NIR, the neuromorphic intermediate representation.

In: a graph, or some of its blocks. Out: ``NAME.nir`` and ``report.txt``::

    Ensemble    Affine (encoders, gains, biases) ─▶ LIF (tau_rc, threshold 1, reset 0)
    Decoder     Linear (weights) ─▶ LI (the synapse); without a synapse Linear alone
    Gain        Linear
    Sum         Scale of 1: wires into one node add up

A LIF neuron of NIR has no refractory time. With our gains it would fire up to twice as often, so
each neuron gets the gain and the bias with which it has the same largest rate and intercept
without one, and the decoders are solved again. Spikes are impulses of area 1, as in NIR's
equations: a simulator with steps of dt takes them as 1/dt.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import Block, FloatArray
from blocks.generic import Gain, Sum
from blocks.neural import LIF, Decoder, Ensemble, Tuning
from runtime.errors import GraphError, MissingExtraError, Problem, UsageError
from runtime.export import Exported, check_name
from runtime.files import system_errors, write_files
from runtime.graph import Graph
from runtime.network import NetworkEntry, columns

# A refractory time that rates do not show: at 1 kHz it is a part in 1e9.
NONE = 1e-12
KINDS = (Ensemble, Decoder, Gain, Sum)


def export_nir(
    graph: Graph,
    folder: str | Path,
    *,
    blocks: Sequence[str] = (),
    others: Sequence[str] = (),
    name: str = "populations",
    **options: Any,
) -> Exported:
    """Write blocks of a graph as NIR.

    Parameters
    ----------
    blocks : names of blocks or parts to export. others : instead, the ones left out. Without both,
    all blocks that NIR has, of which there must be one.

    Raises
    ------
    GraphError : NIR has no form of a block; each is named with the reason.
    UsageError : an option of another target, or no block. MissingExtraError : nir is missing.
    """
    try:
        import nir
    except ImportError:
        raise MissingExtraError("export to NIR", "nir") from None
    check_name(name)
    for option in ("float32", "ticks", "hold", "tolerance"):
        if options.get(option):
            raise UsageError(f"--{option}: this option is not for --to nir")
    chosen = _chosen(graph, blocks, others)
    problems = [
        Problem(each.node.where, each.address, reason)
        for each in chosen.values()
        if (reason := _refusal(each, graph))
    ]
    if problems:
        raise GraphError(problems)
    writer = _Writer(graph, chosen)
    for each in chosen.values():
        writer.add(each)
    writer.connect()
    place = Path(folder)
    with system_errors(f"write '{place}'"):
        report = writer.report(graph.title)
        write_files({place / "report.txt": report}, folders=True)
        nir.write(str(place / f"{name}.nir"), nir.NIRGraph(writer.nodes, writer.edges))
    files = (f"{name}.nir", "report.txt")
    return Exported(place, files, report, tuple(writer.inputs), tuple(writer.outputs))


def _chosen(graph: Graph, blocks: Sequence[str], others: Sequence[str]) -> dict[str, NetworkEntry]:
    entries = graph.network.entries
    for each in (*blocks, *others):
        if not any(entry.is_named(each) for entry in entries.values()):
            raise UsageError(f"there is no block '{each}' to export")

    def is_chosen(entry: NetworkEntry) -> bool:
        if blocks:
            return any(entry.is_named(each) for each in blocks)
        if others:
            return not any(entry.is_named(each) for each in others)
        return isinstance(entry.block, KINDS)

    found = {key: e for key, e in entries.items() if _is_block(e) and is_chosen(e)}
    if not found:
        raise UsageError("there is no population to export; --block names what is to be")
    return found


def _is_block(entry: NetworkEntry) -> bool:
    return entry.cls.__name__ != "GraphInput"


def _refusal(entry: NetworkEntry, graph: Graph) -> str:
    """Why NIR has no form of a block; '' if it has one."""
    block: Block = entry.block
    if isinstance(block, Decoder):
        if block.learning is not None:
            return (
                "NIR has no rule that changes weights while it runs, such as PES; run it, and "
                "export it without 'learning' and with the weights that it has learnt"
            )
        if block.synapse.label not in ("lowpass", "none"):
            return f"NIR has no synapse '{block.synapse.label}'; a lowpass is its LI"
    elif isinstance(block, Ensemble):
        if type(block.neuron) is not LIF:
            return f"NIR has no neurons of type {type(block.neuron).__name__}; LIF is one"
        if block.learning is not None or block.noise is not None:
            return "NIR has no encoders that learn, and no noise"
        if graph.network.lengths[entry.name].get("groups", 1) > 1:
            return "several groups of neurons are one Ensemble each in NIR; write them so"
        if any(w.block == entry.name and w.port != "input" for w in graph.network.wires):
            return "NIR's neurons have the inputs that they encode alone; 'current' is wired"
    elif isinstance(block, Sum):
        if block.signs is not None and (block.signs < 0).any():
            return "a node of NIR adds what is wired to it; use a Gain of -1 for the sign"
    elif not isinstance(block, Gain):
        return f"NIR has no {entry.cls.__name__}; it has Ensemble, Decoder, Gain and Sum"
    return ""


class _Writer:
    """The nodes and edges of a NIR graph, block by block."""

    def __init__(self, graph: Graph, chosen: dict[str, NetworkEntry]) -> None:
        import nir

        self.nir, self.network, self.chosen = nir, graph.network, chosen
        self.session = graph.session()
        self.nodes: dict[str, Any] = {}
        self.edges: list[tuple[str, str]] = []
        self.inputs: list[str] = []
        self.outputs: list[str] = []
        # The first and the last node of each block.
        self.ends: dict[str, tuple[str, str]] = {}
        self.tunings: dict[str, Tuning] = {}
        self.lines: list[str] = []
        for name, entry in chosen.items():
            if isinstance(entry.block, Ensemble):
                self.tunings[name] = self._tuning(name, entry.block)

    def _tuning(self, name: str, block: Ensemble) -> Tuning:
        """The tuning of a population's neurons without refractory time."""
        gain, bias = (np.asarray(self.session.read(f"{name}.{s}")) for s in ("gain", "bias"))
        encoders = np.asarray(self.session.read(f"{name}.scaled_encoders")).T
        encoders = encoders * (block.radius / gain)[:, None]
        tau = _tau_of(block.neuron)
        most, ends = block.neuron.rates(gain + bias), (1.0 - bias) / gain
        # r = 1 / (tau log1p(1 / (J - 1))) at J of the largest rate; those silent there stay so.
        fires = most > 0.0
        above = 1.0 / np.expm1(1.0 / (tau * np.where(fires, most, 1.0)))
        new = np.where(fires, above / (1.0 - np.where(fires, ends, 0.0)), gain)
        shifted = np.where(fires, 1.0 - new * ends, bias)
        return Tuning(LIF(tau_rc=tau, tau_ref=NONE), new, shifted, encoders, block.radius)

    def add(self, entry: NetworkEntry) -> None:
        """The nodes of one block."""
        name, block = entry.name.replace(".", "_"), entry.block
        if isinstance(block, Ensemble):
            self._add_ensemble(name, entry.name, block)
        elif isinstance(block, Decoder):
            self._add_decoder(name, entry.name, block)
        elif isinstance(block, Gain):
            size = self._size(entry.name, "input")
            gain = block.gain if block.gain.ndim == 2 else np.diag(np.full(size, 1.0) * block.gain)
            self._chain(entry.name, {name: self.nir.Linear(weight=gain)})
        else:
            ones = np.ones(self._size(entry.name, "out"))
            self._chain(entry.name, {name: self.nir.Scale(scale=ones)})

    def _add_ensemble(self, name: str, block_name: str, block: Ensemble) -> None:
        tuning = self.tunings[block_name]
        ones = np.ones(len(tuning.gain))
        weight = tuning.encoders * (tuning.gain / block.radius)[:, None]
        tau = _tau_of(block.neuron)
        neurons = self.nir.LIF(
            tau=tau * ones, r=ones, v_leak=0.0 * ones, v_threshold=ones, v_reset=0.0 * ones
        )
        encoding = self.nir.Affine(weight=weight, bias=tuning.bias)
        self._chain(block_name, {f"{name}_encoders": encoding, name: neurons})
        self.lines.append(f"{block_name}: {len(ones)} LIF neurons without refractory time")

    def _add_decoder(self, name: str, block_name: str, block: Decoder) -> None:
        source = next(w.source.block for w in self.network.wires if w.block == block_name)
        if block.weights_given is not None:
            weights, text = block.weights_given, "weights as given, not solved for these neurons"
        elif source in self.tunings:
            rng = np.random.default_rng(self.network.seed)
            weights, error = block.solve(rng, self.tunings[source])
            text = f"weights solved for NIR's neurons, rms error {error:.3g}"
        else:
            weights = np.asarray(self.session.read(f"{block_name}.weights"))
            text = f"weights of {source}, which is not exported"
        nodes: dict[str, Any] = {f"{name}_weights": self.nir.Linear(weight=np.array(weights))}
        if block.synapse.label == "lowpass":
            ones = np.ones(len(weights))
            tau = _tau_of(block.synapse) * ones
            nodes[name] = self.nir.LI(tau=tau, r=ones, v_leak=0.0 * ones)
        self._chain(block_name, nodes)
        self.lines.append(f"{block_name}: {text}")

    def _chain(self, block: str, nodes: dict[str, Any]) -> None:
        """Add nodes that follow each other."""
        names = list(nodes)
        self.nodes |= nodes
        self.edges += pairwise(names)
        self.ends[block] = names[0], names[-1]

    def _size(self, block: str, port: str) -> int:
        kind = self.network.types[block, port]
        return int(np.prod(kind.shape, dtype=int))

    def connect(self) -> None:
        """The edges between blocks, and nodes for what comes from elsewhere or leaves."""
        read_inside: set[str] = set()
        left: set[str] = {port.end.block for port in self.network.outputs.values()}
        for wire in self.network.wires:
            source = wire.source
            if source.block in self.chosen and wire.block not in self.chosen:
                left.add(source.block)
            if wire.block not in self.chosen or wire.port in ("error", "learn"):
                continue
            read_inside.add(source.block)
            origin = self.ends[source.block][1] if source.block in self.chosen else ""
            origin = origin or self._input(source.block, source.port)
            if source.component:
                origin = self._component(origin, source)
            self.edges.append((origin, self.ends[wire.block][0]))
        for block in self._in_order(left, read_inside):
            last = self.ends[block][1]
            shape = np.array(self.nodes[last].output_type["output"])
            self.nodes[f"{last}_out"] = self.nir.Output({"output": shape})
            self.edges.append((last, f"{last}_out"))
            self.outputs.append(block)

    def _in_order(self, left: set[str], read: set[str]) -> Iterable[str]:
        """Blocks whose values leave: those that others read, and those that nobody does."""
        return [name for name in self.chosen if name in left or name not in read]

    def _input(self, block: str, port: str) -> str:
        own = [name for name, each in self.network.inputs.items() if each.end.block == block]
        name = own[0] if own else f"{block}_{port}".replace(".", "_")
        if name not in self.nodes:
            size = self._size(block, port)
            self.nodes[name] = self.nir.Input({"input": np.array([size])})
            self.inputs.append(name)
        return name

    def _component(self, origin: str, source: Any) -> str:
        """A node that passes on some components of another."""
        kind = self.network.types[source.block, source.port]
        size = self._size(source.block, source.port)
        rows: FloatArray = np.eye(size)[
            np.atleast_1d(np.arange(size)[columns(kind, source.component)])
        ]
        name = f"{origin}_{source.component}".replace(":", "_")
        if name not in self.nodes:
            self.nodes[name] = self.nir.Linear(weight=rows)
            self.edges.append((origin, name))
        return name

    def report(self, title: str) -> str:
        heads = [f"{title} as NIR", f"inputs: {', '.join(self.inputs)}"]
        heads.append(f"outputs: {', '.join(self.outputs)}")
        return "\n".join([*heads, *self.lines, "spikes are impulses of area 1", ""])


def _tau_of(model: Any) -> float:
    """The time constant of LIF neurons or of a lowpass, which their base classes do not have."""
    return float(model.tau_rc if isinstance(model, LIF) else model.tau)
