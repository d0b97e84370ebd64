"""Workers that die or hang and are replaced; trials sent a bounded number at a time."""

from __future__ import annotations

import errno
import os
import select
import signal
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor, Executor, Future, wait
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from runtime.errors import UsageError
from runtime.experiments.execution.runner import run_trials
from runtime.experiments.execution.trials import Configuration, GraphBundle, Trial
from runtime.experiments.execution.worker import Task, TrialResult
from runtime.experiments.execution.worker_pool import LocalPool, WorkerPool, WorkerUnfit
from runtime.experiments.processes import choice, messages, process_executor, spawner
from runtime.experiments.processes.forkserver import ForkServer
from runtime.experiments.processes.process_executor import ProcessExecutor, WorkerDied
from runtime.experiments.processes.spawner import Spawner
from runtime.experiments.processes.starter import THREADS

LARGE = 8_000_000  # bytes; more than a socket buffer


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def leave() -> None:
    os._exit(7)


def stop_until(socket_path: str) -> int:
    """Wait at one end of a socket until the other end closes it."""
    with socket.socket(socket.AF_UNIX) as link:
        link.connect(socket_path)
        link.recv(1)
    return os.getpid()


def die_half_way() -> bytes:
    """Die while sending an answer that is larger than a socket buffer."""

    def half(link: socket.socket, message: bytes) -> None:
        link.sendall(messages._LENGTH.pack(len(message)))
        link.sendall(message[: len(message) // 2])
        die()

    messages._send = half
    return bytes(LARGE)


def die_leaving_a_child(path: str) -> None:
    """Die while a child process holds all files open."""
    held = os.open(path, os.O_RDONLY)
    if not os.fork():
        os.read(held, 1)  # until the other end of the pipe is closed
        os._exit(0)
    die()


def large() -> bytes:
    return bytes(LARGE)


def unpicklable() -> object:
    return threading.Lock()


def system_exit() -> None:
    sys.exit(5)


def hang() -> None:
    threading.Event().wait()


class Meeting:
    """A socket where calls wait until they are released: so they are known to run in parallel."""

    def __init__(self, folder: Path) -> None:
        self.path = str(folder / "m")
        self.listener = socket.socket(socket.AF_UNIX)
        self.listener.bind(self.path)
        self.listener.listen()
        self.arrived: list[socket.socket] = []

    def await_arrivals(self, count: int) -> None:
        while len(self.arrived) < count:
            self.arrived.append(self.listener.accept()[0])

    def release(self) -> None:
        for link in self.arrived:
            link.close()
        self.arrived = []


@pytest.fixture
def meeting(tmp_path: Path) -> Iterator[Meeting]:
    made = Meeting(tmp_path)
    yield made
    made.release()
    made.listener.close()


@pytest.fixture
def pool(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[ProcessExecutor]:
    """Two workers, of this system's usual starter if a test does not choose one."""
    chosen = getattr(request, "param", None)
    if chosen is not None:
        monkeypatch.setattr(choice, "make", chosen)
        monkeypatch.setattr(choice, "_spare", [])
    made = ProcessExecutor(2)
    yield made
    made.kill()
    if chosen is not None:
        choice.take().close()


# What holds however workers are started, so that it holds under Windows, too.
# The second is for systems that cannot fork.
EITHER = pytest.mark.parametrize(
    "pool", [ForkServer, pytest.param(Spawner, marks=pytest.mark.slow)], indirect=True
)


def both(pool: ProcessExecutor, meeting: Meeting) -> set[int]:
    """The workers, as they are while both are busy."""
    together = [pool.submit(stop_until, meeting.path) for _ in range(2)]
    meeting.await_arrivals(2)
    meeting.release()
    return {future.result() for future in together}


@EITHER
def test_a_death_while_computing_costs_one_call(pool: ProcessExecutor, meeting: Meeting) -> None:
    before = both(pool, meeting)
    beside = pool.submit(stop_until, meeting.path)
    meeting.await_arrivals(1)
    with pytest.raises(WorkerDied, match="its process was killed by SIGKILL"):
        pool.submit(die).result()
    meeting.release()
    assert beside.result() in before
    after = both(pool, meeting)
    assert len(after) == 2
    assert len(after & before) == 1


@EITHER
def test_how_a_worker_ended_is_known(pool: ProcessExecutor) -> None:
    with pytest.raises(WorkerDied, match="its process ended with exit code 7"):
        pool.submit(leave).result()


@EITHER
def test_a_death_half_way_through_an_answer_costs_that_answer(pool: ProcessExecutor) -> None:
    with pytest.raises(WorkerDied, match="killed by SIGKILL"):
        pool.submit(die_half_way).result()
    assert pool.submit(large).result() == bytes(LARGE)


@EITHER
def test_a_death_is_noticed_though_a_child_holds_the_channel(
    pool: ProcessExecutor, tmp_path: Path
) -> None:
    path = tmp_path / "held"
    os.mkfifo(path)
    opened: list[int] = []
    opener = threading.Thread(target=lambda: opened.append(os.open(path, os.O_WRONLY)))
    opener.start()
    with pytest.raises(WorkerDied, match="killed by SIGKILL"):
        pool.submit(die_leaving_a_child, str(path)).result()
    opener.join()
    os.close(opened[0])
    assert pool.submit(os.getpid).result() > 0


def test_an_idle_worker_that_dies_costs_nothing(meeting: Meeting) -> None:
    made = ProcessExecutor(1)
    first = made.submit(os.getpid).result()
    os.kill(first, signal.SIGKILL)
    wait_for_end(first)
    # The call may still be sent to the dead worker; then it fails like a call whose worker died.
    assert retried(made, os.getpid) != first
    made.kill()


def wait_for_end(pid: int) -> None:
    """Wait until a process that is not our child has ended."""
    file = os.pidfd_open(pid)
    select.select([file], [], [])
    os.close(file)


def retried(pool: ProcessExecutor, call: Callable[[], Any]) -> Any:
    try:
        return pool.submit(call).result()
    except WorkerDied:
        return pool.submit(call).result()


def test_the_fork_server_may_die(pool: ProcessExecutor, meeting: Meeting) -> None:
    before = both(pool, meeting)
    server = pool.starter
    assert isinstance(server, ForkServer)
    os.kill(server.pid, signal.SIGKILL)
    wait_for_end(server.pid)
    assert both(pool, meeting) == before  # who is there stays there
    with pytest.raises(WorkerDied):
        pool.submit(die).result()
    after = both(pool, meeting)  # and others are started by another fork server
    assert len(after & before) == 1
    made = pool.starter
    pool.kill()
    for pid in after:
        wait_for_end_or_none(pid)
    assert made.is_alive


def wait_for_end_or_none(pid: int) -> None:
    try:
        wait_for_end(pid)
    except ProcessLookupError:
        return


def test_workers_that_are_being_started_may_die() -> None:
    made = ProcessExecutor(2)
    first = made.starter
    assert isinstance(first, ForkServer)
    # Nothing is forked any more: the sockets of the awaited workers close with the fork server.
    os.kill(first.pid, signal.SIGSTOP)
    calls = [made.submit(os.getpid) for _ in range(2)]
    os.kill(first.pid, signal.SIGKILL)
    assert all(call.result() > 0 for call in calls)
    assert made.starter is not first
    made.kill()


def test_workers_that_can_never_start_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    made = ProcessExecutor(2)
    monkeypatch.setattr(made.starter, "start", ended)
    with pytest.raises(UsageError, match="each one ends as it starts"):
        made.submit(os.getpid).result()
    made.kill()


def ended() -> socket.socket:
    near, far = socket.socketpair()
    far.close()
    return near


def test_no_more_workers_than_calls(pool: ProcessExecutor) -> None:
    made = ProcessExecutor(40)
    asked = []
    fork = made.starter.start
    made.starter.start = lambda: asked.append(0) or fork()  # type: ignore[func-returns-value, method-assign]
    calls = [made.submit(os.getpid) for _ in range(2)]
    assert len({call.result() for call in calls}) <= 2
    assert len(asked) == 2
    made.shutdown()


def test_where_there_is_no_room_there_are_fewer_workers(
    monkeypatch: pytest.MonkeyPatch, meeting: Meeting
) -> None:
    made = ProcessExecutor(3)
    first = made.submit(stop_until, meeting.path)
    meeting.await_arrivals(1)
    full = OSError(errno.EMFILE, os.strerror(errno.EMFILE))
    monkeypatch.setattr(made.starter, "start", lambda: raised(full))
    others = [made.submit(os.getpid) for _ in range(2)]
    meeting.release()
    assert {call.result() for call in others} == {first.result()}
    made.submit(leave).exception()
    with pytest.raises(UsageError, match="cannot start worker processes: Too many open files"):
        made.submit(os.getpid).result()
    made.kill()


def raised(error: Exception) -> Any:
    raise error


@EITHER
def test_an_exception_of_a_call_reaches_its_future(pool: ProcessExecutor) -> None:
    with pytest.raises(RuntimeError, match="SystemExit: 5"):
        pool.submit(system_exit).result()
    with pytest.raises(TypeError, match="cannot pickle"):
        pool.submit(unpicklable).result()
    assert pool.submit(os.getpid).result() > 0


def test_a_worker_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(process_executor, "GRACE", 0.0)
    made = ProcessExecutor(1, limit=0.2)
    with pytest.raises(TimeoutError, match=r"killed after 0\.2 s, stuck inside a block"):
        made.submit(hang).result()
    assert made.submit(os.getpid).result() > 0
    made.kill()


def test_a_limit_may_be_of_any_size() -> None:
    made = ProcessExecutor(1, limit=1e300)
    assert made.submit(os.getpid).result() > 0
    made.kill()


@EITHER
def test_workers_have_one_thread_each_and_leave_our_environment_alone(
    pool: ProcessExecutor,
) -> None:
    before = {name: os.environ.get(name) for name in THREADS}
    seen = [pool.submit(os.getenv, name).result() for name in THREADS]
    assert seen == ["1"] * len(THREADS)
    assert {name: os.environ.get(name) for name in THREADS} == before


def test_a_worker_begins_in_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The fork server was started in another one, which is gone."""
    first, second = tmp_path / "first", tmp_path / "second"
    first.mkdir()
    second.mkdir()
    monkeypatch.setattr(choice, "_spare", [])
    monkeypatch.chdir(first)
    choice.start_early()
    monkeypatch.chdir(second)
    first.rmdir()
    made = ProcessExecutor(1)
    assert made.submit(os.getcwd).result() == str(second)
    made.kill()
    choice.take().close()


def test_temporary_files_of_workers_are_removed_with_their_fork_server() -> None:
    made = ProcessExecutor(1)
    folder = Path(made.submit(tempfile.mkdtemp).result())
    assert folder.parent == made.starter.folder
    made.kill()
    choice.take().close()
    assert not folder.parent.exists()


@pytest.mark.slow
def test_a_spawned_worker_that_hangs_is_killed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(choice, "make", Spawner)
    monkeypatch.setattr(choice, "_spare", [])
    monkeypatch.setattr(process_executor, "GRACE", 0.0)
    made = ProcessExecutor(1, limit=2.0)
    folder = Path(made.submit(tempfile.mkdtemp).result())
    with pytest.raises(TimeoutError, match=r"killed after 2 s, stuck inside a block"):
        made.submit(hang).result()
    assert made.submit(os.getpid).result() > 0
    made.kill()
    choice.take().close()
    assert not folder.parent.exists()


def test_a_port_takes_only_the_worker_that_was_started(monkeypatch: pytest.MonkeyPatch) -> None:
    secret, process = bytes(range(32)), SimpleNamespace(poll=lambda: None)
    with socket.create_server((spawner.HERE, 0)) as listening:
        address = listening.getsockname()
        with socket.create_connection(address) as other, socket.create_connection(address) as own:
            other.sendall(bytes(32))
            own.sendall(secret)
            with spawner._accept(listening, secret, process) as link:  # type: ignore[arg-type]
                own.sendall(b"!")
                assert link.recv(1) == b"!"
                assert other.recv(1) == b""
        monkeypatch.setattr(process, "poll", lambda: 1)
        with pytest.raises(OSError, match="a worker process does not answer"):
            spawner._accept(listening, secret, process)  # type: ignore[arg-type]


def test_a_pool_that_is_killed_ends_what_runs(meeting: Meeting) -> None:
    made = ProcessExecutor(1)
    future = made.submit(stop_until, meeting.path)
    waiting = made.submit(os.getpid)
    meeting.await_arrivals(1)
    made.kill()
    for call in (future, waiting):
        with pytest.raises(WorkerDied):
            call.result()
    with pytest.raises(RuntimeError, match="the executor is closed"):
        made.submit(os.getpid)


def trial(number: int) -> Trial:
    return Trial(number, Configuration(number, (str(number),), GraphBundle("g")), 0)


class Fake(Executor):
    """Answers calls on request; counts how many wait. ``calls`` are the trials of each call."""

    def __init__(self, answer: Callable[[Task, int], Any]) -> None:
        self.answer = answer
        self.most = 0
        self.open: list[Future[Any]] = []
        self.tries: dict[int, int] = {}
        self.calls: list[list[int]] = []

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        tasks: list[Task] = args[0]
        numbers = [task.trial.number for task in tasks]
        self.calls.append(numbers)
        for number in numbers:
            self.tries[number] = self.tries.get(number, 0) + 1
        future: Future[Any] = Future()
        self.open = [other for other in self.open if not other.done()] + [future]
        self.most = max(self.most, len(self.open))
        answers = [self.answer(task, self.tries[task.trial.number]) for task in tasks]
        error = next((each for each in answers if isinstance(each, BaseException)), None)
        if error is not None:
            future.set_exception(error)
        else:
            future.set_result(answers)
        return future


class FakePool(WorkerPool):
    """Calls of a fake executor; the addresses of workers that are left out are kept."""

    deaths = (BrokenExecutor,)

    def __init__(self, fake: Fake, width: int, most: int) -> None:
        self.fake, self.calls, self.most = fake, width, most
        self.left_out: list[str] = []

    def submit(self, tasks: Sequence[Task]) -> Future[list[TrialResult]]:
        return self.fake.submit(None, tasks)

    def width(self) -> int:
        return self.calls

    def leave(self, finished: bool) -> None:
        pass


class PoolOfMany(FakePool):
    """One that goes on without a worker that is unfit."""

    def leave_out(self, error: WorkerUnfit) -> None:
        self.left_out.append(error.address)


def pool_of(fake: Fake, width: int = 3, most: int = 1) -> FakePool:
    return FakePool(fake, width, most)


def test_trials_are_taken_as_workers_become_free() -> None:
    taken = 0

    def trials() -> Iterator[Trial]:
        nonlocal taken
        for number in range(10**9):
            taken += 1
            yield trial(number)

    ended = run_trials(trials(), pool_of(Fake(lambda task, tries: TrialResult("ok"))), Task)
    for count in range(1, 2000):
        next(ended)
        assert taken - count <= 3


def test_a_trial_is_run_three_times_at_most() -> None:
    def answer(task: Task, tries: int) -> Any:
        number = task.trial.number
        if number == 2 or (number == 1 and tries < 3):
            return BrokenExecutor("gone")
        return TrialResult("ok")

    fake = Fake(answer)
    ended = {p.number: done for p, done in run_trials(map(trial, range(4)), pool_of(fake), Task)}
    assert {number: done.status for number, done in ended.items()} == {
        **dict.fromkeys((0, 1, 3), "ok"),
        2: "lost",
    }
    assert fake.tries == {0: 1, 1: 3, 2: 3, 3: 1}
    assert ended[2].reason == "its worker died 3 times, the last time: gone"


@pytest.mark.parametrize(("seconds", "size"), [(0.001, 50), (0.02, 25), (0.05, 10), (2.0, 1)])
def test_short_trials_are_sent_many_in_a_call(seconds: float, size: int) -> None:
    fake = Fake(lambda task, tries: TrialResult("ok", wall_s=seconds))
    count = 2000
    ended = run_trials(map(trial, range(count)), pool_of(fake, most=50), Task)
    assert sorted(each.number for each, _ in ended) == list(range(count))
    assert [n for call in fake.calls for n in call] == list(range(count))
    assert len(fake.calls[0]) == 1  # how long a trial takes is not known yet
    assert [len(call) for call in fake.calls[-5:-1]] == pytest.approx([size] * 4, abs=1)


@pytest.mark.parametrize("error", [BrokenExecutor("gone"), MemoryError("too large to send")])
def test_a_trial_that_ends_its_call_ends_no_other(error: Exception) -> None:
    def answer(task: Task, tries: int) -> Any:
        return error if task.trial.number == 300 else TrialResult("ok", wall_s=0.01)

    fake = Fake(answer)
    trials = run_trials(map(trial, range(400)), pool_of(fake, most=50), Task)
    ended = {each.number: done for each, done in trials}
    died = isinstance(error, BrokenExecutor)
    assert ended.pop(300).status == ("lost" if died else "failed")
    assert {done.status for done in ended.values()} == {"ok"}
    assert len(ended) == 399
    shared = next(call for call in fake.calls if 300 in call)
    assert len(shared) > 10
    assert {n: k for n, k in fake.tries.items() if k > 1} == {
        **dict.fromkeys(shared, 2),
        300: 3 if died else 2,
    }


def test_workers_that_cannot_run_trials_end_the_sweep() -> None:
    fake = Fake(lambda task, tries: ModuleNotFoundError("No module named 'runtime'"))
    with pytest.raises(UsageError, match="the workers cannot run trials: ModuleNotFoundError"):
        list(run_trials(map(trial, range(4)), pool_of(fake), Task))


def test_a_call_that_fails_makes_its_trial_fail() -> None:
    fake = Fake(lambda task, tries: MemoryError() if task.trial.number else TrialResult("ok"))
    ended = {p.number: done for p, done in run_trials(map(trial, range(2)), pool_of(fake), Task)}
    assert (ended[0].status, ended[1].status) == ("ok", "failed")
    assert ended[1].reason == "MemoryError"


def test_a_time_out_is_an_answer() -> None:
    fake = Fake(lambda task, tries: TimeoutError("killed after 1 s"))
    [(_, done)] = run_trials(map(trial, range(1)), pool_of(fake), Task)
    assert (done.status, done.reason) == ("timeout", "killed after 1 s")


def test_a_local_pool_finishes_and_ends() -> None:
    made = LocalPool(1, None)
    future = made.executor.submit(os.getpid)
    wait([future])
    made.leave(True)
    with pytest.raises(ProcessLookupError):
        os.kill(future.result(), 0)


LEAVING = """
import sys, time
from runtime.experiments.processes.process_executor import ProcessExecutor
pool = ProcessExecutor(2)
pool.submit(time.sleep, 0.0).result()
for _ in range(40):
    pool.submit(time.sleep, 0.05)
sys.exit(3)
"""


def test_a_process_that_ends_with_calls_in_the_queue_ends_in_silence() -> None:
    # Its thread saw the workers end, and started others: KeyError, "(FD 3) is already registered".
    done = subprocess.run(
        [sys.executable, "-c", LEAVING], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (3, "", "")


def test_trials_whose_worker_died_come_last() -> None:
    """Where workers do not come back, one that ends each of them costs no other trial."""

    def answer(task: Task, tries: int) -> Any:
        return BrokenExecutor("gone") if task.trial.number == 2 else TrialResult("ok")

    fake = Fake(answer)
    list(run_trials(map(trial, range(30)), pool_of(fake), Task))
    assert [number for call in fake.calls for number in call][-2:] == [2, 2]
    assert len(fake.calls) == 32


def test_a_pool_that_tries_calls_again_itself_gives_a_trial_one_attempt() -> None:
    fake = Fake(lambda task, tries: BrokenExecutor("gone"))
    pool = pool_of(fake)
    pool.attempts = 1
    [(_, done)] = run_trials(map(trial, range(1)), pool, Task)
    assert (done.status, done.reason) == ("lost", "its worker died: gone")
    assert fake.tries == {0: 1}


def test_a_trial_of_an_unfit_worker_goes_to_another_one() -> None:
    def answer(task: Task, tries: int) -> Any:
        return WorkerUnfit("tcp://a:1", "no module") if tries == 1 else TrialResult("ok")

    pool = PoolOfMany(Fake(answer), 3, 1)
    ended = dict(run_trials(map(trial, range(4)), pool, Task))
    assert {done.status for done in ended.values()} == {"ok"}
    assert pool.left_out == ["tcp://a:1"] * 4
