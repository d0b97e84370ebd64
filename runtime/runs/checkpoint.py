"""Checkpoints: the state of a run in a file, from which it goes on after it was killed.

In: an engine between two ticks. Out: an archive of arrays, with a header in JSON; and back again::

    header                  version, tick, counts, states of generators, a digest of all
    state/plant.pose        arrays by name          held/plant.pose     signals that hold
    own/mine.buffer         of own blocks           filter/errors       of a probe's synapse
    log                     located events

Reading one executes nothing. The recorded rows are beside it, in the run's own files: the header
says how many of them belong to it.
"""

from __future__ import annotations

import hashlib
import io
import json
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from blocks.core import FloatArray
from blocks.files import read
from blocks.limits import GRAPH_ARRAYS
from runtime.engine import (
    Carried,
    Engine,
    Outcome,
    Saved,
    adopt,
    carried,
)
from runtime.errors import NotCopiedError, UsageError
from runtime.files import sha256, write_whole
from runtime.memory import alike
from runtime.observation import RunData
from runtime.plan import Port
from runtime.runs.fingerprint import program_of
from runtime.runs.folder import CHECKPOINT, RESOLVED, read_arrays
from runtime.streaming import save_arrays

Progress = Callable[[int, int], None]
# A checkpoint, and the rows that were recorded before it.
Source = tuple[Path, Mapping[str, FloatArray]]
VERSION = 2
BEFORE = "checkpoint.before.npz"
_PLAIN = (int, float, str, bool, type(None))


@dataclass
class Checkpoints:
    """Writes checkpoints while a run goes on, or lets it begin from one.

    Parameters
    ----------
    folder : where they are written. every : the time between two (s of the clock); 0 for none.
    source : a checkpoint to go on from, with the rows that were recorded before.
    """

    folder: Path
    every: float
    source: Source | None = None
    notes: list[str] = field(default_factory=list)
    engine: Engine = field(init=False)
    failed: bool = field(init=False, default=False)

    def begin(self, engine: Engine, progress: Progress | None) -> Progress:
        """Prepare the engine; returns what is to be called after each of its calls."""
        self.engine = engine
        if engine.network.keep is not None:
            raise UsageError(
                "run.keep: a run with checkpoints has all of its recordings on disk, from which it "
                "goes on; leave out keep ('--set run.keep=null'), or the checkpoints"
            )
        if self.source is not None:
            began = time.perf_counter()
            engine.prepare()
            given, header = read_checkpoint(*self.source)
            expected = {name: array.shape for name, array in engine.state.arrays.items()}
            if {name: array.shape for name, array in given.arrays.items()} != expected:
                raise UsageError(
                    f"'{self.source[0]}' is of another graph, or the blocks' states have other "
                    "shapes now"
                )
            adopt(engine, given)
            # Of all ticks, those before the checkpoint included; each start costs time of its own.
            engine.ready_s = time.perf_counter() - began
            engine.wall_s = engine.ready_s + float(header["ticking_s"])
            engine.diagnosis.seen = header["watched"]
            self.notes.append(f"went on at tick {given.tick} from '{self.source[0]}'")
        last = time.monotonic()

        def after(tick: int, total: int) -> None:
            nonlocal last
            if self.every and time.monotonic() - last >= self.every:
                self._store()
                last = time.monotonic()
            if progress is not None:
                progress(tick, total)

        return after

    def _store(self) -> None:
        try:
            store(self.folder, self.engine)
        except (UsageError, OSError) as error:
            if not self.failed:
                self.notes.append(f"no checkpoint at tick {self.engine.state.tick}: {error}")
            self.failed = True

    def end(self, outcome: Outcome, result: RunData) -> None:
        """Give the last checkpoint to the result: of the end, if the run came to one."""
        if outcome.status in ("complete", "stopped"):
            self._store()
        result.notes += self.notes
        path, origin = self.folder / CHECKPOINT, result.origin
        if path.exists():
            data = read(path, GRAPH_ARRAYS)

            def with_checkpoint() -> tuple[dict[str, str], dict[str, bytes]]:
                texts, files = origin()
                return texts, {**files, CHECKPOINT: data}

            result.origin = with_checkpoint


def store(folder: Path, engine: Engine) -> bytes:
    """Write a checkpoint into a folder, where the last two are kept; returns its content.

    Raises
    ------
    UsageError : a block keeps what no file can hold. OSError : it cannot be written.
    """
    data = content(engine, digest_of(folder))
    if (folder / CHECKPOINT).exists():
        (folder / CHECKPOINT).replace(folder / BEFORE)
    write_whole(folder / CHECKPOINT, data)
    return data


def content(engine: Engine, graph: str = "") -> bytes:
    """A checkpoint of an engine; ``graph`` is the digest of the graph's text."""
    try:
        given = carried(engine)
    except NotCopiedError as error:
        raise UsageError(str(error)) from None
    arrays = {f"state/{name}": array for name, array in given.arrays.items()}
    for (block, port), value in given.held.items():
        arrays[f"held/{block}.{port}"] = np.asarray(value, dtype=np.float64)
    own, unchanged = _own(engine, given, arrays)
    for name, (_, _, _, memory) in given.recording.items():
        if memory is not None:
            arrays[f"filter/{name}"] = memory
    if given.log is not None:
        arrays["log"] = given.log
    header = {
        "checkpoint": VERSION,
        "tick": given.tick,
        "rows": {name: rows for name, (_, rows, _, _) in given.recording.items()},
        "generators": _to_json(given.generators),
        "own": own,
        "unchanged": unchanged,
        "python_from": given.python_from,
        "notes": list(given.notes),
        "ticking_s": engine.elapsed() - engine.ready_s,
        "watched": engine.diagnosis.seen,
        "graph": graph,
        "program": str(program_of(engine.network)),
    }
    text = json.dumps(header, sort_keys=True)
    arrays["header"] = _as_array(text)
    arrays["digest"] = _as_array(_digest(text, arrays))
    archive = io.BytesIO()
    save_arrays(archive, arrays)
    return archive.getvalue()


def _own(
    engine: Engine, given: Carried, arrays: dict[str, FloatArray]
) -> tuple[dict[str, dict[str, Any]], dict[str, list[str]]]:
    """What own blocks keep undeclared: what the run has changed, and the names of the others.

    Arrays go to those of the checkpoint.
    """
    own: dict[str, dict[str, Any]] = {}
    unchanged: dict[str, list[str]] = {}
    for block, values in given.own.items():
        for key, value in values.items():
            first = engine.begun.own.get(block, {})
            if key in first and alike(value, first[key]):  # which `start` computes anew
                unchanged.setdefault(block, []).append(key)
                continue
            if isinstance(value, np.ndarray) and value.dtype == np.float64:
                arrays[f"own/{block}.{key}"] = value
            elif isinstance(value, _PLAIN):
                own.setdefault(block, {})[key] = value
            else:
                kind = type(value).__name__
                raise UsageError(
                    f"block '{block}' keeps state.{key} ({kind}), which no checkpoint can hold; "
                    "declare it as a State, or keep numbers, strings and arrays of floats"
                )
    return own, unchanged


def digest_of(folder: Path) -> str:
    """The digest of the graph in the folder of a run or of its recording; '' if there is none."""
    path = folder / RESOLVED
    return sha256(path) if path.is_file() else ""


def read_checkpoint(path: Path, rows: Mapping[str, FloatArray]) -> tuple[Carried, dict[str, Any]]:
    """The state in a checkpoint, with the rows recorded before it, and its header.

    Raises
    ------
    UsageError : it is damaged, was edited, or is of another version; or rows are missing.
    """
    arrays = read_arrays(path)
    try:
        text = _text(arrays["header"])
        header = json.loads(text)
        if _text(arrays["digest"]) != _digest(text, arrays):
            raise ValueError("its content is not what was written (SHA-256)")
        if header["graph"] not in ("", digest_of(path.parent)):
            raise ValueError(f"{RESOLVED} beside it is not the graph that ran")
        if header["checkpoint"] != VERSION:
            raise ValueError(f"it has version {header['checkpoint']}, this one reads {VERSION}")
        state = _under(arrays, "state/")
        held: dict[Port, Any] = {}
        for key, value in _under(arrays, "held/").items():
            block, _, port = key.rpartition(".")
            held[block, port] = value
        own: dict[str, dict[str, Any]] = header["own"]
        for key, array in _under(arrays, "own/").items():
            block, _, attribute = key.rpartition(".")
            own.setdefault(block, {})[attribute] = array
        recording: Saved = {}
        for name, count in header["rows"].items():
            if len(rows.get(name, ())) < count:
                raise ValueError(f"of probe '{name}', {count} rows should be beside it")
            recording[name] = ((rows[name][:count],), count, 0, arrays.get(f"filter/{name}"))
        given = Carried(
            tick=int(header["tick"]),
            arrays=state,
            held=held,
            generators=_from_json(header["generators"]),
            own=own,
            recording=recording,
            log=arrays.get("log"),
            python_from=header["python_from"],
            notes=tuple(header["notes"]),
            unchanged=header["unchanged"],
        )
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise UsageError(f"'{path}' is no checkpoint that can be used: {error}") from None
    return given, header


def _under(arrays: Mapping[str, FloatArray], prefix: str) -> dict[str, FloatArray]:
    return {k.removeprefix(prefix): v for k, v in arrays.items() if k.startswith(prefix)}


def _as_array(text: str) -> FloatArray:
    return np.frombuffer(text.encode(), dtype=np.uint8).astype(np.float64)


def _text(array: FloatArray) -> str:
    return array.astype(np.uint8).tobytes().decode()


def _digest(text: str, arrays: Mapping[str, FloatArray]) -> str:
    found = hashlib.sha256(text.encode())
    for name in sorted(arrays.keys() - {"header", "digest"}):
        found.update(f"{name} {arrays[name].shape} ".encode())
        found.update(np.ascontiguousarray(arrays[name]).tobytes())
    return found.hexdigest()


def _to_json(value: Any) -> Any:
    """States of generators as JSON has them: an array as its type and numbers."""
    if isinstance(value, Mapping):
        return {key: _to_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return {"dtype": str(value.dtype), "numbers": value.tolist()}
    return value.item() if isinstance(value, np.generic) else value


def _from_json(value: Any) -> Any:
    if isinstance(value, dict) and value.keys() == {"dtype", "numbers"}:
        return np.array(value["numbers"], dtype=value["dtype"])
    return {k: _from_json(v) for k, v in value.items()} if isinstance(value, dict) else value
