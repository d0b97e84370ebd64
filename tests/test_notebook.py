"""The notebook with a live plot: its cells run, with widgets and without them."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

NOTEBOOK = Path(__file__).parent.parent / "examples" / "live_plot.ipynb"
PNG = b"\x89PNG"


def cells() -> list[str]:
    found = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    return ["".join(cell["source"]) for cell in found if cell["cell_type"] == "code"]


def display_of(shown: list[Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """What a notebook shows, without one."""
    module = ModuleType("IPython.display")
    vars(module).update(display=shown.append, Image=bytes)
    package = ModuleType("IPython")
    vars(package)["version_info"] = (9, 0)  # matplotlib looks at it
    monkeypatch.setitem(sys.modules, "IPython", package)
    monkeypatch.setitem(sys.modules, "IPython.display", module)


def test_the_cells_run_without_widgets(monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[Any] = []
    display_of(shown, monkeypatch)
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    space: dict[str, Any] = {}
    for cell in cells():
        exec(cell, space)
    assert len(shown) == 3 and all(picture.startswith(PNG) for picture in shown)
    assert len(set(shown)) == 3 and space["session"].t == pytest.approx(3.0)
    # A push moves the cart, and the regulator brings the pole back.
    assert abs(space["session"].read("cart.angle")) < 0.3


def test_the_widgets_move_the_session(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("ipywidgets")
    display_of([], monkeypatch)
    space: dict[str, Any] = {}
    for cell in cells():
        exec(cell, space)
    session, before = space["session"], space["view"].value
    space["push"].value, space["length"].value = 4.0, 0.8
    for value in (1, 2, 3):
        space["play"].value = value  # as the browser sets it
    assert session.t == pytest.approx(0.4) and session.read("inputs.force") == 4.0
    assert session.graph.to_dict()["blocks"]["cart"]["length"] == 0.8
    assert bytes(space["view"].value).startswith(PNG) and space["view"].value != before


@pytest.mark.slow
def test_the_notebook_runs_in_a_kernel() -> None:
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
    printed = [out for cell in notebook.cells for out in cell.get("outputs", ())]
    assert printed and not any(out["output_type"] == "error" for out in printed)
