"""A run on disk: written beside its final place, then moved there in one step."""

from __future__ import annotations

import hashlib
import json
import re
import secrets
import shutil
import subprocess
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from blocks.signals import FloatArray
from runtime.errors import UsageError
from runtime.result import Result

SCHEMA_VERSION = 1
TIME = "time"
MANIFEST, METRICS, PROBES = "manifest.json", "metrics.json", "probes.npz"
WRITTEN, RESOLVED = "graph.yaml", "graph.resolved.yaml"
DIAGRAM = "diagram.json"


def new_folder(root: Path, title: str) -> Path:
    """A fresh folder name for a run: root/<graph>/<date>-<time>-<id>."""
    slug = re.sub(r"[^A-Za-z0-9_.-]+", "_", title).strip("._") or "graph"
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    return root / slug / f"{stamp}-{secrets.token_hex(3)}"


def portable_modules(plain: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Path]]:
    """A document whose ``module`` files are named as they will lie beside it, and those files."""
    files: dict[str, Path] = {}

    def rename(entries: dict[str, Any]) -> dict[str, Any]:
        renamed = {}
        for name, entry in entries.items():
            changed = dict(entry) if isinstance(entry, dict) else entry
            if isinstance(entry, dict) and isinstance(entry.get("module"), str):
                source = Path(entry["module"])
                local = source.name
                while files.get(local, source) != source:
                    local = f"_{local}"
                files[local] = source
                changed["module"] = local
            if isinstance(entry, dict) and isinstance(entry.get("blocks"), dict):
                changed["blocks"] = rename(entry["blocks"])
            renamed[name] = changed
        return renamed

    return {**plain, "blocks": rename(plain.get("blocks", {}))}, files


def save(result: Result, folder: Path) -> Path:
    """Write a result; the folder appears only when it is complete.

    Raises
    ------
    UsageError : the folder exists, or cannot be written.
    """
    if folder.exists():
        raise UsageError(f"'{folder}' exists already; a run is never written over another")
    partial = folder.with_name(f".{folder.name}.partial")
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(partial, ignore_errors=True)
        partial.mkdir()
        _write(result, partial)
        partial.rename(folder)
    except OSError as error:
        shutil.rmtree(partial, ignore_errors=True)
        raise UsageError(f"cannot write '{folder}': {error.strerror or error}") from None
    return folder


def _write(result: Result, folder: Path) -> None:
    arrays: dict[str, FloatArray] = {}
    for name, recorded in result.probes.items():
        arrays[name] = recorded.values
        arrays[f"{name}.{TIME}"] = recorded.t
    np.savez(folder / PROBES, **arrays)  # type: ignore[arg-type]
    for name, source in result.files.items():
        shutil.copyfile(source, folder / name)
    for name, text in result.texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    _json(folder / METRICS, result.metrics)
    hashes = {path.name: _sha256(path) for path in sorted(folder.iterdir())}
    probes = {
        name: {
            "labels": list(r.labels),
            "units": list(r.units),
            "kinds": list(r.kinds),
            "addresses": {a: list(span) for a, span in r.addresses.items()},
            "auto": r.auto,
        }
        for name, r in result.probes.items()
    }
    plots = [
        {"name": p.name, "kind": p.kind, "of": list(p.of), "title": p.title}
        | {"options": dict(p.options)}
        for p in result.plots
    ]
    details = {
        **result.manifest,
        "git": git_commit(),
        "hashes": hashes,
        "probes": probes,
        "plots": plots,
        "world": None if result.world is None else result.world.description,
    }
    _json(folder / MANIFEST, {**details, "failures": result.failures})


def link_latest(folder: Path) -> None:
    """Point ``latest`` beside a run's folder to it; left out where links are not to be had."""
    link = folder.parent / "latest"
    fresh = folder.parent / f".latest-{secrets.token_hex(3)}"
    try:
        fresh.symlink_to(folder.name, target_is_directory=True)
        fresh.replace(link)
    except OSError:
        fresh.unlink(missing_ok=True)


def _json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(value, indent=2) + "\n", encoding="utf-8")


def _sha256(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def git_commit() -> str | None:
    """The commit of the project in the current folder, marked if files differ; None outside one."""
    try:
        commit = _git("rev-parse", "HEAD")
        return commit + ("+changes" if _git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.SubprocessError):
        return None


def _git(*arguments: str) -> str:
    done = subprocess.run(
        ["git", *arguments], capture_output=True, text=True, timeout=5, check=True
    )
    return done.stdout.strip()
