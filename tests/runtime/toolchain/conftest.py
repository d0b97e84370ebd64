"""A cache folder for each test, and the skip where there is no C compiler."""

from __future__ import annotations

from pathlib import Path

import pytest

from runtime import toolchain
from runtime.toolchain import compilers


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache folder, used by this test alone."""
    monkeypatch.setenv(toolchain.VARIABLE, str(tmp_path / "cache"))
    compilers._find.cache_clear()
    assert toolchain.folder() == tmp_path / "cache"
    return tmp_path / "cache"


@pytest.fixture
def compiler(cache: Path) -> toolchain.Compiler:
    """The system's compiler."""
    if not toolchain.available():
        pytest.skip(f"no C compiler; {toolchain.install_command()}")
    return toolchain.find_compiler()
