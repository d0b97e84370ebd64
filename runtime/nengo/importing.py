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

from runtime.graph import load
from runtime.nengo.conversion import Converted, Options, convert
from runtime.nengo.reading import names, read_network
from runtime.nengo.writing import files, write


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
    def late(self) -> dict[str, tuple[Any, int]]:
        """For each probe's name Nengo's probe, and how many rows later ours are."""
        return {n: (each.probe, each.late) for n, each in self.converted.recordings.items()}

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
        told = {}
        for name, mine in ours.items():
            other = theirs[name]
            if name.startswith("spikes of "):
                same = np.array_equal(mine, other)
                count = int(np.count_nonzero(other))
                different = int(np.count_nonzero((mine != 0.0) != (other != 0.0)))
                told[name] = f"equal ({count})" if same else f"{different} of {count} differ"
            else:
                told[name] = f"largest difference {np.abs(mine - other).max(initial=0.0):.2g}"
        return told


def run_both(
    imported: Imported, until: float, engine: str = "auto"
) -> tuple[dict[str, np.ndarray[Any, Any]], dict[str, np.ndarray[Any, Any]]]:
    """Spikes and probes of the graph and of Nengo, rows of the same times side by side."""
    dt, steps = imported.options.dt, round(until / imported.options.dt)
    graph = load(imported.files[0]).set("run.until", (steps + 2) * dt)
    populations, late = imported.converted.populations, imported.late
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
        for name, (probe, shift) in late.items():
            values = np.asarray(simulator.data[probe])
            mine = np.asarray(result[name])
            every = round(probe.sample_every / dt) if probe.sample_every else 1
            if every == 1:
                theirs[name] = values
                ours[name] = mine[shift : shift + len(values)].reshape(values.shape)
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
    **options: Any,
) -> Imported:
    """Write a network as a graph, and check the graph.

    Parameters
    ----------
    variables : names of objects of the network. options : those of :class:`Options`.

    Raises
    ------
    UsageError : the network has something that graphs do not have.
    GraphError : the graph is wrong.
    """
    chosen = Options(**options)
    converted = convert(network, names(network, variables or {}), chosen)
    title = title or network.label or path.stem
    written = write(path, *files(converted, chosen, title, path))
    load(path).check()
    return Imported(network, converted, chosen, written)


def import_file(source: str, path: Path, **options: Any) -> Imported:
    """Write the network of a Python file as a graph; ``options`` as for :func:`import_network`."""
    network, variables = read_network(source)
    title = Path(source.partition(":")[0]).stem
    return import_network(network, path, variables, title=title, **options)
