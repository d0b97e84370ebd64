"""axe-core finds no serious violation in reports; skipped where it or a browser is missing."""

from __future__ import annotations

from pathlib import Path

import pytest

import runtime
from runtime.reports import report
from tests.accessibility import find_axe, violations, weight

pytestmark = pytest.mark.slow
GRAPH = """
graph: small
run: {dt: 0.01, until: 0.2}
blocks: {one: {type: Constant, value: 1.0}, double: {type: Gain, gain: 2.0}}
wires: {double: {input: one.value}}
probes: {shown: double.out}
"""


@pytest.fixture
def axe() -> Path:
    found = find_axe()
    if found is None:
        pytest.skip("axe-core is not installed; npm install axe-core")
    return found


def test_a_picture_without_words_is_a_violation(axe: Path, tmp_path: Path) -> None:
    page = tmp_path / "wrong.html"
    image = '<img src="data:image/gif;base64,R0lGODlhAQABAAAAACw=">'
    page.write_text(f"<!doctype html><html lang='en'><title>x</title><body>{image}</body></html>")
    assert "image-alt" in [each["id"] for each in violations(page, axe)]
    assert weight(page) == page.stat().st_size


def test_the_report_of_a_run_has_none(axe: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    (tmp_path / "small.yaml").write_text(GRAPH, encoding="utf-8")
    folder = runtime.load(tmp_path / "small.yaml").run().save(tmp_path / "run")
    page.write_text(report(folder).html, encoding="utf-8")
    assert violations(page, axe) == []
