"""A session between topics: what arrives is written to its inputs, its outputs are sent.

In: a checked graph, its ports, an adapter. Out: a session that has run in real time, with what
arrived, what did not count and why, and how late the loop was::

    driver = Driver(graph, ports, adapter)
    driver.run(60.0)            # s; ends early with an exception, after zero commands
    driver.facts()              # {"state": "driving", "received": {"scan": 600}, "late_s": ...}

The controller computes only while it may drive (:mod:`spikeblocks.robot.safety`), so that a gap of
its inputs is none of the graph's time: nothing is learnt from it. A plant never waits; without a
fresh command its inputs are zero.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from blocks.core import FloatArray
from runtime.errors import UsageError
from runtime.graph import Graph
from runtime.runs import Pacing
from spikeblocks.robot.bags import BagWriter
from spikeblocks.robot.messages import SECOND
from spikeblocks.robot.ports import DEAD_MAN, Ports
from spikeblocks.robot.safety import Guard, State
from spikeblocks.robot.transports import Adapter, Received

FINAL = 3  # zero commands at the end, since one may be lost


class Driver:
    """Runs a graph between the topics of an adapter.

    Parameters
    ----------
    graph, ports : the ports are those of the graph. adapter : it is opened and closed by ``run``.
    is_plant : the graph is a robot and not its controller: it never waits.
    log : a bag for every message that counts, and every command.
    now, sleep : the clock, monotonic in ns, and what waits, in s.

    Raises
    ------
    UsageError : the period is not a whole number of ticks, or the graph has no topic.
    """

    def __init__(
        self,
        graph: Graph,
        ports: Ports,
        adapter: Adapter,
        *,
        is_plant: bool = False,
        log: BagWriter | None = None,
        now: Callable[[], int] = time.monotonic_ns,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        network = graph.network
        self.ticks = round(ports.period / network.dt)
        if network.time_unit != "s" or abs(self.ticks * network.dt - ports.period) > 1e-9:
            expected = f"a whole number of ticks of {network.dt:g} {network.time_unit}"
            raise UsageError(f"period: expected {expected}, got {ports.period:g} s")
        for side, topics in (("inputs", ports.inputs), ("outputs", ports.outputs)):
            if not topics:
                raise UsageError(f"{ports.path}: no port of the graph has a topic in '{side}'")
        self.ports, self.adapter, self.is_plant, self.log = ports, adapter, is_plant, log
        self.session = graph.session()
        self.guard = Guard(ports.inputs, ports.outputs, ports.dead_man)
        self.pacing = Pacing(now=now, sleep=sleep)
        self.received: Counter[str] = Counter()
        self.dropped: Counter[str] = Counter()
        self.first_dropped: dict[str, str] = {}
        self.sent: Counter[str] = Counter()
        self.states: Counter[State] = Counter()
        self.changes: list[tuple[float, str]] = []
        self._inputs = network.inputs
        self._ends = {name: str(network.outputs[name].end) for name in ports.outputs}
        self._last_sent: dict[str, tuple[bytes, int]] = {}
        self._began = now()
        self._epoch = time.time_ns() - self._began

    def run(self, seconds: float, progress: Callable[[State], None] | None = None) -> None:
        """Drive for a time; whatever ends it, zero commands are sent last.

        Raises
        ------
        SimulationError, KeyboardInterrupt : the loop ended early, after the zero commands.
        """
        self.adapter.open()
        try:
            period = 1e9 * self.ports.period
            self._began = self.pacing.now()
            for _ in self.pacing.periods(period, round(seconds / self.ports.period)):
                self.step()
                if progress is not None:
                    progress(self.guard.state)
            self.stop("the time is over")
        except BaseException as error:
            self.stop(f"{type(error).__name__}: {error}".rstrip(": "))
            raise
        finally:
            self.adapter.close()

    def step(self) -> State:
        """One period: take what has come, compute, send."""
        for message in self.adapter.receive():
            self._take(message)
        before, state = self.guard.state, self.guard.update(self.pacing.now())
        self.states[state] += 1
        if self.is_plant:
            if state is not State.DRIVING:
                for name, topic in self.ports.inputs.items():
                    self.session.write(name, np.zeros(topic.codec.signal.shape))
            self.session.step(self.ticks)
        elif state is State.DRIVING:
            self.session.step(self.ticks)
        self._send()
        self._note_change(before)
        return self.guard.state

    def _take(self, message: Received) -> None:
        """Count a message, and write its value to the session if it counts."""
        name, arrival, values, problem = message
        now = self.pacing.now()
        if values is not None and name != DEAD_MAN:
            try:
                values = self._inputs[name].value(values)
            except ValueError as error:
                problem = str(error)
        if values is not None and not problem:
            value = float(values) if name == DEAD_MAN else 1.0
            problem = self.guard.accept(name, arrival, now, value)
        if problem or values is None:
            self.dropped[name or "-"] += 1
            self.first_dropped.setdefault(name or "-", problem)
            return
        self.received[name] += 1
        if name != DEAD_MAN:
            self.session.write(name, values)
            self._record(self.ports.inputs[name].name, self.ports.inputs[name].codec, values)

    def _send(self) -> None:
        """Send every output; of a plant those that have changed, or that would become too old."""
        now = self.pacing.now()
        for name, topic in self.ports.outputs.items():
            if self.is_plant:
                values = np.asarray(self.session.read(self._ends[name]))
                content, at = values.tobytes(), now
                last = self._last_sent.get(name)
                if last is not None and last[0] == content and now - last[1] < SECOND / 10:
                    continue
                self._last_sent[name] = content, at
            else:
                values = np.zeros(topic.codec.signal.shape)
                if self.guard.state is State.DRIVING:
                    values = np.asarray(self.session.read(self._ends[name]))
                values = self.guard.command(name, values, now)
            self._send_one(name, values)

    def _send_one(self, name: str, values: FloatArray) -> None:
        topic = self.ports.outputs[name]
        try:
            self.adapter.send(topic, values)
        except OSError as error:
            self.dropped[f"{name} (to send)"] += 1
            self.first_dropped.setdefault(f"{name} (to send)", str(error))
            return
        self.sent[name] += 1
        self._record(topic.name, topic.codec, values)

    def _record(self, topic: str, codec: Any, values: FloatArray) -> None:
        if self.log is not None:
            self.log.write(topic, codec, values, self._epoch + self.pacing.now())

    def _note_change(self, before: State) -> None:
        if self.guard.state is not before:
            at = (self.pacing.now() - self._began) / SECOND
            why = f" ({self.guard.reason})" if self.guard.reason else ""
            self.changes.append((at, f"{self.guard.state.value}{why}"))

    def stop(self, reason: str) -> None:
        """Stop for good: zero commands, which are sent even if the loop has failed."""
        before = self.guard.state
        self.guard.stop(self.guard.reason if before is State.STOPPED else reason)
        self._note_change(before)
        if self.is_plant:
            return
        for _ in range(FINAL):
            for name, topic in self.ports.outputs.items():
                self._send_one(name, np.zeros(topic.codec.signal.shape))

    def facts(self) -> dict[str, Any]:
        """What happened, as plain values; times in s."""
        figures = self.pacing.figures()
        return {
            "seconds": self.session.t,
            "states": {state.name.lower(): count for state, count in self.states.items()},
            "changes": [{"at": at, "state": text} for at, text in self.changes],
            "received": dict(self.received),
            "sent": dict(self.sent),
            "dropped": {
                name: {"messages": count, "first": self.first_dropped[name]}
                for name, count in self.dropped.items()
            },
            "period_s": figures["period_s"],
            "late_s": figures["late_s"],
            "overruns": figures["overruns"],
        }
