"""The page of measurements, one section of which can be replaced."""

from __future__ import annotations

import pytest

pytest.importorskip("numba", reason="loops written by hand need numba (extra 'bench')")

from benchmarks.__main__ import replaced

PAGE = "# Page\n\n## One\n\n1\n\n## Two\n\n2\n\n## Three\n\n3\n"


@pytest.mark.parametrize("heading", ["One", "Two", "Three"])
def test_one_section_is_replaced_and_no_other(heading: str) -> None:
    new = replaced(PAGE, f"\n## {heading}\n\nnew\n")
    number = {"One": "1", "Two": "2", "Three": "3"}[heading]
    assert new == PAGE.replace(f"\n{number}\n", "\nnew\n")


def test_a_section_that_the_page_does_not_have_is_its_last() -> None:
    assert replaced(PAGE, "\n## Four\n\n4\n") == PAGE + "\n## Four\n\n4\n"
