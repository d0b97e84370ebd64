"""Parts of reports."""

from __future__ import annotations

from pathlib import Path

from runtime.reports import pieces


def test_of_a_very_long_graph_the_beginning_is_shown() -> None:
    shown = str(pieces.graph_text("a" * 3_000_000, Path("g.yaml"), "Ran by", " runs it."))
    assert "Its first 1,000,000 characters:" in shown
    assert 1_000_000 < len(shown) < 1_010_000
    assert "Its first" not in str(pieces.graph_text("graph: a\n", Path("g.yaml"), "", ""))
