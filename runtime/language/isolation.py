"""A user's Python files, imported by processes of their own: one run per file and content.

In: the path of a Python file. Out: classes that stand for its blocks: same ports, parameters,
documentation and checks. A language server must not run what it shows, since a file may hang, crash
or print. So each file is run once per content by a :mod:`runtime.language.module_worker`; what goes
wrong is remembered with the content, and so is what the worker answered::

    server                             worker (imports my_blocks.py)
    construct Saturator(limit=-1)  ─▶  Saturator(limit=-1)
    ParameterError                 ◀─  ("problems", ["limit: expected above 0, got -1"])
"""

from __future__ import annotations

import hashlib
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, ClassVar

from blocks.core import Block, BlockContext, DeclarationError, ParameterError, SignalType
from blocks.files import read
from blocks.library.registry import ModuleReader, PendingModuleError
from blocks.limits import MODULE
from runtime.language.module_worker import pack, receive, send

IMPORT_SECONDS = 20.0
START_SECONDS = 60.0  # until a process is ready to import, on a busy machine
ANSWER_SECONDS = 2.0
MAX_ANSWERS = 2_000
MAX_KEPT = 32  # files and contents that are remembered
PACKAGE = str(Path(__file__).parents[2])


class SlowModuleError(Exception):
    """A file whose import, or whose answer, took too long."""

    raised_at = ""  # in no line of the file that is known


class ModuleWorker:
    """The process that runs one content of one file, started when it is first asked."""

    def __init__(self, file: Path, digest: str, on_change: Callable[[], None]) -> None:
        self.file, self.digest, self.on_change = file, digest, on_change
        self.process: subprocess.Popen[bytes] | None = None
        self.lock = threading.Lock()
        self.answers: dict[bytes, tuple[str, Any]] = {}
        self.ready = threading.Event()
        self.description: tuple[str, Any] = ("slow", "")
        self.classes: dict[str, type[Block]] = {}
        self.signal_types: list[SignalType] = []
        self.has_waited = False
        threading.Thread(target=self._load, daemon=True).start()

    def _load(self) -> None:
        self.description = self.ask(("describe",), IMPORT_SECONDS)
        if self.description[0] == "done":
            classes, self.signal_types = self.description[1]
            self.classes = {each["key"]: stand_in(each, self) for each in classes}
        self.ready.set()
        # Someone got "still being imported" as an answer, and has to ask again.
        if self.has_waited:
            self.on_change()

    def ask(self, question: tuple[Any, ...], seconds: float) -> tuple[str, Any]:
        """An answer, asked for once; a process that does not answer in time is ended."""
        try:
            key = pack(question)
        except Exception as error:  # noqa: BLE001 -- a world or value of a strange class
            return "failed", (type(error).__name__, str(error), "")
        with self.lock:
            if key not in self.answers:
                if len(self.answers) >= MAX_ANSWERS:
                    self.answers.clear()
                self.answers[key] = self._ask_process(question, seconds)
            return self.answers[key]

    def _ask_process(self, question: tuple[Any, ...], seconds: float) -> tuple[str, Any]:
        if self.process is None:
            # A process that was ended is not started again for the same content: the file would
            # hang again at each key that is typed. An edit of the file makes a new worker.
            if question != ("describe",):
                return "slow", f"its process ended; it took longer than {seconds:g} s"
            self.process = self._start_process()
            self._exchange(self.process, ("hello",), START_SECONDS)
        return self._exchange(self.process, question, seconds)

    def _exchange(
        self, process: subprocess.Popen[bytes], question: tuple[Any, ...], seconds: float
    ) -> tuple[str, Any]:
        if process.stdin is None or process.stdout is None:
            return "failed", ("OSError", "no pipe", "")
        timeout = threading.Timer(seconds, process.kill)
        timeout.daemon = True
        timeout.start()
        try:
            send(process.stdin, question)
            answer: tuple[str, Any] = receive(process.stdout)
        except (EOFError, OSError, ValueError):
            # The pipe breaks in both cases: the process ended by itself, or the timer killed it.
            was_slow = not timeout.is_alive()
            self.stop()
            if was_slow:
                return "slow", f"took longer than {seconds:g} s"
            return "failed", ("Exit", "the process that imported it ended", "")
        except Exception as error:  # noqa: BLE001 -- an answer may hold what cannot be read
            self.stop()
            return "failed", (type(error).__name__, str(error), "")
        finally:
            timeout.cancel()
        return answer

    def _start_process(self) -> subprocess.Popen[bytes]:
        return subprocess.Popen(
            [sys.executable, "-m", "runtime.language.module_worker", str(self.file)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            cwd=PACKAGE,
            start_new_session=True,
        )

    def stop(self) -> None:
        """End the process."""
        process, self.process = self.process, None
        if process is not None:
            process.kill()
            for pipe in (process.stdin, process.stdout):
                if pipe is not None:
                    try:
                        pipe.close()
                    except OSError:
                        continue  # it had ended before all of the question was written
            process.wait()

    def wait_until_loaded(self, patience: float) -> None:
        """Wait until the file was imported.

        Raises
        ------
        PendingModuleError : it is still being imported.
        SlowModuleError, SyntaxError and others : it could not be, as an import would say.
        """
        patience = 0.0 if self.has_waited else patience
        self.has_waited = True  # before waiting: the import then either is ready or tells
        if not self.ready.wait(patience):
            raise PendingModuleError
        kind, value = self.description
        if kind == "missing":
            raise FileNotFoundError(str(self.file))
        if kind == "syntax":
            error = SyntaxError(value[0])
            error.lineno = value[1]
            raise error
        if kind == "slow":
            raise SlowModuleError(f"importing it {value}")
        if kind == "failed":
            raise _failure(kind, value)


class StandIn(Block):
    """Stands for a class of a user's file, whose own checks run in the file's process."""

    worker: ClassVar[ModuleWorker]
    key: ClassVar[str]
    source_file: ClassVar[str]
    overrides_construction: ClassVar[bool]
    overrides_check: ClassVar[bool]

    def _misshapen(self) -> list[tuple[str, str]]:
        if not self.overrides_construction:
            return super()._misshapen()
        kind, value = self.worker.ask(("construct", self.key, self._values()), ANSWER_SECONDS)
        if kind == "problems":
            return list(value)
        if kind != "done":
            raise _failure(kind, value)
        self.__dict__["_answer"] = value
        return []

    def _values(self) -> dict[str, Any]:
        return {name: self.value(name) for name in self.spec.params}

    @property
    def variables(self) -> dict[str, SignalType]:
        answer = self.__dict__.get("_answer")
        return super().variables if answer is None else dict(answer[1])

    def sizes(self) -> dict[str, int]:
        answer = self.__dict__.get("_answer")
        return super().sizes() if answer is None else dict(answer[0])

    def validate_in(self, context: BlockContext) -> None:
        if not self.overrides_check:
            return
        question = ("check", self.key, self._values(), context)
        kind, value = self.worker.ask(question, ANSWER_SECONDS)
        if kind == "problems":
            raise ParameterError(value)
        if kind != "done":
            raise _failure(kind, value)


def _failure(kind: str, value: Any) -> Exception:
    """The error of a class, by the name that it had in the other process."""
    if kind == "failed":
        name, text, place = value
        error = (
            DeclarationError(text)
            if name == DeclarationError.__name__
            else _rebuild_error(name, text)
        )
        error.raised_at = place  # type: ignore[attr-defined]
        return error
    return SlowModuleError(str(value))


def _rebuild_error(name: str, text: str) -> Exception:
    error: Exception = type(name, (Exception,), {})(text)
    return error


def stand_in(description: Mapping[str, Any], worker: ModuleWorker) -> type[Block]:
    """The class that stands for one of a file."""
    inside = {
        "__doc__": description["doc"],
        "__module__": description["module"],
        "worker": worker,
        "key": description["key"],
        "source_file": str(worker.file),
        "overrides_construction": description["overrides_construction"],
        "overrides_check": description["overrides_check"],
    }
    cls: type[Block] = type(description["name"], (StandIn,), inside)
    cls.spec = description["spec"]
    return cls


class Isolation:
    """Reads modules through workers; one per file, replaced when the file's content changes.

    Parameters
    ----------
    patience : how long the first question about a file waits for its import, s.
    on_change : called when an import ends that something did not wait for.
    """

    def __init__(
        self, patience: float = IMPORT_SECONDS + 1.0, on_change: Callable[[], None] = lambda: None
    ) -> None:
        self.patience, self.on_change = patience, on_change
        self.workers: dict[Path, ModuleWorker] = {}
        self.lock = threading.Lock()

    @property
    def reader(self) -> ModuleReader:
        """What the checks of a graph take in place of an import."""
        return ModuleReader(self.blocks, self.signal_types)

    def blocks(self, file: Path) -> Mapping[str, type[Block]]:
        """The block types of a file, as :func:`blocks.library.registry.blocks_of_module`."""
        worker = self.worker(file)
        worker.wait_until_loaded(self.patience)
        return worker.classes

    def signal_types(self, file: Path) -> list[SignalType]:
        """The signal types of a file, as :func:`blocks.library.registry.types_of_module`."""
        worker = self.worker(file)
        worker.wait_until_loaded(self.patience)
        return worker.signal_types

    def worker(self, file: Path) -> ModuleWorker:
        """The worker of a file's present content.

        Raises
        ------
        OSError : the file cannot be read.
        """
        file = file.resolve()
        digest = hashlib.sha256(read(file, MODULE)).hexdigest()
        with self.lock:
            # Taken out and put back at the end, so that the dictionary's order is that of the last
            # use.
            worker = self.workers.pop(file, None)
            if worker is not None and worker.digest != digest:
                worker.stop()
                worker = None
            if worker is None:
                worker = ModuleWorker(file, digest, self.on_change)
            self.workers[file] = worker
            while len(self.workers) > MAX_KEPT:
                self.workers.pop(next(iter(self.workers))).stop()
            return worker

    def close(self) -> None:
        """End all processes."""
        with self.lock:
            for worker in self.workers.values():
                worker.stop()
            self.workers.clear()
