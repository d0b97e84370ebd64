"""The command line in forks of one process that has imported what commands import.

In: the words after ``runtime``, a folder, environment variables and three open files for the
standard streams. Out: the exit code, negative for a signal, as in ``subprocess``.

    with Launcher(script) as launcher:
        code = launcher.run(["validate", "my.yaml"], folder, os.environ, (null, out, errors))

A new interpreter spends 0.4 s of CPU time on imports, and 1.2 s where it draws plots; a fork starts
in milliseconds. It is a process of its own all the same, with its own signals, streams, modules
and exit code, which the command line within the tests' process would not have. What only a new
interpreter does is not tested with it: reading the locale, ``sitecustomize``, and the imports.
"""

from __future__ import annotations

import atexit
import contextlib
import gc
import importlib
import io
import json
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import traceback
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO, NoReturn

# macOS ends a process that forked after its system libraries were used; Windows has no fork.
AVAILABLE = sys.platform == "linux"
ROOT = Path(__file__).resolve().parents[1]
STREAMS = (("stdin", "r"), ("stdout", "w"), ("stderr", "w"))
# What most commands import late; an extra that is missing is skipped.
PRELOADED = (
    *("blocks", "spikeblocks_command", "networkx", "scipy.linalg", "scipy.optimize"),
    *("scipy.signal", "scipy.special", "scipy.stats", "matplotlib.pyplot"),
    *("matplotlib.backends.backend_agg", "matplotlib.backends.backend_svg", "mpl_toolkits.mplot3d"),
    *("runtime.compare", "runtime.compiler", "runtime.diagrams", "runtime.engine"),
    *("runtime.engine.compiled", "runtime.experiments", "runtime.experiments.design"),
    *("runtime.experiments.execution", "runtime.language", "runtime.plots", "runtime.reports"),
    *("runtime.runs", "runtime.toolchain"),
)


class Launcher:
    """Starts commands in forks of one process; it ends with the context.

    Parameters
    ----------
    script : the console script, which ``sys.argv`` of a command begins with.
    """

    def __init__(self, script: Path) -> None:
        self._script = script
        self._start()

    def _start(self) -> None:
        self._connection, theirs = socket.socketpair()
        command = [sys.executable, "-m", "tests.launcher", str(theirs.fileno())]
        with theirs:
            self._process = subprocess.Popen(command, pass_fds=[theirs.fileno()], cwd=ROOT)

    def __enter__(self) -> Launcher:
        return self

    def __exit__(self, *_: object) -> None:
        self._connection.close()
        self._process.wait()

    def _restart(self) -> None:
        """After a test that timed out: the answer to its command would be taken for the next."""
        self._process.kill()
        self.__exit__()
        self._start()

    def run(
        self,
        words: Sequence[str],
        folder: Path,
        variables: Mapping[str, str],
        streams: Sequence[IO[bytes]],
    ) -> int:
        """Run a command to its end; returns its exit code."""
        request = {
            "argv": [str(self._script), *words],
            "folder": str(folder),
            "variables": dict(variables),
        }
        # In a file, since a message through a socket may arrive in parts.
        with tempfile.TemporaryFile() as file:
            file.write(json.dumps(request).encode("utf-8", "surrogateescape"))
            file.seek(0)
            files = [stream.fileno() for stream in (*streams, file)]
            try:
                socket.send_fds(self._connection, [b"."], files)
                return int(self._connection.recv(16))
            except BaseException:
                self._restart()
                raise


def serve(number: int) -> None:
    """Run each command that arrives on a socket in a fork, until the other end is closed."""
    exports = importlib.import_module("blocks.library.lazy").exports
    for name in PRELOADED:
        with contextlib.suppress(ImportError):
            module = importlib.import_module(name)
            if name.startswith(("blocks", "runtime")):
                for exported in getattr(module, "__all__", exports(name)):
                    getattr(module, exported)  # doors import what is asked for
    importlib.import_module("runtime.cli").make_parser()  # imports the modules of all verbs
    _warm()
    gc.collect()
    gc.freeze()  # a collection in a fork would write to all pages, and so copy them
    # NumPy's threads sleep between calls, and it prepares them for a fork.
    warnings.filterwarnings("ignore", "This process .* is multi-threaded", DeprecationWarning)
    with socket.socket(fileno=number) as connection:
        while True:
            message, files, *_ = socket.recv_fds(connection, 1, 4)
            if not message:
                return
            pid = os.fork()
            if pid == 0:
                connection.close()
                _command(*files)
            for file in files:
                os.close(file)
            code = os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
            connection.sendall(str(code).encode())


def _warm() -> None:
    """Draw a figure, which opens the fonts."""
    from matplotlib.figure import Figure

    figure = Figure()
    figure.subplots().set_title("$x_1$")
    figure.savefig(io.BytesIO())


def _command(stdin: int, stdout: int, stderr: int, file: int) -> NoReturn:
    """Be the console script: with its streams, folder, variables and arguments, to its end."""
    with open(file, encoding="utf-8", errors="surrogateescape") as opened:
        request = json.load(opened)
    for number, ((name, mode), descriptor) in enumerate(
        zip(STREAMS, (stdin, stdout, stderr), strict=True)
    ):
        os.dup2(descriptor, number)
        os.close(descriptor)
        errors = "backslashreplace" if name == "stderr" else "strict"
        stream = open(number, mode, encoding="utf-8", errors=errors, closefd=False)  # noqa: SIM115
        if isinstance(stream, io.TextIOWrapper) and (name == "stderr" or stream.isatty()):
            stream.reconfigure(line_buffering=True)
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    os.chdir(request["folder"])
    os.environ.clear()
    os.environ.update(request["variables"])
    sys.argv = request["argv"]
    added = filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep))
    sys.path[:1] = [str(Path(sys.argv[0]).parent), *added]
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # ignored where the tests run under nohup
    code = _exit_code()
    # As an interpreter ends, without freeing what the processes share.
    threading._shutdown()  # type: ignore[attr-defined]
    atexit._run_exitfuncs()
    for ended in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            ended.flush()
    os._exit(code)


def _exit_code() -> int:
    """Run the console script's function; returns the exit code that it ends with."""
    from spikeblocks_command import main

    try:
        main()
    except SystemExit as ended:
        if ended.code is None or isinstance(ended.code, int):
            return ended.code or 0
        print(ended.code, file=sys.stderr)
    except BaseException:  # noqa: BLE001 -- whatever it is, an interpreter prints it and ends
        traceback.print_exc()
    return 1


if __name__ == "__main__":
    serve(int(sys.argv[1]))
