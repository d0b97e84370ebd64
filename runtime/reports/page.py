"""The HTML document of a report: its head, its sections, and what a browser may load for it.

In: the title, the facts and the sections of a report. Out: a document that stands alone.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from pathlib import Path

from runtime.tables import Html, element, join, text

# A browser loads nothing for a report, and runs only our own script, if there is one, whatever the
# report contains.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def page(
    kind: str,
    title: str,
    lead: str,
    facts: Html,
    sections: Mapping[str, Html],
    folder: Path,
    found: str = "",
    style: str = "",
    script: str = "",
) -> str:
    """A whole HTML document.

    Parameters
    ----------
    kind : of the subject, in a word or two.
    title, lead : the heading and a summary of one sentence.
    facts : the few values at the top.
    sections : contents by title, with links at the top; empty ones are left out.
    folder : of the subject, named in the last line.
    found : what came out, in a sentence or two.
    style, script : beside those of all pages; no other script than this one runs.
    """
    style = Path(__file__).with_name("report.css").read_text(encoding="utf-8") + style
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = POLICY + (f"; script-src 'sha256-{digest}'" if script else "")
    shown = {title: content for title, content in sections.items() if content}
    links = [element("a", title, href=f"#{_anchor(title)}") for title in shown]
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=policy),
        element("title", f"{title} · {kind}"),
        # Without one, a browser asks the server for an icon.
        element("link", rel="icon", href="data:,"),
        Html(f"<style>\n{style}</style>"),
    )
    body = element(
        "body",
        element(
            "header",
            element("p", kind, class_="kind"),
            element("h1", _breakable(title)),
            element("p", found, class_="found") if found else Html(""),
            element("p", lead, class_="lead"),
            facts,
            element("nav", *links, aria_label="contents"),
        ),
        "\n",
        element("main", *(join(_section(*item), "\n") for item in shown.items())),
        element("footer", element("p", f"Made by runtime report from {folder.resolve().name}.")),
        Html(f"<script>{script}</script>") if script else Html(""),
    )
    return f'<!doctype html>\n<html lang="en">\n{head}\n{body}\n</html>\n'


def _breakable(name: str) -> Html:
    """A name that may be wrapped after each underscore."""
    return Html(text(name).replace("_", "_<wbr>"))


def _section(title: str, content: Html) -> Html:
    name = _anchor(title)
    heading = element("h2", title, id=f"{name}-title")
    return element("section", heading, content, id=name, aria_labelledby=f"{name}-title")


def _anchor(title: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in title.lower())
