"""Tests that need a C compiler are skipped without one, and say how to install one."""

from __future__ import annotations

import pytest

from runtime.toolchain import available, install_command

REASON = f"no C compiler; install one: {install_command()}"
needs_compiler = pytest.mark.skipif(not available(), reason=REASON)


def skip_without_compiler() -> None:
    """Skip the test that calls this if there is no C compiler."""
    if not available():
        pytest.skip(REASON)
