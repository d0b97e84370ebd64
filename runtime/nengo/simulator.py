"""Nengo's interface of a simulator on our engines, for models that stay in Python.

In: a network. Out: what ``nengo.Simulator`` gives, computed by a session of the imported graph::

    with Simulator(network) as simulator:
        simulator.run(1.0)
    simulator.data[probe]
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import nengo
import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.graph import load
from runtime.nengo.importing import import_network


class Simulator:
    """Run a network of Nengo.

    Parameters
    ----------
    dt : step (s). seed : of what is drawn; default that of the network, or a random one.
    engine : python, compiled, or auto.
    recorded : how long (s) processes are recorded for; after that their last value holds.

    Raises
    ------
    UsageError : the network contains what graphs do not have.
    """

    def __init__(
        self,
        network: Any,
        dt: float = 0.001,
        seed: int | None = None,
        *,
        engine: str = "auto",
        recorded: float = 10.0,
        progress_bar: Any = None,
        optimize: Any = None,
    ) -> None:
        self.network, self.dt, self.engine, self.recorded = network, dt, engine, recorded
        self.closed = False
        self._begin(seed)

    def _begin(self, seed: int | None) -> None:
        if seed is None:
            # Drawn once, so that the neurons of `data` are those that run.
            given = self.network.seed
            seed = int(np.random.default_rng().integers(2**31 - 1)) if given is None else given
        self.seed = seed
        # Its files are read when the graph is loaded, and not needed after that.
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "network.yaml"
            done = import_network(self.network, path, dt=self.dt, seed=seed, until=self.recorded)
            self._addresses = {n: str(of) for n, of in done.converted.probes.items()}
            self._probes = {probe: (name, late) for name, (probe, late) in done.late.items()}
            self._session = load(path).session(engine=self.engine)
        with nengo.Simulator(
            self.network, dt=self.dt, seed=seed, progress_bar=False, optimize=False
        ) as built:
            self._built = built.data
        self.data: Mapping[Any, Any] = _Data(self)

    @property
    def n_steps(self) -> int:
        """How many steps are done."""
        return self._session.tick

    @property
    def time(self) -> float:
        """The time (s) at the end of the last step."""
        return self.n_steps * self.dt

    def run(self, time_in_seconds: float, progress_bar: Any = None) -> None:
        """Run for a time (s), rounded to whole steps."""
        if time_in_seconds < 0.0:
            raise UsageError(f"expected a time of at least 0, got {time_in_seconds}")
        self.run_steps(round(time_in_seconds / self.dt))

    def run_steps(self, steps: int, progress_bar: Any = None) -> None:
        """Run some steps."""
        if self.closed:
            raise UsageError("the simulator is closed; make another one")
        self._session.step(steps)

    def step(self) -> None:
        """Run one step."""
        self.run_steps(1)

    def reset(self, seed: int | None = None) -> None:
        """Begin again at 0; with another seed, with other neurons where the network has none."""
        if self.closed:
            raise UsageError("the simulator is closed; make another one")
        self._begin(self.seed if seed is None else seed)

    def trange(self, sample_every: float | None = None) -> FloatArray:
        """The times (s) of the rows of probes, or of every so many seconds."""
        every = 1 if sample_every is None else round(sample_every / self.dt)
        return np.array([k * self.dt for k in range(every, self.n_steps + 1, every)])

    def close(self) -> None:
        """End the simulation; what was probed stays."""
        self.closed = True

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def rows(self, probe: Any) -> FloatArray:
        """What a probe recorded, (steps, size)."""
        name, late = self._probes[probe]
        if self.n_steps == 0:
            return np.zeros((0, probe.size_in))
        values = np.asarray(self._session.result()[name])
        if late:
            # A state is recorded before its step, and Nengo's row is from after it.
            last = self._session.read(self._addresses[name])
            values = np.concatenate([values[1:], np.asarray(last)[None]])
        return values.reshape(len(values), -1) if values.ndim == 1 else values


class _Data(Mapping[Any, Any]):
    """The recordings of probes, and what was built of other objects."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def __getitem__(self, key: Any) -> Any:
        if key in self.simulator._probes:
            return self.simulator.rows(key)
        return self.simulator._built[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.simulator._built)

    def __len__(self) -> int:
        return len(self.simulator._built)
