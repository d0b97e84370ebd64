"""Texts with a mark for the cursor, and models of them."""

from __future__ import annotations

from pathlib import Path

from runtime.language import Model, Offer, Surroundings, complete

ROOT = Path(__file__).parents[3]
GRAPHS = ROOT / "graphs"
CASE_C = GRAPHS / "wall_following.yaml"
MARK = "¦"
SURROUNDINGS = Surroundings(modules=True)


def marked(text: str, path: Path = CASE_C) -> tuple[Model, int]:
    """The model of a text without its mark, and the offset of the mark."""
    offset = text.index(MARK)
    return Model(text.replace(MARK, "", 1), path, SURROUNDINGS), offset


def edited(old: str, new: str, path: Path = CASE_C) -> tuple[Model, int]:
    """A shipped graph after one edit; the offset of the mark in ``new``, or of the edit."""
    text = path.read_text(encoding="utf-8")
    assert text.count(old) >= 1, old
    changed = text.replace(old, new, 1)
    if MARK in changed:
        return marked(changed, path)
    return Model(changed, path, SURROUNDINGS), text.index(old)


def offered(model: Model, offset: int) -> list[Offer]:
    return list(complete(model, offset).offers)


def labels(model: Model, offset: int) -> list[str]:
    return [offer.label for offer in offered(model, offset)]


def chain(blocks: int) -> str:
    """A graph of many blocks, one after the other."""
    lines = ["graph: chain", "run: {dt: 0.001, until: 1.0}", "blocks:"]
    lines += ["  b0: {type: Constant, value: 1.0}"]
    lines += [f"  b{i}: {{type: Gain, gain: 0.5, dt: 0.01}}   # {i}" for i in range(1, blocks)]
    lines += ["wires:", "  b1: {input: b0.value}"]
    lines += [f"  b{i}: {{input: b{i - 1}.out}}" for i in range(2, blocks)]
    return "\n".join([*lines, "probes:", f"  last: b{blocks - 1}.out", ""])
