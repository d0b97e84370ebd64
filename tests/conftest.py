"""Shared by all tests: the real console script, and small graphs."""

from __future__ import annotations

import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from runtime.toolchain import MissingCompilerError
from tests.compilers import REASON

# A shell's background jobs ignore Ctrl-C, and so would all that tests start from there.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Hundreds of tests start a process; without kept bytecode each would compile the project again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

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


@pytest.fixture
def cli(script: Path, tmp_path: Path) -> Run:
    """Runs the console script in an empty folder; returns the completed process."""

    def run(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
        settings: dict[str, Any] = {"cwd": tmp_path, "capture_output": True, "text": True}
        return subprocess.run([str(script), *arguments], **{**settings, **options})

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
