"""Settings of the site: ``python -m sphinx -W -b html docs docs/_build`` builds it."""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import site_pages  # noqa: E402
from docstrings import with_fields  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402

site_pages.write(HERE / "generated")

project = "spikeblocks"
author = "the authors of spikeblocks"
html_title = "spikeblocks"
html_theme = "furo"
html_show_copyright = False
html_static_path: list[str] = []
exclude_patterns = ["_build"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]
# A page that no section lists yet is still built.
suppress_warnings = ["toc.not_included", "myst.xref_ambiguous"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}


def setup(app: Sphinx) -> None:
    """Show the sections of docstrings as fields."""

    def changed(
        app: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]
    ) -> None:
        lines[:] = with_fields(list(lines))

    app.connect("autodoc-process-docstring", changed)
