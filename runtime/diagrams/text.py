"""A diagram as text for another layout program: Graphviz dot or a Mermaid flowchart.

In: a :class:`Picture`. Out: one string; a wire is ``"u":"out_out":e -> "g":"in_input":w [...]`` or
``b_u -->|"out → input"| b_g``.
"""

from __future__ import annotations

import html
import json
from collections.abc import Callable, Iterable, Iterator
from itertools import zip_longest

from runtime.diagrams.layout import Link, find_feedback
from runtime.diagrams.paint import (
    BORDER,
    FRAME_BORDER,
    GHOST,
    GHOST_FILL,
    INK,
    PORT_INK,
    SOFT,
    Palette,
    frame_fill,
)
from runtime.diagrams.picture import Box, Net, Part, Picture

INDENT = "  "
MERMAID_PLAIN = frozenset(" _-.,:()[]=+*/→")


def to_dot(picture: Picture) -> str:
    """The diagram for Graphviz: ports on the boxes, parts as clusters, feedback without rank."""
    palette = Palette(picture)
    links = [
        Link(net.source, net.targets, breaks_loop=picture.breaks_loop(net)) for net in picture.nets
    ]
    # Our own choice of feedback, since Graphviz would reverse whichever edges come last in its
    # search.
    back = find_feedback(list(picture.boxes), links)
    lines = [
        f"digraph {_dot_text(picture.title)} {{",
        "  graph [rankdir=LR, nodesep=0.35, ranksep=0.7, fontname=Helvetica]",
        "  node [shape=plain, fontname=Helvetica, fontsize=10]",
        "  edge [fontname=Helvetica, fontsize=9, arrowsize=0.7]",
        *_tree_lines(
            picture,
            lambda box: f"{_dot_text(box.name)} [label=<{_dot_table(box, palette)}>]",
            lambda part: _dot_cluster(part, picture.is_out(part.name)),
            "}",
        ),
    ]
    for i, net in enumerate(picture.nets):
        for target in net.targets:
            is_back = (i, target[0]) in back
            lines.append(INDENT + _dot_edge(net, target, palette.wire(net), is_back))
    return "\n".join([*lines, "}", ""])


def to_mermaid(picture: Picture) -> str:
    """The diagram for Mermaid: parts as subgraphs, wires named ``output → input``."""
    ids = _identifiers([*picture.boxes, *picture.parts])
    lines = [
        "---",
        f"title: {json.dumps(_plain(picture.title))}",
        "---",
        "flowchart LR",
        *_tree_lines(
            picture,
            lambda box: f'{ids[box.name]}["{_mermaid_label(box)}"]',
            lambda part: f'subgraph {ids[part.name]}["{_mermaid_text(part.title)}"]',
            "end",
        ),
    ]
    for net in picture.nets:
        arrow = "-.->" if net.is_ghost else "-->"
        for block, port in net.targets:
            label = _mermaid_text(f"{net.source[1]} → {port}")
            lines.append(f'  {ids[net.source[0]]} {arrow}|"{label}"| {ids[block]}')
    ghosts = [ids[name] for name, box in picture.boxes.items() if box.fate]
    if ghosts:
        style = f"fill:{GHOST_FILL},stroke:{GHOST},color:{GHOST},stroke-dasharray:5 4"
        lines += [f"  classDef removed {style}", f"  class {','.join(ghosts)} removed"]
    return "\n".join([*lines, ""])


def _tree_lines(
    picture: Picture,
    node: Callable[[Box], str],
    opening: Callable[[Part], str],
    closing: str,
    part: str = "",
    depth: int = 1,
) -> Iterator[str]:
    """One line per block; the lines of a part are between an opening and a closing line."""
    for box in picture.boxes.values():
        if box.part == part:
            yield INDENT * depth + node(box)
    for inner in picture.parts.values():
        if inner.parent == part:
            yield INDENT * depth + opening(inner)
            yield from _tree_lines(picture, node, opening, closing, inner.name, depth + 1)
            yield INDENT * depth + closing


def _dot_table(box: Box, palette: Palette) -> str:
    """A block as an HTML-like table whose outer cells are its ports."""
    ink, soft, edge, fill = INK, SOFT, BORDER, palette.tints.get(box.rate, GHOST_FILL)
    style, port_ink = "ROUNDED", PORT_INK
    if box.fate:
        ink = soft = edge = port_ink = GHOST
        style, fill = "ROUNDED,DASHED", GHOST_FILL

    def full_row(text: str) -> str:
        return f'<TR><TD COLSPAN="2">{text}</TD></TR>'

    def port(prefix: str, name: str | None, side: str) -> str:
        if name is None:
            return "<TD></TD>"
        text = _font(_html(name), port_ink, 9)
        return f'<TD PORT="{prefix}{_html(name)}" ALIGN="{side}">{text}</TD>'

    rows = [
        full_row(_font(f"<B>{_html(box.title)}</B>", ink, 12)),
        full_row(_font(_html(box.type), soft, 9)),
        *(
            f"<TR>{port('in_', entry, 'LEFT')}{port('out_', exit_, 'RIGHT')}</TR>"
            for entry, exit_ in zip_longest(box.inputs, box.outputs)
        ),
        full_row(_font(_html(box.fate or box.rate), soft, 8)),
    ]
    return (
        f'<TABLE BORDER="1" CELLBORDER="0" CELLSPACING="0" CELLPADDING="4" STYLE="{style}" '
        f'COLOR="{edge}" BGCOLOR="{fill}">{"".join(rows)}</TABLE>'
    )


def _font(text: str, colour: str, size: int) -> str:
    return f'<FONT COLOR="{colour}" POINT-SIZE="{size}">{text}</FONT>'


def _dot_cluster(part: Part, is_out: bool) -> str:
    style = "rounded,filled,dashed" if is_out else "rounded,filled"
    return (
        f"subgraph {_dot_text(f'cluster_{part.name}')} {{ graph [label={_dot_text(part.title)}, "
        f'style="{style}", color="{FRAME_BORDER}", fillcolor="{frame_fill(part.name)}", '
        f'fontcolor="{SOFT}", fontsize=11, labeljust=l]'
    )


def _dot_edge(net: Net, target: tuple[str, str], colour: str, is_back: bool) -> str:
    ends = (
        f"{_dot_text(net.source[0])}:{_dot_text(f'out_{net.source[1]}')}:e -> "
        f"{_dot_text(target[0])}:{_dot_text(f'in_{target[1]}')}:w"
    )
    facts = [f'color="{colour}"', f'fontcolor="{colour}"']
    if net.type and target == net.targets[0]:
        facts.append(f"label={_dot_text(net.type)}")
    if net.is_ghost:
        facts.append("style=dashed")
    if is_back:
        facts.append("constraint=false")
    return f"{ends} [{', '.join(facts)}]"


def _dot_text(text: str) -> str:
    literal = _plain(text).replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")
    return f'"{literal}"'


def _html(text: str) -> str:
    return html.escape(_plain(text), quote=True)


def _plain(text: str) -> str:
    """A text without control and bidirectional characters, which become question marks."""
    return "".join(c if c.isprintable() or c == "\n" else "?" for c in text)


def _mermaid_label(box: Box) -> str:
    title, kind, rate = map(_mermaid_text, (box.title, box.type, box.fate or box.rate))
    return f"<b>{title}</b><br/>{kind}<br/>{rate}"


def _mermaid_text(text: str) -> str:
    """Text for a quoted string; characters special to Mermaid become numeric entities."""
    return "".join(c if c.isalnum() or c in MERMAID_PLAIN else f"#{ord(c)};" for c in text)


def _identifiers(names: Iterable[str]) -> dict[str, str]:
    """Distinct Mermaid identifiers for names: no keywords, no dots."""
    ids: dict[str, str] = {}
    identifiers: set[str] = set()
    for name in names:
        plain = "b_" + name.replace(".", "__")
        while plain in identifiers:
            plain += "_"
        identifiers.add(plain)
        ids[name] = plain
    return ids
