"""Names of blocks in a page as links to their descriptions, and equations there as MathML.

In: a page's tree. Out: the same, where `LQR` in code leads to blocks/control.html#lqr.
"""

from __future__ import annotations

import html
import re
from collections.abc import Collection
from itertools import groupby

from docutils import nodes
from equations import LEFT, pieces
from sphinx.application import Sphinx

from blocks.library.registry import BUILTIN


def link_blocks(app: Sphinx, tree: nodes.document, page: str) -> None:
    """Make a link of each name, except in headings, links and on the page of its own block."""
    if app.builder.format != "html":
        return
    for literal in list(tree.findall(nodes.literal)):
        cls = BUILTIN.get(literal.astext())
        if cls is None or _is_inside(literal, (nodes.reference, nodes.title)):
            continue
        target = f"blocks/{cls.__module__.split('.')[1]}"
        place = f"#{cls.__name__.lower()}"
        address = place if page == target else app.builder.get_relative_uri(page, target) + place
        link = nodes.reference("", "", internal=True, refuri=address)
        literal.replace_self(link)
        link += literal


def _is_inside(node: nodes.Node, kinds: tuple[type[nodes.Node], ...]) -> bool:
    parent = node.parent
    while parent is not None:
        if isinstance(parent, kinds):
            return True
        parent = parent.parent
    return False


def set_equations(tree: nodes.document) -> None:
    """Replace the equations in the descriptions of blocks; a page has a section for each."""
    for section in tree.findall(nodes.section):
        cls = BUILTIN.get(section[0].astext())
        if cls is None:
            continue
        spec = cls.spec
        names = {*spec.inputs, *spec.outputs, *spec.params, *spec.states}
        for block in list(section.findall(nodes.literal_block)):
            _split(block, names)
        for paragraph in section.findall(nodes.paragraph):
            _paragraph(paragraph, names)


def _split(block: nodes.literal_block, names: Collection[str]) -> None:
    """Take the equations of a literal block out of it; the drawing of the box stays."""
    parts = block.astext().split("\n\n")
    is_text = ["=" in part and "─" not in part for part in parts]
    if not any(is_text) or block.get("language") == "yaml":
        return
    block.replace_self(
        [
            _lines(part, names)
            if equations
            else nodes.literal_block(part, part, language=block.get("language", "text"))
            for part, equations in zip(parts, is_text, strict=True)
        ]
    )


def _paragraph(paragraph: nodes.paragraph, names: Collection[str]) -> None:
    """Set the equations of a paragraph; the parser makes a piece of text of each line."""
    runs = [
        list(run) for _, run in groupby(paragraph.children, lambda c: isinstance(c, nodes.Text))
    ]
    children: list[nodes.Node] = []
    for run in runs:
        plain = "".join(child.astext() for child in run)
        if isinstance(run[0], nodes.Text) and re.search("[=<>]", plain):
            before, after = " " * plain[:1].isspace(), " " * plain[-1:].isspace()
            run = [nodes.Text(before), *_set(plain, names), nodes.Text(after)]
        children += run
    paragraph.children = []
    paragraph += children


def _lines(text: str, names: Collection[str]) -> nodes.Node:
    """Equations that stand in lines of their own, some of them with a label before them."""
    rows = nodes.line_block("", classes=["equations"])
    names = {*names, *LEFT.findall(text)}
    for line in text.splitlines():
        row = nodes.line("", "")
        for column in re.split(r" {2,}", line.strip()):
            row += nodes.inline("", "", *_set(column, names), classes=["column"])
        rows += row
    return rows


def _set(text: str, names: Collection[str]) -> list[nodes.Node]:
    """A text whose equations are MathML, with what is written for who hovers over one."""
    return [
        nodes.raw(
            "",
            f'<span class="equation" title="{html.escape(source, quote=True)}">{math}</span>',
            format="html",
        )
        if math
        else nodes.Text(source)
        for source, math in pieces(text, names)
    ]
