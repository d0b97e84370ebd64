"""The compiler is found, asked once who it is, and its absence says what to install."""

from __future__ import annotations

import platform
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from runtime.toolchain import (
    Compiler,
    MissingCompilerError,
    TranslationUnit,
    available,
    build,
    compilers,
    find_compiler,
    install_command,
)

needs_no_ziglang = pytest.mark.skipif(
    find_spec("ziglang") is not None, reason="ziglang is a compiler that needs no PATH"
)


def script(folder: Path, name: str, text: str) -> Path:
    """A program of a few lines."""
    folder.mkdir(exist_ok=True)
    path = folder / name
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(0o755)
    return path


FAKE = 'case "$*" in *--version) echo "fake 1.0"; echo more;; *) echo fake-linux;; esac'


def test_cc_comes_first(cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = script(tmp_path / "bin", "mycc", FAKE)
    monkeypatch.setenv("CC", f"{path} -m64")
    assert find_compiler() == Compiler((str(path), "-m64"), "fake 1.0", "fake-linux")
    assert find_compiler().identity == "fake 1.0 (fake-linux)"


def test_names_are_tried_in_order_and_one_that_fails_is_passed_over(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script(tmp_path / "bin", "cc", "exit 1")  # as on a Mac without the command line tools
    script(tmp_path / "bin", "gcc", FAKE)
    script(tmp_path / "bin", "clang", FAKE)
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    assert find_compiler().command == (str(tmp_path / "bin" / "gcc"),)


def test_a_compiler_is_asked_once_until_its_file_changes(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked = tmp_path / "asked"
    path = script(tmp_path / "bin", "mycc", f"echo x >> {asked}\n{FAKE}")
    monkeypatch.setenv("CC", str(path))
    for _ in range(3):
        compilers._find.cache_clear()
        assert find_compiler().version == "fake 1.0"
    assert asked.read_text() == "x\n" * 2  # its version, and what it compiles for
    script(tmp_path / "bin", "mycc", f"echo x >> {asked}\n{FAKE.replace('1.0', '1.0.1')}")
    compilers._find.cache_clear()
    assert find_compiler().version == "fake 1.0.1"


def test_another_compiler_means_other_objects(
    compiler: Compiler, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    unit = TranslationUnit("one", "int one(void) { return 1; }\n")
    build([unit])
    wrapped = script(tmp_path / "bin", "mycc", f'exec {compiler.command[0]} "$@"')
    monkeypatch.setenv("CC", str(wrapped))
    assert build([unit]).compiled == ("one",)


@needs_no_ziglang
def test_no_compiler(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    assert not available()
    with pytest.raises(MissingCompilerError, match="none was found; install one with: ") as caught:
        build([TranslationUnit("one", "")])
    assert caught.value.exit_code == 4 and install_command() in str(caught.value)


@needs_no_ziglang
def test_no_compiler_that_works(
    cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    script(tmp_path / "bin", "cc", "exit 1")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    with pytest.raises(MissingCompilerError, match="bin/cc' does not answer to --version"):
        find_compiler()


@pytest.mark.parametrize("chosen", ["no-such-compiler -O3", "'gcc", "/dev/null"])
def test_a_cc_that_is_not_there_is_not_replaced(
    chosen: str, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CC", chosen)
    assert not available()
    with pytest.raises(MissingCompilerError, match="CC is "):
        find_compiler()


@pytest.mark.parametrize(
    ("release", "expected"),
    [
        ({"ID": "debian"}, "sudo apt install gcc libc6-dev (or pip install"),
        ({"ID": "mint", "ID_LIKE": "ubuntu debian"}, "sudo apt install gcc libc6-dev (or pip"),
        ({"ID": "rocky", "ID_LIKE": "rhel centos fedora"}, "sudo dnf install gcc (or pip"),
        ({"ID": "other"}, "pip install "),
    ],
)
def test_the_command_that_installs_one_is_the_systems(
    release: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(platform, "freedesktop_os_release", lambda: release)
    assert install_command().startswith(expected)
    monkeypatch.setattr(sys, "platform", "darwin")
    assert install_command().startswith("xcode-select --install")


@pytest.mark.usefixtures("compiler")
def test_the_compiler_of_a_package(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ziglang")
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", "")
    assert find_compiler().command[:4] == (sys.executable, "-m", "ziglang", "cc")
    assert build([TranslationUnit("one", "int one(void) { return 1; }\n")]).functions.one() == 1


def test_loading_what_is_needed_for_a_cached_start_is_cheap() -> None:
    code = "import sys, runtime.toolchain; print(*{'subprocess', 'platform'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == ""
