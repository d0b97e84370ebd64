"""The figure of the comparison shows the tables of its page."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.studies.contest import picture
from tests.studies.contest.results import RIVAL

PAGE = (picture.DOCS / "comparison.md").read_text(encoding="utf-8")


def test_every_case_has_its_contestants_the_best_first() -> None:
    panels = dict(picture.outcomes(PAGE))
    assert [title.partition(":")[0] for title in panels] == [
        *("Case C, gentle", "Case C, stiff", "Case A, line", "Case B, sine")
    ]
    for title, found in panels.items():
        section = PAGE.partition(f"## {title}")[2].partition("\n##")[0]
        held_out = [line for line in section.splitlines() if line.count("|") == 13][2:]
        assert {one.name for one in found} == {line.split(" | ")[0][2:] for line in held_out}
        assert [one.mean for one in found] == sorted(one.mean for one in found)
        assert all(one.low <= one.mean <= one.high for one in found)
        assert RIVAL in {one.name for one in found}


def test_the_figure_is_drawn_without_the_runs(tmp_path: Path) -> None:
    picture.draw(PAGE, tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 50_000


def test_a_line_of_the_table_is_read_with_its_interval() -> None:
    text = "## Case A, x\n\n| c | t | h |\n| LQR | 1.0 | 8.6 [-5.1, 12.1] | +0.5 |\n## Next\n"
    ((title, found),) = picture.outcomes(text)
    assert title == "Case A, x"
    assert found == [("LQR", pytest.approx(8.6), pytest.approx(-5.1), pytest.approx(12.1))]
