"""The cheap graph in an empty folder."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.experiments.graphs import write_graph


@pytest.fixture
def draw(tmp_path: Path) -> Path:
    """The graph's file, in the folder where the command line runs."""
    return write_graph(tmp_path)
