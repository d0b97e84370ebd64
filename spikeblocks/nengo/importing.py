"""A Nengo model as files of a graph, checked, and compared with Nengo's own run.

In: a Python file, or a network. Out: :class:`Imported`, and the files::

    import_network(network, Path("my.yaml"), names).compare()     # {'spikes of a': 'equal (412)'}
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.graph import load
from spikeblocks.nengo.conversion import convert
from spikeblocks.nengo.converted import Converted, Options
from spikeblocks.nengo.reading import names, read_network
from spikeblocks.nengo.writing import files, write

TOLERANCE = 1e-6  # of the largest value: rounding, after some seconds of a recurrent network


@dataclass(frozen=True)
class Imported:
    """A network and the graph that was made of it."""

    network: Any
    converted: Converted
    options: Options
    files: list[Path]

    @property
    def blocks(self) -> int:
        return len(self.converted.blocks)

    @property
    def notes(self) -> list[str]:
        return self.converted.notes

    def summary(self) -> str:
        """Files, sizes and notes."""
        lines = [f"{', '.join(map(str, self.files))}: {self.blocks} blocks"]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def compare(self, until: float | None = None, engine: str = "auto") -> dict[str, str]:
        """Run both, and compare the spikes of each population and what is probed."""
        until = self.options.until if until is None else until
        ours, theirs = run_both(self, until, engine)
        return {name: compared(name, mine, theirs[name]) for name, mine in ours.items()}


def compared(name: str, mine: FloatArray, other: FloatArray) -> str:
    """In words how far one recording is from another; :func:`is_equal` tells apart what it says."""
    if mine.shape != other.shape:
        return f"differs: {len(mine)} rows of {mine.shape[1:]}, Nengo has {other.shape}"
    largest = float(np.abs(mine - other).max(initial=0.0))
    if not name.startswith("spikes of "):
        scale = float(np.abs(other).max(initial=0.0))
        fits = largest <= TOLERANCE * max(scale, 1e-6)
        return f"{'' if fits else 'differs: '}largest difference {largest:.2g}"
    count = int(np.count_nonzero(other))
    if np.array_equal(mine, other):
        return f"equal ({count})"
    different = int(np.count_nonzero((mine != 0.0) != (other != 0.0)))
    if different:
        return f"differs: {different} of {count} differ"
    # Of rates, of which hardly one is 0: how large they are is the difference.
    fits = largest <= TOLERANCE * float(np.abs(other).max(initial=1.0))
    return f"{'equal' if fits else 'differs:'} ({count}), largest difference {largest:.2g} Hz"


def is_equal(told: str) -> bool:
    """Whether what :func:`compared` says is no difference beyond rounding."""
    return not told.startswith("differs")


def run_both(
    imported: Imported, until: float, engine: str = "auto"
) -> tuple[dict[str, np.ndarray[Any, Any]], dict[str, np.ndarray[Any, Any]]]:
    """Spikes and probes of the graph and of Nengo, rows of the same times side by side."""
    dt, steps = imported.options.dt, round(until / imported.options.dt)
    graph = load(imported.files[0]).set("run.until", (steps + 2) * dt)
    populations = imported.converted.populations
    for name in populations:
        graph = graph.probe(f"{name}_spikes_", f"{name}.fired")
    result = graph.run(engine=engine)
    with imported.network:
        added = {
            name: [nengo.Probe(member.neurons) for member in population.members]
            for name, population in populations.items()
        }
    try:
        simulator = nengo.Simulator(
            imported.network, dt=dt, seed=imported.options.seed, progress_bar=False
        )
        with simulator:
            simulator.run_steps(steps, progress_bar=False)
        ours, theirs = {}, {}
        for name, probes in added.items():
            both = f"spikes of {name}"
            theirs[both] = np.concatenate([simulator.data[p] for p in probes], axis=1)
            ours[both] = result[f"{name}_spikes_"][:steps]
        for name, found in imported.converted.recordings.items():
            theirs[name] = np.asarray(simulator.data[found.probe])
            mine, count = np.asarray(result[name]), len(theirs[name])
            if found.constant or (len(mine) == 1 < count):  # recorded once
                mine = np.repeat(mine[:1], count + found.late, axis=0)
            first = found.late if found.every == 1 else 0  # or the probe begins later
            mine = mine[first : first + count]
            if found.then is not None:
                mine = found.then(mine)
            fits = mine.size == theirs[name].size
            ours[name] = mine.reshape(theirs[name].shape) if fits else mine
    finally:
        for probes in added.values():
            for probe in probes:
                imported.network.probes.remove(probe)
    return ours, theirs


def import_network(
    network: Any,
    path: Path,
    variables: Mapping[str, Any] | None = None,
    *,
    title: str = "",
    built: Any = None,
    **options: Any,
) -> Imported:
    """Write a network as a graph, and check the graph.

    Parameters
    ----------
    variables : names of objects of the network. built : Nengo's simulator of it, whose neurons are
    taken. options : those of :class:`Options`.

    Raises
    ------
    UsageError : the network has something that graphs do not have.
    GraphError : the graph is wrong.
    """
    chosen = Options(**options)
    converted = convert(network, names(network, variables or {}), chosen, built)
    title = title or network.label or path.stem
    written = write(path, *files(converted, chosen, title, path))
    load(path).check()
    return Imported(network, converted, chosen, written)


def import_file(source: str, path: Path, **options: Any) -> Imported:
    """Write the network of a Python file as a graph; ``options`` as for :func:`import_network`."""
    network, variables = read_network(source)
    title = Path(source.partition(":")[0]).stem
    return import_network(network, path, variables, title=title, **options)
