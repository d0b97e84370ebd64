"""Shared by the tests of exports: none compiles for a microcontroller unless it is about that."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from runtime.export import controller


@pytest.fixture(scope="session", autouse=True)
def _no_sizes() -> Iterator[None]:
    """Leave the sizes on a Cortex-M4 out of reports: each takes another compilation."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(controller, "cortex_sizes", lambda texts: None)
        yield
