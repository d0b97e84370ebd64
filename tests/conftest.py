"""Shared by all tests: the command line in a process of its own."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from runtime.toolchain import VARIABLE, MissingCompilerError
from tests.compilers import REASON
from tests.launcher import AVAILABLE, Launcher

# A shell's background jobs ignore Ctrl-C, and so would all that tests start from there.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Hundreds of tests start a process; without kept bytecode each would compile the project again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


def pytest_configure(config: pytest.Config) -> None:
    """Keep compiled code in a folder of the tests' own, for the workers of pytest-xdist as well."""
    if config.cache is not None:
        os.environ.setdefault(VARIABLE, str(config.cache.mkdir("compiled")))


Run = Callable[..., "subprocess.CompletedProcess[str]"]


@pytest.fixture(scope="session")
def script() -> Path:
    """The installed console script."""
    path = Path(sys.executable).parent / "runtime"
    if not path.exists():
        pytest.fail(f"{path} is missing; install the project: pip install -e '.[test]'")
    return path


@pytest.fixture
def terminal(script: Path, tmp_path: Path) -> Callable[..., bytes]:
    """Runs the console script on a terminal, in an empty folder; returns all that is shown."""

    def run(*arguments: str) -> bytes:
        parent, child = pty.openpty()
        command = [str(script), *arguments]
        with subprocess.Popen(command, stdout=child, stderr=child, cwd=tmp_path) as process:
            os.close(child)
            seen = b""
            while True:
                try:
                    block = os.read(parent, 65536)
                except OSError:  # the other end is closed
                    break
                if not block:
                    break
                seen += block
            assert process.wait() == 0, seen
        os.close(parent)
        return seen

    return run


@pytest.fixture(scope="session")
def launcher(script: Path) -> Iterator[Launcher | None]:
    """Starts commands without starting Python for each; None where that is not possible."""
    if not AVAILABLE:
        yield None
        return
    with Launcher(script) as started:
        yield started


@pytest.fixture
def cli(launcher: Launcher | None, script: Path, tmp_path: Path) -> Run:
    """Runs a command in a process of its own, in an empty folder; returns the completed process.

    With ``env`` it is a new interpreter, which reads some of the variables when it starts.
    """

    def run(
        *arguments: str, cwd: Path = tmp_path, env: Mapping[str, str] | None = None
    ) -> subprocess.CompletedProcess[str]:
        command = [str(script), *arguments]
        if env is not None or launcher is None:
            return subprocess.run(command, cwd=cwd, env=env, capture_output=True, text=True)
        with (
            Path(os.devnull).open("rb") as null,
            tempfile.TemporaryFile() as out,
            tempfile.TemporaryFile() as errors,
        ):
            code = launcher.run(arguments, cwd, os.environ, (null, out, errors))
            texts = []
            for stream in (out, errors):
                stream.seek(0)
                texts.append(stream.read().decode())
        return subprocess.CompletedProcess(command, code, *texts)

    return run


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call() -> Iterator[None]:
    """Skip a test that asks for the compiled engine where there is no C compiler."""
    try:
        yield
    except MissingCompilerError:
        pytest.skip(REASON)


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say how many tests were skipped for want of a C compiler."""
    skipped = terminalreporter.stats.get("skipped", [])
    count = sum(REASON in str(report.longrepr) for report in skipped)
    if count:
        terminalreporter.write_line(f"{count} tests of the compiled engine were skipped: {REASON}")
