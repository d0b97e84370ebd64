"""The runs that are compared, each with a short distinctive label.

In: run folders. Out: :class:`Run` each; labels are what sets a run apart from the others::

    two runs of one graph, seeds 1 and 2, one with lqr.q set  ->  "seed 1", "lqr.q=[1, 1], seed 2"
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from runtime.document import Override, parse_yaml
from runtime.errors import UsageError
from runtime.observation import RunData
from runtime.runs import RESOLVED, read_run, run_folder

LABEL = 32  # characters
_STAMP = re.compile(r"\d{8}-\d{6}-([0-9a-f]{6})")


@dataclass(frozen=True)
class Run:
    """A run with its label; ``document`` is its resolved graph as plain values."""

    label: str
    folder: Path
    result: RunData
    document: dict[str, Any]


def open_runs(paths: Sequence[str | Path], labels: Sequence[str] = ()) -> list[Run]:
    """Read runs and label them.

    Parameters
    ----------
    paths : run folders, links to them, or their manifests; two or more.
    labels : one for each; by default, the changes and the seed by which it differs from the others.

    Raises
    ------
    UsageError : a run cannot be read; fewer than two runs; too few or duplicate labels.
    """
    if len(paths) < 2:
        raise UsageError(f"expected two or more runs, got {len(paths)}")
    if labels and len(labels) != len(paths):
        raise UsageError(f"expected a label for each of {len(paths)} runs, got {len(labels)}")
    if len(set(labels)) < len(labels) or "" in labels:
        raise UsageError(
            f"expected distinct and non-empty labels, got {', '.join(map(repr, labels))}"
        )
    folders = [run_folder(path) for path in paths]
    results = [read_run(folder) for folder in folders]
    names = labels or _labels(folders, results)
    return [
        Run(name, folder, result, _document(folder, result))
        for name, folder, result in zip(names, folders, results, strict=True)
    ]


def _document(folder: Path, result: RunData) -> dict[str, Any]:
    plain = parse_yaml(result.texts[RESOLVED], str(folder / RESOLVED)).plain()
    if not isinstance(plain, dict):
        raise UsageError(f"'{folder / RESOLVED}' is damaged: expected a mapping")
    return plain


def _labels(folders: Sequence[Path], results: Sequence[RunData]) -> list[str]:
    """Labels from graph, changes and seed, with the run's id where these are the same."""
    changes = [[Override.parse(str(o)) for o in r.manifest["overrides"] if o] for r in results]
    common = set.intersection(*map(set, changes))
    titles = len({r.title for r in results}) > 1
    seeds = len({r.manifest["seed"] for r in results}) > 1
    labels = []
    for result, own_changes in zip(results, changes, strict=True):
        own = [_short(o) for o in own_changes if o not in common and not _sets_seed(o)]
        parts = [result.title] * titles + own
        parts += [f"seed {result.manifest['seed']}"] * seeds
        labels.append(_cut(", ".join(parts) or "as written"))
    counts = Counter(labels)
    if any(count > 1 for count in counts.values()):
        all_equal = len(counts) == 1
        labels = [
            (_id(folder) if all_equal else f"{label[: LABEL - 8]} {_id(folder)}")
            if counts[label] > 1
            else label
            for label, folder in zip(labels, folders, strict=True)
        ]
    return _number_duplicates(labels)


def _sets_seed(change: Override) -> bool:
    return (change.kind, change.target) == ("set", "run.seed")


def _short(change: Override) -> str:
    """A change as it reads in a list: 'lqr.q=[1, 1, 1]' of 'set blocks.lqr.q=[1, 1, 1]'."""
    if change.kind not in ("set", "wire"):
        return str(change)
    return f"{change.target.removeprefix('blocks.')}={change.value}"


def _cut(text: str) -> str:
    text = "".join(c if c.isprintable() else " " for c in text)
    return text if len(text) <= LABEL else f"{text[: LABEL - 1]}…"


def _id(folder: Path) -> str:
    name = folder.resolve().name
    stamp = _STAMP.fullmatch(name)
    return _cut(stamp.group(1) if stamp else name)


def _number_duplicates(labels: Sequence[str]) -> list[str]:
    """Labels with numbers after duplicates, since the same folder may be given twice."""
    seen: Counter[str] = Counter()
    numbered = []
    for label in labels:
        seen[label] += 1
        numbered.append(label if seen[label] == 1 else f"{label} ({seen[label]})")
    return numbered
