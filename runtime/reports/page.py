"""The page around a report: head, contents, style; nothing in it comes from elsewhere."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files

from runtime.reports.html import Html, element, join, text

# Whatever a report may hold, a browser loads nothing for it and runs nothing in it.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


def page(
    kind: str,
    title: str,
    lead: str,
    facts: Html,
    sections: Mapping[str, Html],
    made_by: str,
) -> str:
    """A whole HTML document.

    Parameters
    ----------
    kind : what is reported on, in a word or two.
    title, lead : the heading, and what was done in one sentence.
    facts : the few numbers that come first.
    sections : the rest by their titles, each linked to from the top; empty ones are left out.
    made_by : the last line.
    """
    style = files("runtime.reports").joinpath("report.css").read_text(encoding="utf-8")
    shown = {title: content for title, content in sections.items() if content}
    links = [element("a", title, href=f"#{_anchor(title)}") for title in shown]
    head = element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("meta", http_equiv="Content-Security-Policy", content=POLICY),
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
            element("p", lead, class_="lead"),
            facts,
            element("nav", *links, aria_label="contents"),
        ),
        "\n",
        element("main", *(join(_section(*item), "\n") for item in shown.items())),
        element("footer", element("p", made_by)),
    )
    return f'<!doctype html>\n<html lang="en">\n{head}\n{body}\n</html>\n'


def _breakable(name: str) -> Html:
    """A name that may go on in another line after each underscore."""
    return Html(text(name).replace("_", "_<wbr>"))


def _section(title: str, content: Html) -> Html:
    name = _anchor(title)
    heading = element("h2", title, id=f"{name}-title")
    return element("section", heading, content, id=name, aria_labelledby=f"{name}-title")


def _anchor(title: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in title.lower())
