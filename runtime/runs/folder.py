"""A run on disk: a folder that is made before the first tick and complete in one step.

Until then all lies in a hidden folder beside it, ``.<name>-<id>.partial``, which is locked while
its process lives: ``recording/`` takes what does not fit into memory, ``run/`` what is to be the
run.
What is killed leaves it behind, see :mod:`runtime.runs.leftovers`.
"""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from datetime import datetime
from pathlib import Path
from tempfile import mkdtemp
from typing import Any

from runtime.errors import UsageError
from runtime.files import json_text, point_link, remove_tree, sha256, slug, write_json, write_whole
from runtime.observation import Probe, Recording, RunData
from runtime.runs.commit import git_commit as git_commit
from runtime.streaming import save_arrays

try:
    import fcntl
except ImportError:  # a system without locks of this kind
    fcntl = None  # type: ignore[assignment]

SCHEMA_VERSION = 1
TIME = "time"
MANIFEST, METRICS, PROBES = "manifest.json", "metrics.json", "probes.npz"
WRITTEN, RESOLVED = "graph.yaml", "graph.resolved.yaml"
DIAGRAM = "diagram.json"
PARTIAL, RECORDING, RUN, LOCK = ".partial", "recording", "run", "lock"


def new_folder(root: Path, title: str) -> Path:
    """A fresh folder name for a run: root/<graph>/<date>-<time>-<id>."""
    stamp = datetime.now().strftime("%Y%m%d-%H%M%S")
    return root / slug(title) / f"{stamp}-{secrets.token_hex(3)}"


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


def contents(files: Mapping[str, Path], texts: Mapping[str, bytes]) -> dict[str, bytes]:
    """What modules hold: as they were read where they were, else as they are now.

    A module that never ran, as with a block given as a class, is read here, once.

    Raises
    ------
    UsageError : one cannot be read.
    """
    found = {}
    for name, path in files.items():
        try:
            known = texts.get(str(path.resolve()))
            found[name] = path.read_bytes() if known is None else known
        except OSError as error:
            raise UsageError(f"cannot read '{path}': {error.strerror or error}") from None
    return found


class Draft:
    """A run folder in the making.

    Parameters
    ----------
    folder : where it is to be; it must not exist yet.

    Raises
    ------
    UsageError : there is something of that name, or nothing can be written there.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.partial = folder.with_name(f".{slug(folder.name)}-{secrets.token_hex(3)}{PARTIAL}")
        self._lock: int | None = None
        try:
            folder.parent.mkdir(parents=True, exist_ok=True)
            if _is_there(folder):
                text = f"'{folder}' exists already; a run is never written over another"
                raise UsageError(text)
            self.partial.mkdir()
            self._lock = os.open(self.partial / LOCK, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC)
        except (OSError, ValueError) as error:
            remove_tree(self.partial)
            raise UsageError(f"cannot write '{folder}': {_reason(error)}") from None
        lock(self._lock)
        # The commit that runs, whatever is checked out meanwhile.
        self.commit = git_commit()

    @property
    def recordings(self) -> Path:
        """Where recordings go that are larger than memory."""
        return self.partial / RECORDING

    def save(self, result: RunData) -> Path:
        """Write the run; its folder appears only when it is complete.

        Raises
        ------
        UsageError : it cannot be written. The recordings are still there.
        """
        complete = self.partial / RUN
        try:
            remove_tree(complete)
            complete.mkdir(parents=True)
            _write(result, complete, self.commit)
            complete.rename(self.folder)
        except OSError as error:
            remove_tree(complete)
            raise UsageError(f"cannot write '{self.folder}': {_reason(error)}") from None
        return self.folder

    def close(self) -> None:
        """Remove what is left beside the folder."""
        remove_tree(self.partial)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def save(result: RunData, folder: Path) -> Path:
    """Write a result; the folder appears only when it is complete.

    Raises
    ------
    UsageError : the folder exists, or cannot be written.
    """
    draft = Draft(folder)
    try:
        return draft.save(result)
    finally:
        draft.close()


def save_elsewhere(result: RunData, name: str) -> Path:
    """Write a result into a fresh temporary folder, where its own place cannot take it.

    Raises
    ------
    UsageError : there is no room there either.
    """
    try:
        root = Path(mkdtemp(prefix="spikeblocks-"))
    except OSError as error:
        raise UsageError(f"cannot write a temporary folder: {_reason(error)}") from None
    try:
        return save(result, root / name)
    except UsageError:
        remove_tree(root)
        raise


def lock(file: int) -> bool:
    """Lock an open file for as long as it is open; False if another process holds it."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _is_there(folder: Path) -> bool:
    """Whether there is anything of that name; an error if there never can be."""
    try:
        folder.lstat()
    except FileNotFoundError:
        return False
    return True


def _reason(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error)


def begin(result: RunData, probes: Mapping[str, Probe], folder: Path) -> None:
    """Write what a recording needs to be read without its process: texts and a manifest.

    Raises
    ------
    UsageError : it cannot be written.
    """
    try:
        _write_texts(result, folder)
    except OSError as error:
        raise UsageError(f"cannot record to '{folder}': {_reason(error)}") from None
    every = {name: probe.every for name, probe in probes.items()}
    details = {**manifest(result, {}, git_commit()), "every": every}
    write_json(folder / MANIFEST, {**details, "metrics": list(result.metrics)})


def _write_texts(result: RunData, folder: Path) -> None:
    for name, content in result.files.items():
        write_whole(folder / name, content)
    for name, text in result.texts.items():
        write_whole(folder / name, text)


def _write(result: RunData, folder: Path, commit: str | None) -> None:
    arrays = {}
    for name, recorded in result.probes.items():
        arrays[name] = recorded.values
        arrays[f"{name}.{TIME}"] = recorded.t
    save_arrays(folder / PROBES, arrays)
    _write_texts(result, folder)
    write_whole(folder / METRICS, json_text(result.metrics, indent=2) + "\n")
    hashes = {path.name: sha256(path) for path in sorted(folder.iterdir())}
    details = json_text(manifest(result, hashes, commit), indent=2)
    write_whole(folder / MANIFEST, details + "\n")


def manifest(result: RunData, hashes: Mapping[str, str], commit: str | None) -> dict[str, Any]:
    """What manifest.json holds; ``hashes`` are those of the folder's other files."""
    plots = [
        {"name": p.name, "kind": p.kind, "of": list(p.of), "title": p.title}
        | {"options": dict(p.options)}
        for p in result.plots
    ]
    return {
        **result.manifest,
        "git": commit,
        "hashes": dict(hashes),
        "probes": {name: _described(recorded) for name, recorded in result.probes.items()},
        "plots": plots,
        "world": None if result.world is None else result.world.description,
        "failures": result.failures,
    }


def _described(recorded: Recording) -> dict[str, Any]:
    return {
        "labels": list(recorded.labels),
        "units": list(recorded.units),
        "kinds": list(recorded.kinds),
        "addresses": {a: list(span) for a, span in recorded.addresses.items()},
        "auto": recorded.auto,
    }


def link_latest(folder: Path) -> None:
    """Point ``latest`` beside a run's folder to it; left out where links are not to be had."""
    point_link(folder.parent / "latest", folder.name)
