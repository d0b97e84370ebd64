"""What a document or a folder names is a device, a fifo, a bomb: refused in little memory."""

from __future__ import annotations

import atexit
import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import strategies as st

import runtime
from runtime.document.node import dump_yaml
from tests.fuzz.campaign import Record, campaign
from tests.fuzz.workspace import OWN, SCRIPT, TINY, Answer, assert_answered, made

TITLE = "Files that are no files, and bombs"
WHAT = (
    "A file that a graph names, or one in the folder of a run, a session, a sweep or an ablation, "
    "is a link to /dev/zero or to itself, a fifo, a socket, a folder, a sparse file of 8 GiB, an "
    "archive or a text that becomes many times as large when it is read; then a verb reads it."
)
HOLDS = (
    "Each verb ends within a minute with an allowed exit code and a sentence, never a traceback; "
    "its process never takes 300 MiB of memory."
)
MOST, PATIENCE = 300.0, 60.0
MIB = 2**20
# Starts a command and says how much memory it took; of itself, little, which counts for children.
MEASURE = """import json, resource, subprocess, sys
seconds, *words = sys.argv[1:]
try:
    options = {"capture_output": True, "stdin": subprocess.DEVNULL, "timeout": float(seconds)}
    done = subprocess.run(words, **options)
    code, streams = done.returncode, (done.stdout, done.stderr)
except subprocess.TimeoutExpired:
    code, streams = -99, (b"", b"not finished")
texts = [each.decode("utf-8", "backslashreplace") for each in streams]
print(json.dumps([code, *texts, resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024]))
"""
ROW = {"run": {"dt": 0.1, "until": 0.5}}


def _graph(block: dict[str, Any], **more: Any) -> dict[str, Any]:
    probes = {"p": f"f.{'value' if block['type'] == 'Constant' else 'out'}"}
    return {"graph": "hostile", **ROW, "blocks": {"f": block}, "probes": probes, **more}


GRAPHS: dict[str, dict[str, Any]] = {
    "weights": _graph({"type": "Constant", "value": "w.npz#w"}),
    "csv": _graph({"type": "FromFile", "file": "rows.csv", "outside": "hold"}),
    "npz": _graph({"type": "FromFile", "file": "rows.npz", "outside": "hold"}),
    "module": {
        **{"graph": "hostile", **ROW},
        "blocks": {"c": {"type": "Sine"}, "f": {"type": "Half", "module": "own.py"}},
        "wires": {"f": {"x": "c.out"}},
    },
    "metric": {
        **_graph({"type": "Sine"}),
        "metrics": {"m": {"kind": "mine", "module": "own.py", "of": "f.out"}},
    },
    "fmu": _graph({"type": "FMU", "file": "model.fmu"}),
    "extends": {"extends": "base.yaml"},
    "part": {"graph": "hostile", **ROW, "blocks": {"f": {"graph": "base.yaml"}}},
    "world": {**_graph({"type": "Sine"}), "world": "base.yaml"},
    "from": {**_graph({"type": "Sine"}), "from": "runs/tiny/a"},
}
RUN, SWEEP, ABLATION, SESSION = "runs/tiny/a", "sweeps/tiny", "ablations/tiny", "sessions/s"
GOES_ON = "runs/tiny/c"


@dataclass(frozen=True)
class Case:
    """A file, what takes its place, and the command that reads it."""

    file: str
    kind: str
    command: tuple[str, ...]


def _verbs(graph: str, *verbs: str) -> list[tuple[str, ...]]:
    out = {"run": ("--no-plots", "--out", "out")}
    return [(verb, f"{graph}.yaml", *out.get(verb, ())) for verb in verbs]


READ: dict[str, list[tuple[str, ...]]] = {
    "w.npz": _verbs("weights", "validate", "run", "explain"),
    "rows.csv": _verbs("csv", "validate", "run"),
    "rows.npz": _verbs("npz", "validate", "run"),
    "own.py": [
        *_verbs("module", "validate", "run"),
        *_verbs("metric", "validate"),
        ("check", "own.py"),
        ("blocks", "--module", "own.py"),
    ],
    "model.fmu": [*_verbs("fmu", "validate"), ("validate", "fmu.yaml", "--no-modules")],
    "base.yaml": [
        *_verbs("extends", "validate", "draw"),
        *_verbs("part", "validate"),
        *_verbs("world", "validate"),
        ("validate", "base.yaml"),
    ],
    f"{RUN}/states.npz": [
        *_verbs("from", "validate"),
        ("run", "tiny.yaml", "--from", RUN, "--no-plots", "--out", "out"),
        ("linearize", "tiny.yaml", "--from", RUN),
    ],
    **{
        f"{RUN}/{name}": [
            ("report", RUN),
            ("compare", RUN, "runs/tiny/b", "--no-plots"),
            ("run", "tiny.yaml", "--from", RUN, "--no-plots", "--out", "out"),
            ("resume", RUN),
        ]
        for name in ("manifest.json", "probes.npz", "metrics.json", "diagram.json", "graph.yaml")
    },
    f"{RUN}/graph.resolved.yaml": [("report", RUN), ("resume", RUN), ("render", RUN)],
    f"{GOES_ON}/checkpoint.npz": [("resume", GOES_ON, "--until", "0.2", "--no-plots")],
    **{
        f"{SESSION}/{name}": [("replay", SESSION)]
        for name in ("session.json", "log.jsonl", "graph.yaml", "run/probes.npz")
    },
    **{
        f"{SWEEP}/{name}": [
            ("report", SWEEP),
            ("sweep", "exp.yaml", "--resume", "-j", "1", "--no-plots"),
        ]
        for name in ("plan.yaml", "index.csv", "summary.json", "graph.yaml", "starts.jsonl")
    },
    **{
        f"{ABLATION}/{name}": [("report", ABLATION)]
        for name in ("plan.yaml", "index.csv", "ablation.json", "diagram.json")
    },
}
KINDS = ("zero", "itself", "fifo", "socket", "folder", "sparse", "bomb", "letters")
CASES = [Case(f, kind, each) for f, verbs in READ.items() for kind, each in product(KINDS, verbs)]


@cache
def prepared() -> Path:
    """The folder of all campaigns, with more graphs, a checkpoint and a session."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-hostile-")) / "work"
    atexit.register(shutil.rmtree, folder.parent, ignore_errors=True)
    shutil.copytree(made(), folder, symlinks=True)
    for name, graph in GRAPHS.items():
        (folder / f"{name}.yaml").write_text(dump_yaml(graph), encoding="utf-8")
    (folder / "base.yaml").write_text(dump_yaml(_graph({"type": "Sine"})), encoding="utf-8")
    (folder / "own.py").write_text(OWN, encoding="utf-8")
    begin = ("run", "tiny.yaml", "--checkpoint", "60s", "--no-plots", "--out", "made", "--quiet")
    subprocess.run([SCRIPT, *begin], cwd=folder, check=True, capture_output=True)
    next((folder / "made" / "tiny").glob("2*")).rename(folder / GOES_ON)
    session = runtime.load(TINY).session()
    session.step(5)
    session.save(folder / SESSION)
    return folder


def inflict(path: Path, kind: str) -> None:
    """Put something else in the place of a file."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    if kind in ("zero", "itself"):
        path.symlink_to("/dev/zero" if kind == "zero" else path.name)
    elif kind == "fifo":
        os.mkfifo(path)
    elif kind == "socket":
        before = Path.cwd()
        os.chdir(path.parent)  # a socket's name is short
        try:
            with socket.socket(socket.AF_UNIX) as end:
                end.bind(path.name)
        finally:
            os.chdir(before)
    elif kind == "folder":
        path.mkdir()
    elif kind == "sparse":
        with path.open("wb") as file:
            file.truncate(8 * 2**30)
    elif kind == "letters":
        path.write_text("\U0001f916" + "a" * (15 * MIB), encoding="utf-8")
    else:
        bomb(path)


def bomb(path: Path) -> None:
    """A file that becomes many times as large when it is read."""
    if path.suffix in (".npz", ".fmu"):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            for name, content in _members(path.suffix):
                with archive.open(name, "w", force_zip64=True) as member:
                    for part in content:
                        member.write(part)
        return
    item, begin, end, size = {
        ".json": (b"[],", b"[", b"0]", 30),
        ".jsonl": (b"[],", b"[", b"0]", 30),
        ".csv": (b"0,0,0,0\n", b"time,a,b,c\n", b"", 60),
        ".yaml": (b"[],", b"a: [", b"0]", 15),
        ".py": (b"#\n", b"", b"", 2),
    }[path.suffix]
    path.write_bytes(begin + item * (size * MIB // len(item)) + end)


def _members(suffix: str) -> Iterator[tuple[str, Iterator[bytes]]]:
    count = 1_000_000_000 // 8
    if suffix == ".fmu":
        text = '<fmiModelDescription fmiVersion="3.0"><ModelVariables><Float64 name="a" '
        text += 'valueReference="1" causality="output"><Dimension start="1000000000"/></Float64>'
        text += "</ModelVariables></fmiModelDescription>"
        yield "modelDescription.xml", iter([text.encode()])
        yield "resources/zeros", iter([bytes(16 * MIB)] * 2)
        return
    for name in ("time", "w"):
        described = {"descr": "<f8", "fortran_order": False, "shape": (count,)}
        header = (repr(described) + "\n").encode()
        start = np.lib.format.magic(1, 0) + len(header).to_bytes(2, "little") + header
        yield f"{name}.npy", iter([start, *([bytes(16 * MIB)] * (8 * count // (16 * MIB) + 1))])


def measured(command: tuple[str, ...], folder: Path) -> tuple[Answer, float]:
    """What a command answers, and the most memory that it took (MiB)."""
    words = [sys.executable, "-I", "-c", MEASURE, str(PATIENCE), str(SCRIPT), *command]
    done = subprocess.run(words, cwd=folder, capture_output=True, check=True)
    code, out, err, memory = json.loads(done.stdout)
    return Answer(code, out, err), memory


def check(case: Case) -> str:
    """Put the file in its place, run the command, and look at its end and its memory."""
    with tempfile.TemporaryDirectory(prefix="spikeblocks-hostile-") as above:
        folder = Path(above, "work")
        shutil.copytree(prepared(), folder, symlinks=True)
        inflict(folder / case.file, case.kind)
        answer, memory = measured(case.command, folder)
    assert answer.code != -99, "not finished after a minute"
    assert_answered(answer, case.command)
    assert memory < MOST, f"{memory:.0f} MiB of memory; exit code {answer.code}: {answer.err}"
    return {0: "read", 1: "read"}.get(answer.code, "refused")


def run(examples: int, seed: int) -> Record:
    """Try files in all places."""
    prepared()
    return campaign("hostile_files", st.sampled_from(CASES), check, examples, seed, shrink=False)
