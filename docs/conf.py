"""Settings of the site: ``python -m sphinx -W -b html docs docs/_build`` builds it."""

from __future__ import annotations

import html
import os
import re
import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent)]

import evidence  # noqa: E402
import site_pages  # noqa: E402
from block_links import link_blocks, set_equations  # noqa: E402
from docstrings import with_fields  # noqa: E402
from docutils import nodes  # noqa: E402
from sphinx.application import Sphinx  # noqa: E402

site_pages.write(HERE / "generated")
RUNS = os.environ.get("SPIKEBLOCKS_DOCS_RUNS") != "0"
PLOTS = evidence.plots(HERE / "generated") if RUNS else ""
FIGURES = evidence.figures(HERE / "generated") if RUNS else ""

ABOUT = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
REPOSITORY = ABOUT["urls"]["Repository"]
project = "spikeblocks"
author = "the authors of spikeblocks"
html_title = "spikeblocks"
html_theme = "furo"
html_show_copyright = False
# Of the repository github.com/OWNER/NAME: its pages.
html_baseurl = re.sub(r"github\.com/([^/]+)/", r"\1.github.io/", REPOSITORY) + "/"
html_static_path = ["static", "generated/static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_logo = "static/logo.svg"
html_favicon = "static/logo.svg"
html_theme_options = {
    "source_repository": f"{REPOSITORY}/",
    "source_branch": "main",
    "source_directory": "docs/",
    "light_css_variables": {"color-brand-primary": "#0b5f91", "color-brand-content": "#0b5f91"},
    "dark_css_variables": {"color-brand-primary": "#7cc4ee", "color-brand-content": "#7cc4ee"},
}
exclude_patterns = ["_build"]
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_heading_anchors = 4
myst_enable_extensions = ["attrs_inline"]
# Text of equations, as in "x' = v", stays as it is written.
smartquotes = False
# A page that no section lists yet is still built.
suppress_warnings = ["toc.not_included", "myst.xref_ambiguous"]
autodoc_typehints = "description"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True, "show-inheritance": True}


def setup(app: Sphinx) -> None:
    """Sections of docstrings as fields, names of blocks as links, what a shared link shows."""

    def changed(
        app: Sphinx, what: str, name: str, item: object, options: object, lines: list[str]
    ) -> None:
        lines[:] = with_fields(list(lines))

    def completed(app: Sphinx, page: str, source: list[str]) -> None:
        source[0] = source[0].replace("{{ repository }}", REPOSITORY)
        # Not in blocks.md itself, which is also read where it is stored.
        if page == "blocks":
            source[0] += "\n```{toctree}\n:hidden:\n:glob:\n\nblocks/*\n```\n"
        elif page == "performance":
            source[0] = evidence.with_bars(source[0])
        elif page == "observing":
            source[0] = source[0].replace("\n## Metrics\n", f"{PLOTS}\n## Metrics\n")
        elif page == "reproduction":
            source[0] = source[0].replace("\n## Claims\n", f"{FIGURES}\n## Claims\n")

    app.connect("autodoc-process-docstring", changed)
    app.connect("source-read", completed)
    app.connect("doctree-resolved", link_blocks)
    app.connect("doctree-read", lambda app, tree: set_equations(tree))
    app.connect("html-page-context", describe)
    app.connect("html-page-context", name_sections, priority=900)  # after the theme


def name_sections(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: nodes.document | None
) -> None:
    """Give the sections of the contents a level, which the theme leaves out; load pictures late."""
    contents = context.get("furo_navigation_tree", "")
    leveled = contents.replace('role="heading"', 'role="heading" aria-level="2"')
    context["furo_navigation_tree"] = leveled
    if page != "index":  # whose first picture is in sight
        context["body"] = context.get("body", "").replace("<img ", '<img loading="lazy" ')


def describe(
    app: Sphinx, page: str, template: str, context: dict[str, Any], tree: nodes.document | None
) -> None:
    """Add a description and a picture to the head of a page."""
    paragraphs = tree.findall(nodes.paragraph) if tree is not None else ()
    first = next((p.astext() for p in paragraphs if len(p.astext()) > 40), ABOUT["description"])
    text = ABOUT["description"] if page == "index" else " ".join(first.split())
    text = text if len(text) <= 200 else text[:199].rsplit(" ", 1)[0] + " …"
    title = re.sub(r"<[^>]+>", "", context.get("title") or project)
    tags = {
        'name="description"': text,
        'property="og:title"': f"{html.unescape(title)} · spikeblocks",
        'property="og:description"': text,
        'property="og:type"': "website",
        'property="og:image"': f"{html_baseurl}_images/errors.png",
        'name="twitter:card"': "summary_large_image",
    }
    lines = [f'<meta {key} content="{html.escape(value)}">' for key, value in tags.items()]
    context["metatags"] = context.get("metatags", "") + "\n".join(lines)
