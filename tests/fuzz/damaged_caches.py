"""A damaged compile cache costs time, and nothing else."""

from __future__ import annotations

import atexit
import json
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

from runtime.document.node import dump_yaml
from tests.fuzz.campaign import Record, campaign
from tests.fuzz.known import KNOWN
from tests.fuzz.mutation import mutate_bytes
from tests.fuzz.workspace import Answer, spawn

TITLE = "Damaged compile caches"
WHAT = (
    "Files of the cache of compiled text are cut off, overwritten, emptied, deleted, exchanged or "
    "replaced by folders; then a graph that was compiled before runs in a new process."
)
HOLDS = "The run ends with exit code 0 and the bits that it has with an empty cache."
GRAPH: dict[str, Any] = {
    "graph": "cached",
    "run": {"dt": 0.01, "until": 0.2},
    "blocks": {
        "go": {"type": "Constant", "value": 1.0},
        "sum": {"type": "Sum"},
        "delay": {"type": "UnitDelay"},
    },
    "wires": {"sum": {"terms": ["go.value", "delay.out"]}, "delay": {"input": "sum.out"}},
    "probes": {"out": "sum.out"},
}
WAYS = ("delete", "bytes", "bytes", "bytes", "exchange", "folder")


@dataclass(frozen=True)
class Damage:
    """What is done to one file of the cache."""

    file: str
    how: str
    content: bytes = b""
    other: str = ""


@cache
def made() -> tuple[Path, bytes]:
    """A folder with the graph and its cache, and the bits of its run with an empty cache."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "cached.yaml").write_text(dump_yaml(GRAPH))
    answer = compiled_run(folder, folder / "cache")
    if answer.code:
        raise RuntimeError(answer.err)
    return folder, bits(answer)


def compiled_run(folder: Path, cache_folder: Path) -> Answer:
    """Run the graph in a new process with a cache."""
    options = ("--engine", "compiled", "--json", "--no-plots", "--out", str(folder / "runs"))
    run = ("run", str(folder / "cached.yaml"), *options)
    return spawn(run, SPIKEBLOCKS_CACHE=str(cache_folder))


def bits(answer: Answer) -> bytes:
    """What a run recorded."""
    found = Path(json.loads(answer.out)["run"])
    with np.load(found / "probes.npz") as arrays:
        recorded = b"".join(arrays[name].tobytes() for name in sorted(arrays.files))
    shutil.rmtree(found)
    return recorded


@st.composite
def damages(draw: st.DrawFn) -> tuple[Damage, ...]:
    """One to three damages of a cache."""
    folder = made()[0] / "cache"
    names = sorted(str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file())
    done = []
    for _ in range(draw(st.integers(1, 3))):
        name = draw(st.sampled_from(names))
        how = draw(st.sampled_from(WAYS[:1] if "caches" in KNOWN else WAYS))
        content = mutate_bytes(draw, (folder / name).read_bytes()) if how == "bytes" else b""
        other = draw(st.sampled_from(names)) if how == "exchange" else ""
        done.append(Damage(name, how, content, other))
    return tuple(done)


def inflict(folder: Path, damage: Damage) -> None:
    """Do what the damage says."""
    path = folder / damage.file
    if not path.is_file():
        return
    if damage.how == "exchange" and (folder / damage.other).is_file():
        mine = path.read_bytes()
        path.write_bytes((folder / damage.other).read_bytes())
        (folder / damage.other).write_bytes(mine)
    elif damage.how == "bytes":
        path.write_bytes(damage.content)
    else:
        path.unlink()
        if damage.how == "folder":
            path.mkdir()


def check(done: tuple[Damage, ...]) -> str:
    """Damage a copy of the cache and run with it."""
    folder, wanted = made()
    damaged = Path(tempfile.mkdtemp(dir=folder)) / "cache"
    try:
        shutil.copytree(folder / "cache", damaged)
        for damage in done:
            inflict(damaged, damage)
        answer = compiled_run(folder, damaged)
    finally:
        shutil.rmtree(damaged.parent, ignore_errors=True)
    assert answer.code == 0, f"exit code {answer.code}: {answer.err[-500:]}"
    assert bits(answer) == wanted, "other bits than with an empty cache"
    return "same bits"


def run(examples: int, seed: int) -> Record:
    """Try damages; each is a process, so nothing is shrunk."""
    made()
    return campaign("damaged_caches", damages(), check, examples, seed, shrink=False)
