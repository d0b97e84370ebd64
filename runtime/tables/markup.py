"""HTML elements; all text is escaped, and markup has its own type.

In: strings, and markup made by this module. Out: markup::

    element("p", "a < b", class_="soft")  ->  <p class="soft">a &lt; b</p>
"""

from __future__ import annotations

from collections.abc import Iterable
from html import escape

VOID = ("br", "hr", "link", "meta")
SPACES = "\n\t\u00a0\u202f"


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
