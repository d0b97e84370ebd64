"""When a command may be sent: the states of a controller between topics, as a pure machine.

In: what arrives, with the time of a clock that this machine does not read. Out: a state, and the
command of each output, within its limits or zero::

    guard = Guard(inputs, outputs, dead_man)
    guard.accept("scan", Arrival(stamp, sender, sequence), now)   # '' or why it does not count
    if guard.update(now) is State.DRIVING: ...                    # compute commands
    guard.command("command", values, now)                         # limited; zero if not driving

::

    WAITING ──every input seen──▶ DRIVING ◀──fresh again── STALE
       ▲                          │     │ ──an input too old──▶ ▲
       └──── clock went back ─────┤     └──dead-man released──▶ HELD
                                  ▼                              (pressed again: DRIVING)
    STOPPED ◀── stop(): a signal, an exception, a command that is not finite; for good

All times are integers in ns: those of the clock here, monotonic, and the stamps of a sender's own.
Both may differ by anything; what counts is how much later than the fastest message one came.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from blocks.core import FloatArray
from spikeblocks.robot.messages import SECOND
from spikeblocks.robot.ports import Topic

# Two clocks drift apart by less than this; the fastest message is forgotten at this rate.
DRIFT = 1e-4
# A command is limited in its rate as if at most this time (s) had passed since the last one.
LONGEST_STEP = 0.1


class State(enum.Enum):
    """What a controller does: only DRIVING computes and sends commands that are not zero."""

    WAITING = "waiting for the first message of every input"
    DRIVING = "driving"
    STALE = "stopped: an input is too old"
    HELD = "stopped: the dead-man switch is released"
    STOPPED = "stopped for good"


@dataclass(frozen=True)
class Arrival:
    """How a message came: the sender's stamp (ns), the sender's identity and its count.

    A sender that starts again has another identity; its stamps and counts begin anew.
    """

    stamp: int
    sender: int
    sequence: int


@dataclass
class Freshness:
    """The age of an input's newest value: by how much it came later than the fastest message.

    A message counts if it is newer than the last one, and not later than ``timeout`` (ns). So what
    a network held back, repeats or reorders does not make a dead sender look alive. A sender's
    clock that goes back makes all its messages old: it must start again.
    """

    timeout: int
    sender: int | None = None
    stamp: int = 0  # of the newest value
    came: tuple[int, int] = (0, 0)  # sequence and stamp of the newest message, late ones included
    # Of the clock here before the sender's, by the fastest message; None if there is none yet.
    offset: float | None = None
    at: int = 0  # when that was brought up to date
    retired: set[int] = field(default_factory=set)

    def forget_ages(self) -> None:
        """The clock here has jumped: a message is needed that never came before."""
        self.offset = None

    def accept(self, arrival: Arrival, now: int) -> str:
        """Take a message; '' if it counts, or why it does not."""
        if arrival.sender in self.retired:
            return "of a sender that another one has replaced"
        delay = now - arrival.stamp
        if arrival.sender != self.sender:
            if self.sender is not None:
                self.retired.add(self.sender)
            self.sender, self.offset = arrival.sender, None
        elif arrival.sequence <= self.came[0] or arrival.stamp <= self.came[1]:
            return "not newer than the one before"
        self.came = arrival.sequence, arrival.stamp
        fastest = delay if self.offset is None else self.offset + DRIFT * max(0, now - self.at)
        if delay - fastest > self.timeout:
            return f"late by {(delay - fastest) / SECOND:.3g} s"
        self.offset, self.stamp, self.at = min(fastest, delay), arrival.stamp, now
        return ""

    def is_fresh(self, now: int) -> bool:
        """Whether the newest value still counts."""
        return self.offset is not None and now - self.stamp - self.offset <= self.timeout


class Guard:
    """The safety of a controller: see the module.

    Parameters
    ----------
    inputs, outputs : the topics with their time limits and bounds. dead_man : a topic that must be
    true and fresh, or None.
    """

    def __init__(
        self, inputs: Mapping[str, Topic], outputs: Mapping[str, Topic], dead_man: Topic | None
    ) -> None:
        self.state = State.WAITING
        self.reason = ""
        self._topics = {**inputs, **({} if dead_man is None else {dead_man.port: dead_man})}
        self._outputs = outputs
        self._dead_man = None if dead_man is None else dead_man.port
        self._is_pressed = dead_man is None
        self._now: int | None = None
        self._last: dict[str, tuple[FloatArray, int]] = {}
        self._fresh = {
            name: Freshness(round(topic.timeout * SECOND)) for name, topic in self._topics.items()
        }

    def accept(self, name: str, arrival: Arrival, now: int, value: float = 1.0) -> str:
        """Take a message that holds a value; '' if it counts, or why it does not.

        ``value`` is that of the dead-man switch.
        """
        self._check_clock(now)
        problem = self._fresh[name].accept(arrival, now)
        if name == self._dead_man:
            # A release counts even if it comes late or again; to press, a message must count.
            is_pressed = value > 0.5
            self._is_pressed = is_pressed and (self._is_pressed or not problem)
        return problem

    def update(self, now: int) -> State:
        """The state at a time."""
        self._check_clock(now)
        if self.state is State.STOPPED:
            return self.state
        stale = [name for name, fresh in self._fresh.items() if not fresh.is_fresh(now)]
        unseen = [name for name, fresh in self._fresh.items() if fresh.offset is None]
        if unseen:
            self._move(State.WAITING, ", ".join(unseen))
        elif [name for name in stale if name != self._dead_man]:
            self._move(State.STALE, ", ".join(stale))
        elif stale or not self._is_pressed:
            self._move(State.HELD, "no message" if stale else "released")
        else:
            self._move(State.DRIVING, "")
        return self.state

    def _move(self, state: State, reason: str) -> None:
        self.state, self.reason = state, reason
        if state is not State.DRIVING:
            self._last.clear()  # what comes next begins from zero

    def _check_clock(self, now: int) -> None:
        """Forget the ages of all inputs if the clock went back."""
        if self._now is not None and now < self._now and self.state is not State.STOPPED:
            for fresh in self._fresh.values():
                fresh.forget_ages()
            self._move(State.WAITING, "the clock went back")
        self._now = now

    def stop(self, reason: str) -> None:
        """Stop for good; every later command is zero."""
        self._move(State.STOPPED, reason)

    def command(self, name: str, values: FloatArray, now: int) -> FloatArray:
        """The command to send for what was computed: within its limits, zero if not driving.

        What is not finite stops for good.
        """
        topic = self._outputs[name]
        zero = np.zeros(topic.codec.signal.shape)
        if self.update(now) is not State.DRIVING:
            return zero
        if not np.isfinite(values).all():
            self.stop(f"output '{name}' is not finite: {values}")
            return zero
        before, at = self._last.get(name, (zero, now))
        step = min(LONGEST_STEP, (now - at) / SECOND)
        with np.errstate(invalid="ignore"):  # an infinite rate at no time
            most = np.where(np.isinf(topic.rate), math.inf, topic.rate * step)
        limited = np.clip(np.clip(values, topic.low, topic.high), before - most, before + most)
        self._last[name] = limited, now
        return limited
