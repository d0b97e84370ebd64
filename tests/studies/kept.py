"""Results of runs in a file, so that a study which was interrupted continues.

Nothing is kept unless ``use`` names a folder. What it holds is of the code that wrote it.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

FILE = "runs.jsonl"
_file: list[Path] = []
_known: dict[str, Any] = {}


def use(folder: Path) -> None:
    """Keep results in a folder from now on, and take those that it holds."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / FILE
    _file[:] = [path]
    if path.exists():
        lines = path.read_text(encoding="utf-8").splitlines()
        _known.update(json.loads(line) for line in lines)


def known(key: str) -> bool:
    """Whether there is a result."""
    return key in _known


def result(key: str) -> Any:
    """A result that is known."""
    return _known[key]


def add(key: str, value: Any) -> None:
    """Keep a result: plain data, which JSON can hold."""
    _known[key] = value
    for path in _file:
        with path.open("a", encoding="utf-8") as lines:
            lines.write(json.dumps([key, value]) + "\n")


def kept(key: str, make: Callable[[], Any]) -> Any:
    """A result, made now unless it is known."""
    if key not in _known:
        add(key, make())
    return _known[key]
