"""The process that owns the session: it runs, is changed between two ticks, and sends frames.

In: messages through a pipe, such as ``("play", {})`` and ``("text", {...})``. Out: messages and
frames. It can be killed at any time: the server has the text, the seed and the log, from which a
new process computes the same state. The next graph is read and compiled in a thread while the
present one runs.
"""

from __future__ import annotations

import contextlib
import math
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from runtime.document import parse_yaml
from runtime.errors import GraphError, SpikeblocksError
from runtime.graph import Graph
from runtime.language import Surroundings
from runtime.sessions import Became, Session, SessionSnapshot
from spikeblocks.studio.plots import Views, views_of
from spikeblocks.studio.streams import Streams, pack

FRAME = 1 / 30  # s between two frames
CHUNK = 0.008  # s of computation between two looks at the pipe
BEHIND = 0.25  # s that a run may lag behind before its clock is set again
SNAPSHOTS = 400
IDLE = 0.5  # s


def graph_of(text: str, path: Path, modules: bool) -> Graph:
    """The graph of a text that need not be saved.

    Raises
    ------
    GraphError : it cannot be read.
    """
    document, problems = Surroundings(modules=modules).complete(parse_yaml(text, str(path)), path)
    if problems:
        raise GraphError(problems)
    return Graph.of_document(document, path, modules)


class Worker:
    """One session and its clock."""

    def __init__(self, pipe: Connection) -> None:
        self.pipe = pipe
        self.session: Session | None = None
        self.playing, self.speed = False, 1.0
        self.watched: tuple[str, ...] = ()
        self.snapshots: list[SessionSnapshot] = []
        self.interval = 1
        self.due_snapshot = 0  # the tick at which the next one is taken
        self.chunk = 1
        self.anchor = (0.0, 0)  # the time of the clock, and the tick, from which on it runs
        self.sent_at = 0.0
        self.is_dirty = False
        self.logged = 0
        self.thread = ThreadPoolExecutor(1)
        self.next: tuple[int, Future[Graph]] | None = None

    # The loop

    def serve(self) -> None:
        """Serve until the pipe is closed."""
        while True:
            try:
                messages: list[tuple[str, dict[str, Any]]] = []
                while self.pipe.poll(0.0 if messages else self._wait()):
                    messages.append(self.pipe.recv())
            except (EOFError, OSError):
                return
            for i, (name, given) in enumerate(messages):
                # Of a slider that moves, the last position is enough.
                later = [g.get("path") for n, g in messages[i + 1 :] if n == name == "set"]
                if name != "set" or given["path"] not in later:
                    self.receive(name, given)
            self.follow()
            if self.playing:
                self.advance()
            if self.is_dirty and time.monotonic() - self.sent_at >= FRAME:
                self.send_frame()

    def _wait(self) -> float:
        """How long nothing has to be done, s."""
        now, session = time.monotonic(), self.session
        wait = IDLE if self.next is None else 0.01
        if self.is_dirty:
            wait = min(wait, self.sent_at + FRAME - now)
        if self.playing and session is not None:
            wait = min(wait, 0.0 if self._due(session) > session.tick else 0.002)
        return max(0.0, wait)

    def receive(self, name: str, given: dict[str, Any]) -> None:
        """Carry out one message; what fails is told to the page."""
        try:
            handler: Callable[..., None] = getattr(self, f"on_{name}")
            handler(**given)
        except SpikeblocksError as error:
            self.tell("failed", text=str(error), what=name)

    def tell(self, kind: str, **values: Any) -> None:
        """Send a message to the server."""
        self.pipe.send((kind, values))

    # Time

    def _due(self, session: Session) -> int:
        """The tick that the clock has come to."""
        network = session.graph.network
        if math.isinf(self.speed):
            return network.ticks
        began, first = self.anchor
        passed = (time.monotonic() - began) * self.speed
        return min(network.ticks, first + int(passed / network.dt))

    def set_clock(self) -> None:
        """Let the clock run from now on."""
        self.anchor = (time.monotonic(), self.session.tick if self.session else 0)

    def advance(self) -> None:
        """Do the ticks that are due, for some milliseconds."""
        session = self.session
        if session is None:
            return
        due = self._due(session)
        ticks = min(due - session.tick, self.chunk, self.due_snapshot - session.tick)
        if ticks > 0:
            began = time.monotonic()
            self.step(ticks)
            took = time.monotonic() - began
            if ticks == self.chunk or took > CHUNK:
                self.chunk = max(1, min(100_000, round(ticks * CHUNK / max(took, 1e-5))))
        network = session.graph.network
        left = (due - session.tick) * network.dt
        if not math.isinf(self.speed) and left > BEHIND * self.speed:
            self.set_clock()
            self.tell("slow", speed=self.speed)
        if session.tick >= network.ticks or session.stopped:
            self.pause()

    def step(self, ticks: int) -> None:
        """Do some ticks, with snapshots in between; a failure ends the play."""
        session = self.session
        if session is None:
            return
        self.is_dirty = True
        last = session.tick + ticks
        while session.tick < last and not session.stopped:
            try:
                session.step(min(last, max(self.due_snapshot, session.tick + 1)) - session.tick)
            except SpikeblocksError as error:
                self.playing = False
                self.tell("failed", text=str(error), what="run")
                self.tell_state()
                return
            if session.tick >= self.due_snapshot:
                self.take_snapshot()

    def pause(self) -> None:
        """Stop the clock."""
        if self.playing:
            self.playing = False
            self.tell_state()

    # Snapshots

    def take_snapshot(self) -> None:
        """Keep the present state; if there are many, every second one is dropped."""
        if self.session is None:
            return
        with contextlib.suppress(SpikeblocksError):  # after a failure, or what cannot be copied
            self.snapshots.append(self.session.snapshot(rows=False))
        self.due_snapshot = self.session.tick + self.interval
        if len(self.snapshots) > SNAPSHOTS:
            self.snapshots = self.snapshots[::2]
            self.interval *= 2

    def go_to(self, tick: int) -> None:
        """Come to a tick: forth by running, back from a snapshot and what was logged since."""
        session = self.session
        if session is None or tick < 0:
            return
        # At the tick itself nothing is lost of what was changed there.
        log = [change for change in session.log if change.tick <= tick]
        if tick < session.tick or _has_failed(session):
            kept = [each for each in self.snapshots if each.carried.tick <= tick]
            if not kept:
                return
            self.snapshots = kept
            session.restore(kept[-1])
            self.due_snapshot = session.tick + self.interval
            for change in log[len(session.log) :]:
                session.step(change.tick - session.tick)
                getattr(session, change.call)(*change.arguments)
            self.logged = -1
            self.step(tick - session.tick)
            self.views_again("back")
        self.step(tick - session.tick)
        self.tell_log()

    # Messages

    def on_begin(
        self,
        text: str,
        path: str,
        modules: bool,
        seed: int | None = None,
        log: tuple[Any, ...] = (),
        tick: int = 0,
    ) -> None:
        """Begin a session, and come to a tick with the changes of a log."""
        graph = graph_of(text, Path(path), modules)
        session = graph.session(seed=seed)
        self.session, self.snapshots, self.logged, self.next = session, [], -1, None
        self.interval = max(1, session.graph.network.ticks // 200)
        self.take_snapshot()
        self.playing = False
        for at, call, arguments in log:
            self.step(at - session.tick)
            getattr(session, call)(*arguments)
        while session.tick < tick and not _has_failed(session):
            self.step(min(self.interval, tick - session.tick))
        self.chunk = 1
        self.views_again("began")
        self.tell_log()

    def on_text(self, number: int, text: str, path: str, modules: bool) -> None:
        """Read and compile a graph in the thread; the session becomes it when it is ready."""
        session = self.session
        if session is None:
            self.on_begin(text, path, modules)
            self.tell("became", number=number, anew=True)
            return

        def prepare() -> Graph:
            graph = graph_of(text, Path(path), modules)
            session.prepare(graph)
            return graph

        if self.next is not None:
            self.next[1].cancel()
        self.next = (number, self.thread.submit(prepare))

    def follow(self) -> None:
        """Become the next graph if it is ready."""
        if self.next is None or not self.next[1].done() or self.session is None:
            return
        number, future = self.next
        self.next = None
        if future.cancelled():
            return
        try:
            became = self.session.become(future.result())
        except SpikeblocksError as error:
            self.tell("refused", number=number, text=str(error))
            return
        if became.begun or became.gone or not became.numbers:
            self.views_again("edited")
        self.take_snapshot()
        self.tell_log()
        self.tell("became", number=number, anew=False, **_plain(became))

    def on_set(self, path: str, value: Any) -> None:
        """Change a number of the graph."""
        if self.session is None:
            return
        self.session.set(path, value)
        self.tell_log()

    def on_write(self, port: str, value: Any) -> None:
        """Write to an input of the graph."""
        if self.session is not None:
            self.session.write(port, value)
            self.tell_log()

    def on_play(self, speed: float) -> None:
        """Run by the clock."""
        self.speed = speed
        if self.session is None:
            return
        if _has_failed(self.session):
            self.tell("failed", text=str(self.session._failed), what="run")
            return
        self.playing = self.session.tick < self.session.graph.network.ticks
        self.set_clock()
        self.tell_state()

    def on_pause(self) -> None:
        """Stop the clock, and say where that is."""
        self.pause()
        self.tell_state()
        self.is_dirty = True

    def on_step(self, ticks: int) -> None:
        """Do some ticks while the clock stands."""
        self.pause()
        if self.session is not None:
            self.step(max(0, min(ticks, self.session.graph.network.ticks - self.session.tick)))
        self.send_frame()

    def on_goto(self, tick: int) -> None:
        """Go back, or forth, to a tick."""
        self.pause()
        self.go_to(tick)
        self.send_frame()
        self.tell_state()

    def on_watch(self, addresses: list[str]) -> None:
        """Show the values of these signals in each frame."""
        self.watched = tuple(addresses)
        self.send_frame()

    def on_all(self) -> None:
        """Send everything again, to a page that has nothing yet."""
        self.views_again("page")

    def on_save(self, folder: str) -> None:
        """Save the session."""
        if self.session is not None:
            self.tell("saved", folder=str(self.session.save(folder)))

    # Frames

    def views_again(self, cause: str) -> None:
        """Say what is drawn, and send all of it again.

        ``cause`` is began, went back, edited, or a page that has nothing yet.
        """
        session = self.session
        if session is None:
            return
        program = session.graph.prepared(growing=True).program
        network = session.graph.network
        self.views: Views = views_of(program.observation, network)
        probes = program.observation.probes
        self.streams = Streams(probes, self.views.modes, network.ticks, network.dt)
        self.tell(
            "views",
            plots=self.views.plots,
            left_out=self.views.left_out,
            streams=self.streams.describe(),
            dt=network.dt,
            ticks=network.ticks,
            unit=network.time_unit,
            seed=network.seed,
            title=network.title,
            cause=cause,
        )
        self.send_frame()
        self.tell_state()

    def send_frame(self) -> None:
        """Send what was recorded since the last frame."""
        session = self.session
        if session is None:
            return
        rows = session.rows(self.streams.since)
        head = {"tick": session.tick, "t": session.t, "values": dict(self._values(session))}
        self.pipe.send(("frame", pack(head, self.streams.take(rows))))
        self.sent_at, self.is_dirty = time.monotonic(), False

    def _values(self, session: Session) -> Iterator[tuple[str, Any]]:
        if self.playing and session.tick == 0:
            return
        for address in self.watched:
            try:
                value = session.read(address)
            except SpikeblocksError:
                continue
            numbers = [value] if isinstance(value, float) else value.ravel()[:12].tolist()
            yield address, [x if math.isfinite(x) else str(x) for x in numbers]

    def tell_state(self) -> None:
        """Say whether it plays, and why not."""
        session = self.session
        if session is not None:
            self.tell(
                "state",
                playing=self.playing,
                tick=session.tick,
                stopped=session.stopped,
                failed=_has_failed(session),
            )

    def tell_log(self) -> None:
        """Send the changes that are new to the server, which can begin again from them."""
        if self.session is None:
            return
        log = self.session.log
        if self.logged < 0 or len(log) < self.logged:
            self.tell("log", first=0, changes=list(map(tuple, log)))
        elif len(log) > self.logged:
            self.tell("log", first=self.logged, changes=list(map(tuple, log[self.logged :])))
        self.logged = len(log)


def _has_failed(session: Session) -> bool:
    return session._failed is not None


def _plain(became: Became) -> dict[str, Any]:
    return {
        "numbers": list(became.numbers),
        "kept": list(became.kept),
        "begun": list(became.begun),
        "gone": list(became.gone),
    }


def main(pipe: Connection) -> None:
    """Serve a pipe; what a terminal sends to its processes is for the server."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    Worker(pipe).serve()
