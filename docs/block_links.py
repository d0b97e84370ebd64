"""Names of blocks in the text of a page as links to their descriptions.

In: a page's tree. Out: the same, where `LQR` in code leads to blocks/control.html#lqr.
"""

from __future__ import annotations

from docutils import nodes
from sphinx.application import Sphinx

from blocks.registry import BUILTIN


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
