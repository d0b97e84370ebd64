"""HTML elements and pages; all text is escaped, and markup has its own type.

In: strings, and markup made by this module. Out: markup::

    element("p", "a < b", class_="soft")  ->  <p class="soft">a &lt; b</p>
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from pathlib import Path

VOID = ("br", "hr", "link", "meta")
SPACES = "\n\t\u00a0\u202f"
# A browser loads nothing for a report, and runs only our own script, if there is one, whatever the
# report contains.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


class Html(str):
    """Text that is markup; any other text is escaped when it is put into an element."""

    __slots__ = ()


def visible(value: str) -> str:
    """A string in which characters that are not printable become U+FFFD."""
    return "".join(c if c.isprintable() or c in SPACES else "\ufffd" for c in value)


def text(value: str) -> Html:
    """Escaped text; characters that are not printable become U+FFFD."""
    return Html(escape(visible(value)))


def join(*parts: str) -> Html:
    """The concatenation of parts, escaped unless they are markup."""
    return Html("".join(part if isinstance(part, Html) else text(part) for part in parts))


def element(tag: str, /, *children: str, **attributes: str) -> Html:
    """``<tag attributes>children</tag>``; ``class_`` stands for class, ``_`` for ``-``."""
    written = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text(value)}"' for key, value in attributes.items()
    )
    if tag in VOID:
        return Html(f"<{tag}{written}>")
    return Html(f"<{tag}{written}>{join(*children)}</{tag}>")


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    numbers: Sequence[int] = (),
    *,
    label: str,
    wraps: Sequence[int] = (),
) -> Html:
    """A table that scrolls if it is wider than the page.

    Parameters
    ----------
    head : a title per column.
    rows : cells; the first one of a row is its header.
    numbers : columns of numbers, aligned right.
    label : a description for screen readers.
    wraps : columns whose text may wrap.
    """
    return grouped_table(head, {"": rows}, numbers, label=label, wraps=wraps)


def grouped_table(
    head: Sequence[str],
    groups: Mapping[str, Iterable[Sequence[str]]],
    numbers: Sequence[int] = (),
    *,
    label: str,
    wraps: Sequence[int] = (),
) -> Html:
    """A table with groups of rows, each below the name of the group, if it has one."""
    columns = range(len(head))
    names = ["number" if i in numbers else "wrap" if i in wraps else "" for i in columns]
    kinds = [{"class_": name} if name else {} for name in names]
    bodies = []
    for name, rows in groups.items():
        title = element("th", name, scope="rowgroup", colspan=str(len(head)))
        above = [element("tr", title, class_="group")] if name else []
        bodies.append(element("tbody", *above, *_rows(rows, kinds)))
    titles = [
        element("th", title, scope="col", **kind) for title, kind in zip(head, kinds, strict=True)
    ]
    top = element("thead", element("tr", *titles))
    return scrolling(element("table", top, "\n", *bodies), label)


def _rows(rows: Iterable[Sequence[str]], kinds: Sequence[dict[str, str]]) -> Iterator[Html]:
    for first, *others in rows:
        cells = [element("th", first, scope="row", **kinds[0])]
        cells += [element("td", cell, **kind) for cell, kind in zip(others, kinds[1:], strict=True)]
        yield element("tr", *cells)


def scrolling(content: Html, label: str, kind: str = "") -> Html:
    """A frame that scrolls sideways, also by keyboard, if its content is wider than the page."""
    name = f"scroll {kind}".strip()
    return element("div", content, class_=name, tabindex="0", role="group", aria_label=label)


def facts(pairs: Iterable[tuple[str, str]], kind: str = "facts") -> Html:
    """Names with their values."""
    items = [element("div", element("dt", name), element("dd", value)) for name, value in pairs]
    return element("dl", *items, class_=kind)


def bullets(items: Iterable[str], kind: str = "") -> Html:
    """A list."""
    attributes = {"class_": kind} if kind else {}
    return element("ul", *(element("li", item) for item in items), **attributes)


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
