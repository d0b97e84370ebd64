"""A graph as an environment of Gymnasium: a session that one action after the other moves on.

In: a graph, and what its reward is. Out: an environment. One step::

    write the action to the inputs ─▶ steps ticks ─▶ read the outputs, the reward, and the end
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

from runtime.errors import UsageError
from runtime.graph import Graph, load
from runtime.sessions import Session
from spikeblocks.gym.ports import Ports

Changes = Mapping[str, Any]
# A function of (observation, action, info).
Judged = Callable[[Any, Any, dict[str, Any]], Any]
STARTS = 32  # seeds whose first state is kept in memory
# What is made of each section, and how one is written.
SECTIONS = {
    "inputs": ("actions", "{push: {type: Scalar, min: -1, max: 1, default: 0}}"),
    "outputs": ("observations", "{angle: cart.angle}"),
}


class GraphEnv(gymnasium.Env):  # type: ignore[misc]
    """An environment whose actions are a graph's ``inputs`` and whose observations its ``outputs``.

    Parameters
    ----------
    graph : a graph, or the name, path or content of one, as for :func:`runtime.load`.
    reward : the address of a number, read after each step, or a function of (observation, action,
        info) that returns one.
    terminated : the address of a number that is not zero where an episode ends, or a function
        of (observation, action, info). ``run.stop`` ends one, too; it is tested at each tick.
    steps : how many ticks an action lasts.
    engine : "python", "compiled" or "auto"; by default the graph's own.
    start : a function of a NumPy generator, of the episode's seed, that returns what differs in
        this episode: ``{"cart.x0": [0, 0, 0.1, 0], "cart.length": 0.6}``.
    info : addresses that are read after each step into ``info``.
    as_dict : whether actions and observations are Dicts, with a Box for each port, and not one Box
        with the numbers of all ports in order.

    An episode is truncated at ``run.until``. ``info["t"]`` is the time. ``session`` is the
    episode's session, whose ``result()`` has the recordings, metrics and plots.

    Raises
    ------
    GraphError : the graph is wrong. UsageError : it has no inputs or no outputs, or there is no
    such address. MissingExtraError : gymnasium is not installed.
    """

    metadata: Mapping[str, Any] = {"render_modes": []}

    def __init__(
        self,
        graph: Graph | str | Path | Mapping[str, Any],
        *,
        reward: str | Judged,
        terminated: str | Judged | None = None,
        steps: int = 10,
        engine: str | None = None,
        start: Callable[[np.random.Generator], Changes] | None = None,
        info: Sequence[str] = (),
        as_dict: bool = False,
    ) -> None:
        if not (isinstance(steps, int) and steps >= 1):
            raise UsageError(f"steps: expected a whole number of at least 1 tick, got {steps!r}")
        loaded = graph if isinstance(graph, Graph) else load(graph)
        self.graph = loaded if engine is None else loaded.set("run.engine", engine)
        self.steps, self.reward, self.terminated = steps, reward, terminated
        self._start, self._info = start, tuple(info)
        network = self.graph.network
        for section, (what, example) in SECTIONS.items():
            if not getattr(network, section):
                message = f"has no section '{section}', which {what} are made of, as in"
                raise UsageError(f"graph '{network.title}' {message} {section}: {example}")
        self._actions = Ports(network.inputs, as_dict)
        self._observations = Ports(network.outputs, as_dict)
        self.action_space, self.observation_space = self._actions.space, self._observations.space
        # What is read after each step: of a port, the reward, the end, and the info.
        judged = [what for what in (reward, terminated) if isinstance(what, str)]
        seen = [str(port.end) for port in network.outputs.values()]
        self._read = tuple(dict.fromkeys([*seen, *judged, *self._info]))
        # By place and not by address: of the 25 us of a small graph's step, a dict takes 1.
        self._at = {address: place for place, address in enumerate(self._read)}
        self._seen_at = [self._at[address] for address in seen]
        self._last = network.ticks
        self._starts: dict[int, tuple[Session, Any]] = {}
        self._session: Session | None = None
        self._check_addresses(self._begun(network.seed, {}))

    def _check_addresses(self, session: Session) -> None:
        for name, what in (("reward", self.reward), ("terminated", self.terminated)):
            if isinstance(what, str):
                value = session.read(what)
                if not isinstance(value, float):
                    message = f"{name}: '{what}' has {np.size(value)} numbers; name one"
                    raise UsageError(f"{message}, as in {what}.0")
            elif not (callable(what) or (what is None and name == "terminated")):
                raise UsageError(f"{name}: expected an address or a function, got {what!r}")
        for address in self._info:
            session.read(address)

    @property
    def session(self) -> Session:
        """The session of the episode.

        Raises
        ------
        gymnasium.error.ResetNeeded : none has begun.
        """
        if self._session is None:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        return self._session

    @property
    def dt(self) -> float:
        """How long an action lasts, in the graph's time unit."""
        return self.steps * float(self.graph.network.dt)

    def reset(
        self, *, seed: int | None = None, options: Changes | None = None
    ) -> tuple[Any, dict[str, Any]]:
        """Begin an episode; returns the first observation and the info.

        Parameters
        ----------
        seed : of the graph's noise and neurons, and of ``start``; by default one from the
            environment's own generator.
        options : what differs in this episode, as ``start`` returns it.
        """
        super().reset(seed=seed)
        if seed is None:
            session = self._new(
                int(self.np_random.integers(2**31)), {} if options is None else options
            )
        else:
            session = self._begun(seed, {} if options is None else options)
        self._session = session
        observation, info, _ = self._look(session)
        return observation, info

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        """Write the action, let its ticks pass, and read what comes of it.

        Raises
        ------
        UsageError : the action is not one of ``action_space``. SimulationError : a block failed.
        """
        session = self.session
        for name, value in self._actions.split(action):
            session.write(name, value)
        session.step(max(0, min(self.steps, self._last - session.tick)))
        observation, info, values = self._look(session)
        reward = self._judged("reward", self.reward, values, observation, action, info)
        ended = self.terminated is not None and bool(
            self._judged("terminated", self.terminated, values, observation, action, info)
        )
        truncated = session.tick >= self._last
        return observation, reward, ended or session.stopped, truncated, info

    def close(self) -> None:
        self._starts.clear()
        self._session = None

    def _judged(self, name: str, what: str | Judged, values: Sequence[Any], *of: Any) -> float:
        if isinstance(what, str):
            return float(values[self._at[what]])
        value = what(*of)
        try:
            return float(value)
        except (TypeError, ValueError):
            raise UsageError(f"{name}: expected a number, got {value!r}") from None

    def _look(self, session: Session) -> tuple[Any, dict[str, Any], Sequence[Any]]:
        """The observation, the info, and what was read, in the order of ``_read``."""
        values = session.read(*self._read)
        if len(self._read) == 1:
            values = (values,)
        observation = self._observations.join([values[place] for place in self._seen_at])
        info: dict[str, Any] = {"t": session.t}
        for address in self._info:
            info[address] = values[self._at[address]]
        return observation, info, values

    def _begun(self, seed: int, options: Changes) -> Session:
        """A session at tick 0 for a seed that was asked for, and may be again."""
        if options:
            return self._new(seed, options)
        if seed in self._starts:
            session, first = self._starts[seed]
            session.restore(first)
            return session
        session = self._new(seed, {})
        if len(self._starts) == STARTS:
            del self._starts[next(iter(self._starts))]
        self._starts[seed] = session, session.snapshot()
        return session

    def _new(self, seed: int, options: Changes) -> Session:
        graph = self.graph
        start = {} if self._start is None else self._start(np.random.default_rng(seed))
        for name, changes in (("start", start), ("options", options)):
            if not isinstance(changes, Mapping):
                message = "expected values by their addresses, as in {'cart.length': 0.6}"
                raise UsageError(f"{name}: {message}, got {changes!r}")
        for path, value in {**start, **options}.items():
            is_array = isinstance(value, (np.ndarray, np.generic))
            graph = graph.set(path, value.tolist() if is_array else value)
        return graph.session(seed=seed)
