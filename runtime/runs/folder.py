"""The format of a run folder: how a run is written to its files and read back from them.

In: a run and an empty folder, or a folder that anyone may have sent. Out: files, or a run whose
every field was checked; whatever can be wrong with the files is reported in one line::

    manifest.json        what ran, with the SHA-256 of the other files; written last
    graph.yaml           as written        graph.resolved.yaml   as run
    probes.npz           per probe "name" (rows, ...) and "name.time" (rows,)
    metrics.json, states.npz, diagram.json, files that blocks name
"""

from __future__ import annotations

import io
import json
import math
import warnings
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray, show
from blocks.files import read, read_text
from blocks.limits import GRAPH_ARRAYS
from blocks.world import World
from runtime.document import SECOND, TIME_UNITS, arrays_beside, rename_files
from runtime.errors import UsageError
from runtime.files import (
    MAYBE_NUMBER,
    NUMBER,
    check_form,
    is_number,
    json_text,
    parse_json,
    sha256,
    system_errors,
    write_json,
    write_whole,
)
from runtime.network import STATES
from runtime.observation import PlotSpec, Probe, Recording, RunData
from runtime.runs.commit import git_commit
from runtime.streaming import DAMAGED, open_arrays, save_arrays

SCHEMA_VERSION = 1
TIME = "time"
MANIFEST, METRICS, PROBES = "manifest.json", "metrics.json", "probes.npz"
WRITTEN, RESOLVED = "graph.yaml", "graph.resolved.yaml"
DIAGRAM = "diagram.json"
CHECKPOINT = "checkpoint.npz"
# Names of a run folder that a file which a block names must not take.
WRITES = (MANIFEST, METRICS, PROBES, STATES, WRITTEN, RESOLVED, DIAGRAM, CHECKPOINT, "plots")
# What everything that reads a manifest relies on.
_NUMBERS = dict.fromkeys(("seed", "dt", "until", "ticks", "wall_s"), NUMBER)
_FACTS = {
    **{"graph": str, "status": str, **_NUMBERS, "us_per_tick": MAYBE_NUMBER},
    **{"overrides": list, "removed": dict, "versions": dict, "argv": list},
}


def portable(
    plain: dict[str, Any], read: Container[str]
) -> tuple[dict[str, Any], dict[str, Path | bytes]]:
    """A document whose entries name files beside it, and where those files are now.

    ``read`` has the resolved paths of the files that were read. Archives of the arrays that it
    names are here as they will be written.
    """
    files: dict[str, Path] = {}

    def local(key: str, path: str) -> str:
        source = Path(path)
        if key != "module" and str(source.resolve()) not in read:
            return path
        name = source.name
        # Two files of one name, from different folders, and names of our own files:
        #     a/table.csv, b/table.csv     become     table.csv, _table.csv
        while files.get(name, source) != source or name in WRITES:
            name = f"_{name}"
        files[name] = source
        return name

    renamed, archives = arrays_beside(rename_files(plain, local))
    return renamed, {**files, **{name: _archive(arrays) for name, arrays in archives.items()}}


def _archive(arrays: Mapping[str, FloatArray]) -> bytes:
    content = io.BytesIO()
    save_arrays(content, arrays)
    return content.getvalue()


def contents(files: Mapping[str, Path | bytes], texts: Mapping[str, bytes]) -> dict[str, bytes]:
    """The content of files that blocks name: as it was read for the run, or else as it is now.

    A file that was not read for the run, as that of a block given as a class, is read here.

    Raises
    ------
    UsageError : a file cannot be read.
    """
    data = {}
    for name, path in files.items():
        if isinstance(path, bytes):
            data[name] = path
            continue
        with system_errors(f"read '{path}'"):
            content = texts.get(str(path.resolve()))
            data[name] = read(path, GRAPH_ARRAYS) if content is None else content
    return data


def begin(result: RunData, probes: Mapping[str, Probe], folder: Path) -> None:
    """Write the graph's files and the manifest that a recording needs to be recovered.

    Raises
    ------
    UsageError : it cannot be written.
    """
    with system_errors(f"record to '{folder}'"):
        _write_texts(result, folder)
    ticks = {name: [probe.every, probe.first] for name, probe in probes.items()}
    details = {**manifest(result, {}, git_commit()), "ticks_of_rows": ticks}
    write_json(folder / MANIFEST, {**details, "metrics": list(result.metrics)})


def _write_texts(result: RunData, folder: Path) -> None:
    for name, content in result.files.items():
        write_whole(folder / name, content)
    for name, text in result.texts.items():
        write_whole(folder / name, text)


def write(result: RunData, folder: Path, commit: str | None) -> None:
    """Write all files of a run; the manifest, with the hashes of the others, last.

    Raises
    ------
    OSError : a file cannot be written.
    """
    arrays = {}
    for name, recording in result.probes.items():
        arrays[name] = recording.values
        arrays[f"{name}.{TIME}"] = recording.t
    save_arrays(folder / PROBES, arrays)
    if result.states:
        save_arrays(folder / STATES, result.states)
    _write_texts(result, folder)
    write_whole(folder / METRICS, json_text(result.metrics, indent=2) + "\n")
    # The manifest is written last: a folder that has one is complete.
    hashes = {path.name: sha256(path) for path in sorted(folder.iterdir())}
    details = json_text(manifest(result, hashes, commit), indent=2)
    write_whole(folder / MANIFEST, details + "\n")


def manifest(result: RunData, hashes: Mapping[str, str], commit: str | None) -> dict[str, Any]:
    """The content of manifest.json; ``hashes`` are those of the folder's other files."""
    return {
        **result.manifest,
        "git": commit,
        "hashes": dict(hashes),
        "probes": {name: _recording_entry(recording) for name, recording in result.probes.items()},
        "plots": [plot.as_dict() for plot in result.plots],
        "world": None if result.world is None else result.world.description,
        "failures": result.failures,
        "units": result.units,
        "never": result.never,
    }


def _recording_entry(recording: Recording) -> dict[str, Any]:
    return {
        "labels": list(recording.labels),
        "units": list(recording.units),
        "kinds": list(recording.kinds),
        "addresses": {a: list(span) for a, span in recording.addresses.items()},
        "auto": recording.auto,
        **({"names": list(recording.names)} if any(recording.names) else {}),
        **({"held": list(recording.held)} if any(recording.held) else {}),
    }


def run_folder(path: str | Path) -> Path:
    """The folder of a run.

    Parameters
    ----------
    path : the folder, a link to it, or its manifest.json.

    Raises
    ------
    UsageError : there is no run.
    """
    path = Path(path)
    folder = path.parent if path.name == MANIFEST else path
    try:
        if (folder / MANIFEST).is_file():
            return folder
        path.stat()
        is_folder = folder.is_dir()
        inside = sorted(child.parent for child in folder.glob(f"*/{MANIFEST}")) if is_folder else []
    except FileNotFoundError:
        text = f"there is no '{path}'; expected a run folder, as in runs/<graph>/latest"
        raise UsageError(text) from None
    except (OSError, ValueError) as error:
        text = show(str(path))
        raise UsageError(f"{text}: {getattr(error, 'strerror', None) or error}") from None
    if not is_folder:
        raise UsageError(f"'{path}' is a file; expected a run folder, as in runs/<graph>/latest")
    # The folder of a graph holds many runs, and "runs/<graph>" is what one types first.
    latest = folder / "latest"
    newest = latest if latest in inside else inside[-1] if inside else None
    suggestion = f"; did you mean '{newest}'?" if newest else ", as in runs/<graph>/latest"
    raise UsageError(
        f"'{folder}' holds no run (no {MANIFEST} in it); expected a run folder{suggestion}"
    )


def read_run(path: str | Path) -> RunData:
    """The data of a run; ``path`` and the errors are those of :func:`runtime.runs.open_run`."""
    folder = run_folder(path)
    manifest = read_manifest(folder)
    metrics = _mapping(folder / METRICS)
    if any(v is not None and not is_number(v) for v in metrics.values()):
        raise _damage_error(folder / METRICS, "expected a number or null for each metric")
    if not all(name.isprintable() for name in metrics):
        raise _damage_error(folder / METRICS, "expected printable names")
    return run_from_manifest(folder, manifest, read_arrays(folder / PROBES), metrics)


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a run.

    Raises
    ------
    UsageError : it cannot be read, or is of a newer version.
    """
    manifest = _mapping(folder / MANIFEST)
    version = manifest.get("schema_version")
    if isinstance(version, int) and version > SCHEMA_VERSION:
        message = f"written by a newer version (schema {version}, this one reads {SCHEMA_VERSION})"
        raise UsageError(f"'{folder / MANIFEST}' was {message}; upgrade spikeblocks")
    return manifest


def _plots(entries: list[dict[str, Any]], folder: Path) -> tuple[list[PlotSpec], list[str]]:
    """The plots that a run folder describes, and a note for each whose kind is of a Python file."""
    plots, notes = [], []
    for each in entries:
        name, kind = str(each["name"]), str(each["kind"])
        if each.get("own"):
            notes.append(
                f"plot '{name}' is not drawn again: its kind '{kind}' is one of a Python file, "
                f"which viewing a run never imports; see {folder / 'plots'}"
            )
        else:
            options = dict(each.get("options", {}))
            plots.append(PlotSpec(name, kind, tuple(each["of"]), each["title"], options))
    return plots, notes


def run_from_manifest(
    folder: Path,
    manifest: dict[str, Any],
    arrays: dict[str, FloatArray],
    metrics: dict[str, float | None],
) -> RunData:
    """The run that a manifest describes, with its arrays and the graph's files in its folder.

    Raises
    ------
    UsageError : manifest and arrays do not match, or a file cannot be read.
    """
    texts = {name: _text(folder / name) for name in (WRITTEN, RESOLVED)}
    if (folder / DIAGRAM).is_file():
        texts[DIAGRAM] = _text(folder / DIAGRAM)
    try:
        unit = _time_unit(manifest)
        probes = {
            name: _recording(name, info, arrays, unit)
            for name, info in manifest.pop("probes").items()
        }
        plots, left_out = _plots(manifest.pop("plots"), folder)
        # Runs written before there were worlds have none.
        walls = manifest.pop("world", None)
        world = None if walls is None else World(walls)
        # Runs written before these were stored have none.
        units, never = (
            {str(name): str(text) for name, text in manifest.pop(key, {}).items()}
            for key in ("units", "never")
        )
        failures = [str(text) for text in manifest.pop("failures")]
        notes = [str(text) for text in manifest["notes"]] + _changed_files(folder, manifest)
        notes += left_out
        _check_facts(manifest)
    except KeyError as error:
        raise _damage_error(folder / MANIFEST, f"{error} is missing") from None
    except (ValueError, TypeError, AttributeError, IndexError) as error:
        raise _damage_error(folder / MANIFEST, str(error)) from None
    return RunData(
        title=str(manifest["graph"]),
        probes=probes,
        metrics=metrics,
        plots=plots,
        manifest=manifest,
        origin=lambda: (texts, {}),
        notes=notes,
        failures=failures,
        world=world,
        units=units,
        states=read_arrays(folder / STATES) if (folder / STATES).is_file() else {},
        never=never,
    )


def _time_unit(manifest: dict[str, Any]) -> str:
    # Runs written before there were units of time have none.
    unit = str(manifest.get("time_unit", SECOND))
    if unit not in TIME_UNITS:
        raise ValueError(f"time_unit: expected one of {', '.join(TIME_UNITS)}, got {show(unit)}")
    return unit


def _recording(
    name: str, info: dict[str, Any], arrays: dict[str, FloatArray], time_unit: str
) -> Recording:
    """One probe's recording, checked against its description in the manifest."""
    for array_name in (name, f"{name}.{TIME}"):
        if array_name not in arrays:
            raise ValueError(f"probe '{name}': there is no array '{array_name}' in {PROBES}")
    if not name.isprintable():
        raise ValueError("probes: expected printable names")
    values, t = arrays[name], arrays[f"{name}.{TIME}"]
    if t.ndim != 1 or not values.ndim or len(values) != len(t):
        raise ValueError(f"probe '{name}': {len(t)} times for values of shape {values.shape}")
    labels, units, kinds = (tuple(map(str, info[key])) for key in ("labels", "units", "kinds"))
    addresses = {str(a): (int(span[0]), int(span[1])) for a, span in info["addresses"].items()}
    if values.ndim <= 2 and len(labels) != (values.shape[1] if values.ndim == 2 else 1):
        raise ValueError(f"probe '{name}': {len(labels)} labels for values of {values.shape}")
    # Slices beyond the end are empty in Python, and a plot of them would be, too, without a word.
    if any(not 0 <= start <= stop <= len(labels) for start, stop in addresses.values()):
        raise ValueError(f"probe '{name}': its addresses name columns that it does not have")
    names = tuple(map(str, info.get("names", ())))
    if names and len(names) != len(labels):
        raise ValueError(f"probe '{name}': {len(names)} names for {len(labels)} columns")
    held = tuple(map(bool, info.get("held", ())))
    if held and len(held) != len(labels):
        raise ValueError(
            f"probe '{name}': 'held' has {len(held)} entries for {len(labels)} columns"
        )
    auto = bool(info["auto"])
    return Recording(name, t, values, labels, units, kinds, addresses, auto, names, held, time_unit)


# Reports and comparisons compute with these: a NaN or a string here would fail far from the file.
def _check_facts(manifest: dict[str, Any]) -> None:
    """What everything that reads a run relies on."""
    check_form(manifest, _FACTS)
    for key in ("graph", "status"):
        if not manifest[key].isprintable():
            raise ValueError(f"{key}: expected one printable line")
    for key in _NUMBERS:
        if not math.isfinite(manifest[key]):
            raise ValueError(f"{key}: expected a number, got {manifest[key]!r}")
    if manifest["dt"] <= 0.0 or manifest["ticks"] < 0:
        raise ValueError("expected a step above 0, and ticks from 0")


def _text(path: Path) -> str:
    try:
        return read_text(path)
    except OSError as error:
        raise UsageError(f"cannot read '{path}': {error.strerror}{_remedy(path)}") from None
    except UnicodeDecodeError:
        raise _damage_error(path, "it is not text in UTF-8") from None
    except ValueError as error:
        raise _damage_error(path, str(error)) from None


def _mapping(path: Path) -> dict[str, Any]:
    try:
        data = parse_json(_text(path))
        # Half a character (a lone surrogate) can be read but not written.
        json.dumps(data, ensure_ascii=False).encode()
    except (ValueError, RecursionError) as error:
        raise _damage_error(path, f"it is not valid JSON ({error})") from None
    if not isinstance(data, dict):
        raise _damage_error(path, f"expected an object, got {type(data).__name__}")
    return data


def read_arrays(path: Path) -> dict[str, FloatArray]:
    try:
        with warnings.catch_warnings():
            # NumPy only warns about some headers that it cannot be sure of.
            warnings.simplefilter("error")
            arrays = open_arrays(path)
    except FileNotFoundError:
        raise UsageError(f"'{path}' is missing{_remedy(path)}") from None
    except DAMAGED as error:
        raise _damage_error(path, getattr(error, "strerror", None) or f"{error}") from None
    for name, array in arrays.items():
        if array.dtype != np.float64:
            raise _damage_error(path, f"array '{name}' is {array.dtype}, expected float64")
    return arrays


def _changed_files(folder: Path, manifest: dict[str, Any]) -> list[str]:
    """A note for each file that differs from its hash in the manifest.

    Raises
    ------
    UsageError : the numbers themselves differ.
    """
    notes = []
    hashes = manifest.get("hashes", {})
    if not isinstance(hashes, dict):
        raise ValueError(f"hashes: expected an object, got {type(hashes).__name__}")
    for name, digest in hashes.items():
        path = folder / name
        if Path(name).name != name or not name.isprintable():
            raise ValueError("hashes: expected names of files in the folder")
        with system_errors(f"read '{path}'"):
            if path.is_file() and not path.is_symlink() and sha256(path) == digest:
                continue
        # An edited graph.yaml is worth a note; edited numbers would be results that no run gave.
        if name in (METRICS, PROBES):
            raise _damage_error(path, f"it is not the file that was saved (SHA-256 in {MANIFEST})")
        message = "was changed after" if path.is_file() else "was removed after"
        notes.append(f"'{name}' {message} the run was saved (SHA-256 in {MANIFEST})")
    return notes


def _damage_error(path: Path, message: str) -> UsageError:
    return UsageError(f"'{path}' is damaged: {' '.join(message.split())}{_remedy(path)}")


def _remedy(path: Path) -> str:
    """What to do about a file of a run folder that cannot be used."""
    resolved = path.parent / RESOLVED
    if resolved == path or not resolved.is_file():
        return "; restore it from a copy"
    return f"; restore it from a copy, or run the graph again: runtime run {resolved}"
