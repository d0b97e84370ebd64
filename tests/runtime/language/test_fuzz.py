"""Random edits at random places of shipped graphs: every question has an answer."""

from __future__ import annotations

import random
import tracemalloc
from collections.abc import Iterator
from pathlib import Path

import pytest

from runtime.language import (
    Model,
    Project,
    Span,
    Surroundings,
    actions,
    complete,
    definition,
    diagnose,
    folds,
    format_edits,
    hints,
    hover,
    lenses,
    outline,
    references,
    rename_span,
    signature,
)
from tests.runtime.language.texts import GRAPHS

FILES = sorted(GRAPHS.rglob("*.yaml"))
PIECES = (
    *("{", "}", "[", "]", ":", ": ", ",", "- ", "'", '"', "#", " ", "  ", "\n", "\n  ", "\t", "|"),
    *("&a ", "*a", "!!x ", "$", "$v_r", ".", "🙂", "é", "\u2028", "\x00", "\r\n", "---\n", "null"),
    *(
        "type: Sum",
        "error: ",
        "blocks:\n",
        "wires:\n",
        "of: ",
        "kind: map",
        "graph: x.yaml",
        "1e999",
    ),
    *("extends: wall_following\n", "without: [lqr]\n", "experiment: x\n", "inputs: {a: Pose}\n"),
)


def edits(text: str, rng: random.Random, count: int) -> Iterator[tuple[str, int]]:
    """Texts, each one edit from the one before, with the place of the edit."""
    for _ in range(count):
        place = rng.randrange(len(text) + 1)
        kind = rng.random()
        if kind < 0.45:
            text = text[:place] + rng.choice(PIECES) + text[place:]
        elif kind < 0.75:
            text = text[:place] + text[place + rng.choice((1, 1, 2, 8, 40)) :]
        else:
            start = rng.randrange(len(text) + 1)
            copied = text[start : start + rng.choice((5, 20, 80))]
            text = text[:place] + copied + text[place:]
        yield text, min(place, len(text))


def asked(model: Model, offset: int) -> int:
    """Ask every question about a text and an offset; returns the number of problems."""
    size = len(model.text.source)
    problems = diagnose(model)
    for found in problems:
        assert 0 <= found.span.start <= found.span.end <= size
    for offer in complete(model, offset).offers:
        assert offer.text
    card = hover(model, offset)
    assert card is None or 0 <= card.span.start <= card.span.end <= size
    told = signature(model, offset)
    assert told is None or all(name in told.label for name, _ in told.parameters)
    project = Project([model])
    for place in (*definition(model, offset, project), *references(model, offset, project)):
        assert 0 <= place.span.start <= place.span.end
        assert place.span.end <= size or place.path != model.path
    name = rename_span(model, offset)
    assert name is None or 0 <= name.start <= offset <= name.end <= size
    for action in actions(model, Span(offset, offset)):
        for edit in action.edits:
            assert 0 <= edit.span.start <= edit.span.end <= size
    for symbol in outline(model):
        assert 0 <= symbol.span.start <= symbol.span.end <= size
        assert symbol.span.start <= symbol.name_span.start <= symbol.name_span.end <= size
    for first, last, _ in folds(model):
        assert 0 <= first < last < len(model.text.starts)
    before = -1
    for span, _ in format_edits(model):
        assert before <= span.start <= span.end <= size  # in order, and none in another
        before = span.end
    assert all(0 <= hint.offset <= size for hint in hints(model, Span(0, size)))
    assert all(0 <= lens.span.start <= lens.span.end <= size for lens in lenses(model))
    return len(problems)


def ask_all(seed: int, count: int, per_file: int, files: list[Path] = FILES) -> int:
    """Ask every question about edited texts; returns the number of problems in all of them."""
    rng = random.Random(seed)
    done = problems = 0
    while done < count:
        path = rng.choice(files)
        surroundings = Surroundings()
        original = path.read_text(encoding="utf-8")
        for text, place in edits(original, rng, min(per_file, count - done)):
            model = Model(text, path, surroundings)
            offset = place if rng.random() < 0.5 else rng.randrange(len(text) + 1)
            try:
                problems += asked(model, offset)
            except Exception as error:
                error.add_note(f"{path.name}, seed {seed}, at {offset} of {text!r}")
                raise
            done += 1
    return problems


def test_random_edits_and_places() -> None:
    quick = [path for path in FILES if path.parent.name not in ("experiments", "starters")]
    # Nearly every edit makes a mistake, and the texts keep those that were made before.
    assert ask_all(seed=1, count=200, per_file=20, files=quick) > 200


@pytest.mark.slow
def test_five_thousand_random_edits_and_places_in_bounded_memory() -> None:
    ask_all(seed=2, count=4250, per_file=20)
    # Tracing takes three times as long, so a part of the edits is traced: what caches hold at a
    # time differs by 6 MB, and 6 kB that each edit leaves behind would be 3 MB more.
    tracemalloc.start()
    ask_all(seed=3, count=250, per_file=1)  # so that every file has been read
    before, _ = tracemalloc.get_traced_memory()
    ask_all(seed=4, count=500, per_file=20)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert after - before < 9e6
