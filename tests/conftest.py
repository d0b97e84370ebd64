"""Shared by all tests: the command line in a process of its own."""

from __future__ import annotations

import gc
import os
import pty
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import is_hypothesis_test, settings

from runtime.toolchain import VARIABLE, MissingCompilerError
from tests.compilers import REASON
from tests.launcher import AVAILABLE, Launcher

# A shell's background jobs ignore Ctrl-C, and so would all that tests start from there.
signal.signal(signal.SIGINT, signal.default_int_handler)
# Hundreds of tests start a process; without kept bytecode each would compile the project again.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False


# A test may take long on a busy machine. The quick tests try a quarter of hypothesis' examples,
# and the slow ones all of them, with the same tests.
EXAMPLES = {"quick": 25, "slow": 100}


def pytest_configure(config: pytest.Config) -> None:
    """Choose the examples, and a folder for compiled code that all workers share."""
    # The same examples in each run: whether a commit passes must not depend on the day. Others are
    # looked for with ``pytest --hypothesis-seed=random``, and by ``python -m tests.fuzz``.
    is_fixed = config.getoption("--hypothesis-seed", None) is None
    for name, count in EXAMPLES.items():
        settings.register_profile(name, deadline=None, max_examples=count, derandomize=is_fixed)
    settings.load_profile("quick" if config.option.markexpr == "not slow" else "slow")
    if config.pluginmanager.hasplugin("cacheprovider"):
        assert config.cache is not None
        os.environ.setdefault(VARIABLE, str(config.cache.mkdir("compiled")))


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Repeat tests with examples in the slow run; the marker selects them."""
    if config.option.markexpr == "slow":
        for item in items:
            if is_hypothesis_test(getattr(item, "obj", None)):
                item.add_marker(pytest.mark.slow)


def pytest_collection_finish() -> None:
    """Leave modules and collected tests out of what each garbage collection goes through."""
    if "nengo" in sys.modules:  # of its file of decoders, only one process at a time has the lock
        sys.modules["nengo"].rc.set("decoder_cache", "enabled", "False")
    gc.collect()
    gc.freeze()


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


@pytest.fixture(scope="session")
def run_in(launcher: Launcher | None, script: Path) -> Run:
    """Runs a command in a process of its own, in a folder; returns the completed process.

    With options of ``subprocess.run``, such as ``env``, it is a new interpreter.
    """

    def run(cwd: Path, *arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
        command = [str(script), *arguments]
        if options or launcher is None:
            settings = {"cwd": cwd, "capture_output": True, "text": True, **options}
            return subprocess.run(command, **settings)
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


@pytest.fixture
def cli(run_in: Run, tmp_path: Path) -> Run:
    """Runs a command in an empty folder, as ``run_in`` does."""

    def run(*arguments: str, **options: Any) -> subprocess.CompletedProcess[str]:
        return run_in(options.pop("cwd", tmp_path), *arguments, **options)

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
