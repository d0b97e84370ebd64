"""Nengo's interface of a simulator on our engines, for models that stay in Python.

In: a network. Out: what ``nengo.Simulator`` gives, computed by a session of the imported graph::

    with Simulator(network) as simulator:
        simulator.run(1.0)
    simulator.data[probe]

Functions of nodes and of connections from nodes are called as they are, in each step.
"""

from __future__ import annotations

import secrets
import tempfile
import warnings
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from blocks.core import FloatArray
from runtime.errors import MissingExtraError, SimulationError

try:
    import nengo
except ImportError:
    raise MissingExtraError("running models of Nengo", "nengo") from None
from nengo.exceptions import SimulatorClosed, ValidationError

from runtime.graph import load
from spikeblocks.nengo.importing import import_network
from spikeblocks.nengo.live import CALLS


class Simulator:
    """Run a network of Nengo.

    Parameters
    ----------
    dt : step (s). seed : of what is drawn; default that of the network, or a random one.
    engine : python, compiled, or auto.
    progress_bar, optimize : are taken for Nengo's sake; nothing is shown.

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
        progress_bar: Any = None,
        optimize: Any = None,
    ) -> None:
        self.closed = True  # until there is something to close
        self.network, self.dt, self.engine = network, dt, engine
        self._calls: list[int] = []
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        if seed is None:
            # Drawn once, so that a reset has the same neurons.
            given = network.seed
            seed = secrets.randbelow(2**31 - 1) if given is None else given + 1
        self.seed = seed
        self._begin(None)

    def _begin(self, built: Any) -> None:
        self._forget()
        # Its files are read again when a run goes on past `until`.
        self._folder = tempfile.TemporaryDirectory()
        path = Path(self._folder.name) / "network.yaml"
        how: dict[str, Any] = {"dt": self.dt, "seed": self.seed, "live": True}
        done = import_network(self.network, path, built=built, **how)
        self._session = load(path).session(engine=self.engine)
        self._calls = done.converted.calls
        self._recordings = {
            each.probe: (name, each) for name, each in done.converted.recordings.items()
        }
        self._simulator = done.converted.simulator
        self.model, self._built = self._simulator.model, self._simulator.data
        self.closed, self._cleared = False, 0
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
            message = f"Must be positive (got {time_in_seconds:g})"
            raise ValidationError(message, attr="time_in_seconds", obj=self)
        steps = round(time_in_seconds / self.dt)
        if steps == 0:
            warnings.warn(f"{time_in_seconds:g} s are no step of {self.dt:g} s", stacklevel=2)
        self.run_steps(steps)

    def run_steps(self, steps: int, progress_bar: Any = None) -> None:
        """Run some steps.

        Raises
        ------
        SimulatorClosed : the simulator is closed. nengo.exceptions.SimulationError, or what a
        function of the network raises : a step failed.
        """
        self._check_open("run")
        try:
            self._session.step(steps)
        except SimulationError as error:
            cause = error.__cause__
            if isinstance(cause, Exception):
                raise cause from None
            raise nengo.exceptions.SimulationError(str(error)) from None

    def step(self) -> None:
        """Run one step."""
        self.run_steps(1)

    def reset(self, seed: int | None = None) -> None:
        """Begin again at 0, with the same neurons; with a seed, with other noise and processes."""
        self._check_open("reset")
        self.seed = self.seed if seed is None else seed
        self._begin(self._simulator)

    def clear_probes(self) -> None:
        """Forget what was recorded so far."""
        self._cleared = self.n_steps

    def trange(self, sample_every: float | None = None, dt: float | None = None) -> FloatArray:
        """The times (s) of the rows of probes, or of every so many seconds (formerly ``dt``)."""
        if dt is not None and sample_every is not None:
            raise ValidationError("Give sample_every alone, not dt as well", attr="dt", obj=self)
        if dt is not None:
            warnings.warn("dt is now called sample_every", DeprecationWarning, stacklevel=2)
            sample_every = dt
        return np.asarray(self.dt * (1.0 + self._sampled(sample_every, 0)))

    def close(self) -> None:
        """End the simulation; what was probed stays."""
        self.closed = True
        self._forget()

    def __enter__(self) -> Self:
        self._check_open("enter")
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def __del__(self) -> None:
        if not self.closed:
            message = "Simulator deallocated while open: close it, or use 'with'"
            warnings.warn(message, ResourceWarning, stacklevel=2)
            self._forget()

    def rows(self, probe: Any) -> FloatArray:
        """What a probe recorded, (rows, size)."""
        name, recording = self._recordings[probe]
        values = np.asarray(self._session.result()[name])
        if len(values) == 1 < self.n_steps and recording.every == 1:  # a constant
            values = np.repeat(values, self.n_steps, axis=0)
        if recording.late and self.n_steps:
            # A state is recorded before its step, and Nengo's row is from after it.
            values = values if recording.every > 1 else values[1:]
            if self.n_steps % recording.every == 0:
                last = np.asarray(self._session.read(recording.address))
                values = np.concatenate([values, last.reshape(1, *values.shape[1:])])
        rows = recording.rows(values)
        if recording.every > 1:
            return rows[self._cleared // recording.every :]
        return np.asarray(rows[self._sampled(probe.sample_every, self._cleared)])

    def _sampled(self, every: float | None, first: int) -> Any:
        """The steps after which there is a row, counted from 0."""
        steps = np.arange(first, self.n_steps)
        return steps if every is None else steps[(steps + 1) % (every / self.dt) < 1]

    def _check_open(self, what: str) -> None:
        if self.closed:
            raise SimulatorClosed(f"cannot {what}: the simulator is closed; make another one")

    def _forget(self) -> None:
        for number in self._calls:
            CALLS.pop(number, None)
        self._calls = []
        if self._folder is not None:
            self._folder.cleanup()
            self._folder = None


class _Data(Mapping[Any, Any]):
    """The recordings of probes, and what was built of other objects."""

    def __init__(self, simulator: Simulator) -> None:
        self.simulator = simulator

    def __getitem__(self, key: Any) -> Any:
        if key in self.simulator._recordings:
            return self.simulator.rows(key)
        return self.simulator._built[key]

    def __iter__(self) -> Iterator[Any]:
        return iter(self.simulator._built)

    def __len__(self) -> int:
        return len(self.simulator._built)
