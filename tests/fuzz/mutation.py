"""Mutations of trees (dicts and lists), of texts and of bytes."""

from __future__ import annotations

import copy
import re
from collections.abc import Iterator
from typing import Any

from hypothesis import strategies as st

TOKENS = (
    *("{", "}", "[", "]", ":", ": ", ",", "- ", "? ", "&a ", "*a", "<<: ", "!!str ", "!x "),
    *("|", ">", "\t", "  ", "\n", "\r", "\x00", "\x85", "\u2028", "\ufeff", "'", '"', "#", "%"),
    *("@", "`", "---\n", "...", "~", "null", "1e999", "-.inf", ".nan", "0x1F", "010", "1_000"),
    *("12:30", "$", "$zz", ".", "..", "é", "\U0001f916", "=", "\\", "extends: [", "inputs."),
)


def entries(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """The paths of all entries below a node."""
    keys = node.keys() if isinstance(node, dict) else range(len(node))
    for key in keys:
        yield (*path, key)
        if isinstance(node[key], (dict, list)):
            yield from entries(node[key], (*path, key))


def values(texts: list[str]) -> st.SearchStrategy[Any]:
    """Values of every kind, likely and unlikely; ``texts`` are some that mean something."""
    return st.one_of(
        st.sampled_from([None, True, False, 0, 1, -1, 2, 7, 0.5, -0.5, 1e-9, 1e300, 10**30]),
        st.sampled_from([float("nan"), float("inf"), "", " ", ".", "a.b.c.d", "$", "$zz"]),
        st.sampled_from([[], {}, [[]], [None], {"": None}, ["plant.pose"], {"type": "Sum"}]),
        st.sampled_from(texts),
        st.text(max_size=4),
    ).map(copy.deepcopy)


def follow(tree: Any, path: tuple[Any, ...]) -> Any:
    """The node at the end of a path."""
    for key in path:
        tree = tree[key]
    return tree


def mutate_tree(draw: st.DrawFn, tree: Any, names: list[str], texts: list[str]) -> Any:
    """A copy of a tree with one to three entries deleted, renamed, retyped, moved or added."""
    tree = copy.deepcopy(tree)
    for _ in range(draw(st.integers(1, 3))):
        paths = sorted(entries(tree), key=str)
        if not paths:
            break
        *above, key = draw(st.sampled_from(paths))
        owner = follow(tree, tuple(above))
        what = draw(st.sampled_from(["delete", "rename", "retype", "move", "add"]))
        if what == "delete":
            del owner[key]
        elif what == "retype":
            owner[key] = draw(values(texts))
        elif what == "move":
            owner[key] = copy.deepcopy(follow(tree, draw(st.sampled_from(paths))))
        elif isinstance(owner, list):
            owner.append(draw(values(texts)))
        elif what == "add":
            owner[draw(st.sampled_from(names) | st.text(max_size=4))] = draw(values(texts))
        else:
            name = draw(st.sampled_from(names) | st.just(key[:-1]) | st.just(f"{key}x"))
            renamed = [(name if k == key else k, v) for k, v in owner.items()]
            owner.clear()
            owner.update(renamed)
    return tree


def _span(draw: st.DrawFn, text: Any) -> tuple[int, int]:
    start = draw(st.integers(0, len(text)))
    return start, min(len(text), start + draw(st.sampled_from([1, 1, 2, 5, 20, 200])))


def mutate_text(draw: st.DrawFn, text: str) -> str:
    """A copy of a text with one to three spans deleted, doubled, moved, replaced or indented."""
    for _ in range(draw(st.integers(1, 3))):
        start, stop = _span(draw, text)
        what = draw(st.sampled_from(["token", "delete", "double", "swap", "word", "indent", "end"]))
        if what == "token":
            stop = draw(st.sampled_from([start, stop]))
            text = text[:start] + draw(st.sampled_from(TOKENS)) + text[stop:]
        elif what == "delete":
            text = text[:start] + text[stop:]
        elif what == "double":
            text = text[:stop] + text[start:stop] + text[stop:]
        elif what == "end":
            text = text[:start]
        elif what == "indent":
            lines = text.split("\n")
            line = draw(st.integers(0, len(lines) - 1))
            lines[line] = draw(st.sampled_from(["", " ", "  ", "    ", "\t"])) + lines[line].strip()
            text = "\n".join(lines)
        else:
            pattern = r"\S+" if what == "word" else r"[^\n]+"
            spans = [match.span() for match in re.finditer(pattern, text)]
            if spans:
                (a, b), (c, d) = sorted(draw(st.tuples(*[st.sampled_from(spans)] * 2)))
                text = text[:a] + text[c:d] + text[b:c] + text[a:b] + text[d:]
    return text


def mutate_bytes(draw: st.DrawFn, data: bytes) -> bytes:
    """Bytes cut off, overwritten, emptied, or with some left out."""
    what = draw(st.sampled_from(["cut", "overwrite", "leave out", "empty", "zeros"]))
    start, stop = _span(draw, data)
    if what == "cut":
        return data[:start]
    if what == "overwrite":
        new = draw(st.binary(min_size=1, max_size=8))
        return data[:start] + new + data[start + len(new) :]
    if what == "leave out":
        return data[:start] + data[stop:]
    return b"" if what == "empty" else bytes(len(data))
