"""HTML from Python: text is escaped wherever it comes from, markup is a type of its own."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape

VOID = ("br", "hr", "link", "meta")
SPACES = "\n\t\u00a0\u202f"


class Html(str):
    """Text that is markup already; every other text is escaped when it enters an element."""

    __slots__ = ()


def text(value: str) -> Html:
    """Escaped text; letters that no page may hold become a replacement sign."""
    shown = "".join(c if c.isprintable() or c in SPACES else "\ufffd" for c in value)
    return Html(escape(shown))


def join(*parts: str) -> Html:
    """Parts one after the other, those escaped that are no markup yet."""
    return Html("".join(part if isinstance(part, Html) else text(part) for part in parts))


def element(tag: str, /, *children: str, **attributes: str) -> Html:
    """``<tag attributes>children</tag>``; ``class_`` stands for class, ``_`` for ``-``."""
    given = "".join(
        f' {key.rstrip("_").replace("_", "-")}="{text(value)}"' for key, value in attributes.items()
    )
    if tag in VOID:
        return Html(f"<{tag}{given}>")
    return Html(f"<{tag}{given}>{join(*children)}</{tag}>")


def table(
    head: Sequence[str],
    rows: Iterable[Sequence[str]],
    numbers: Sequence[int] = (),
    *,
    label: str,
    wraps: Sequence[int] = (),
) -> Html:
    """A table that scrolls by itself where it is wider than the page.

    Parameters
    ----------
    head : a title a column.
    rows : cells; the first one of a row names it.
    numbers : columns that hold numbers, aligned at their right.
    label : what the table shows, for those who cannot see it.
    wraps : columns whose texts may take several lines.
    """
    kinds = _kinds(len(head), numbers, wraps)
    return _table(head, element("tbody", *_rows(rows, kinds)), kinds, label)


def grouped_table(
    head: Sequence[str],
    groups: Mapping[str, Iterable[Sequence[str]]],
    numbers: Sequence[int] = (),
    *,
    label: str,
) -> Html:
    """A table whose rows stand under the names of their groups."""
    kinds = _kinds(len(head), numbers, ())
    bodies = []
    for name, rows in groups.items():
        title = element("th", name, scope="rowgroup", colspan=str(len(head)))
        bodies.append(element("tbody", element("tr", title, class_="group"), *_rows(rows, kinds)))
    return _table(head, join(*bodies), kinds, label)


def _kinds(count: int, numbers: Sequence[int], wraps: Sequence[int]) -> list[dict[str, str]]:
    """The attributes of the cells of each column."""
    names = ["number" if i in numbers else "wrap" if i in wraps else "" for i in range(count)]
    return [{"class_": name} if name else {} for name in names]


def _rows(rows: Iterable[Sequence[str]], kinds: Sequence[dict[str, str]]) -> Iterator[Html]:
    for first, *others in rows:
        cells = [element("th", first, scope="row", **kinds[0])]
        cells += [element("td", cell, **kind) for cell, kind in zip(others, kinds[1:], strict=True)]
        yield element("tr", *cells)


def _table(head: Sequence[str], body: Html, kinds: Sequence[dict[str, str]], label: str) -> Html:
    titles = [
        element("th", title, scope="col", **kind) for title, kind in zip(head, kinds, strict=True)
    ]
    whole = element("table", element("thead", element("tr", *titles)), "\n", body)
    return scrolling(whole, label)


def scrolling(content: Html, label: str, kind: str = "") -> Html:
    """A frame that scrolls sideways, by keys too, where its content is wider than the page."""
    name = f"scroll {kind}".strip()
    return element("div", content, class_=name, tabindex="0", role="region", aria_label=label)


def facts(pairs: Iterable[tuple[str, str]], kind: str = "facts") -> Html:
    """Short facts, each under its name."""
    items = [element("div", element("dt", name), element("dd", value)) for name, value in pairs]
    return element("dl", *items, class_=kind)


def bullets(items: Iterable[str], kind: str = "") -> Html:
    """A list."""
    attributes = {"class_": kind} if kind else {}
    return element("ul", *(element("li", item) for item in items), **attributes)
