"""The command that installs an extra of this checkout from another folder."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def install_line(extra: str) -> str:
    return f"pip install -e '{ROOT}[{extra}]'"
