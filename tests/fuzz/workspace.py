"""A folder with one of everything that the command line reads, and what its answers must be."""

from __future__ import annotations

import atexit
import contextlib
import io
import json
import os
import shutil
import subprocess
import sys
import tempfile
import unicodedata
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import runtime
from runtime import cli
from runtime.document.node import dump_yaml
from tests.fuzz.known import KNOWN

SCRIPT = Path(sys.executable).parent / "runtime"
# Unicode's classes of what steers a terminal or turns the direction of writing.
CONTROL = {"Cc", "Cf", "Cs", "Zl", "Zp"}
CODES = {0, 1, 2, 3, 4, 130}
# Seconds on the clock for a process that may hang; none needs a tenth of it.
PATIENCE = 300.0
TINY: dict[str, Any] = {
    "graph": "tiny",
    "run": {"dt": 0.01, "until": 0.1, "seed": 3},
    "params": {"k": 2.0},
    "world": {"circles": [[3.0, 0.0, 0.5]]},
    "blocks": {
        "go": {"type": "Constant", "value": [1.0, 0.5], "signal": "Twist"},
        "gain": {"type": "Gain", "gain": "$k"},
        "limit": {"type": "Saturator", "omega_max": 1.0},
        "plant": {"type": "DifferentialDrive"},
        "noise": {"type": "PoseNoise"},
    },
    "wires": {
        "gain": {"input": "go.value"},
        "limit": {"command": "gain.out"},
        "plant": {"command": "limit.limited"},
        "noise": {"pose": "plant.pose"},
    },
    "probes": {"pose": {"of": "plant.pose", "every": 2}, "seen": "noise.measured.x"},
    "plots": {"way": {"kind": "map", "of": ["plant.pose"], "distance": 0.5}},
    "metrics": {
        "end": {"kind": "final", "of": "plant.pose.theta"},
        "far": {"kind": "first_time", "of": "noise.measured.x", "level": 0.05},
    },
}
OWN = '''"""A block of one's own."""

import blocks


class Half(blocks.Block):
    """Half of the input."""

    x = blocks.Input(blocks.Scalar)
    out = blocks.Output(blocks.Scalar)

    def output(self, state, t, x):
        return 0.5 * x
'''
FAILS = {"blocks": {"limit": {"omega_max": 1e-300}, "gain": {"gain": 1e308}}, "run": {"seed": 1}}
EXPERIMENT: dict[str, Any] = {
    "experiment": "tiny",
    "graph": "tiny.yaml",
    "vary": {"params.k": [1.0, 2.0]},
    "seeds": [0, 1],
    "minimize": "end",
    "variants": {"without noise": {"without": ["noise"]}},
}
SCANNING: dict[str, Any] = {
    "graph": "scanning",
    "run": {"dt": 0.01, "until": 0.05},
    "world": {"circles": [[3.0, 0.0, 0.5]]},
    "blocks": {
        "go": {"type": "Constant", "value": [1.0, 0.5], "signal": "Twist"},
        "plant": {"type": "DifferentialDrive"},
        "lidar": {"type": "Lidar", "beams": 8},
    },
    "wires": {"plant": {"command": "go.value"}, "lidar": {"pose": "plant.pose"}},
    "metrics": {"behind": {"kind": "final", "of": "lidar.scan.0"}},
}


@dataclass(frozen=True)
class Answer:
    """How a command ended, and what it wrote."""

    code: int
    out: str
    err: str


@cache
def made() -> Path:
    """The folder, made once: graphs, two runs, a sweep, an ablation."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-fuzz-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    for name, content in (
        *(("tiny.yaml", TINY), ("over.yaml", FAILS), ("exp.yaml", EXPERIMENT)),
        ("scanning.yaml", SCANNING),
    ):
        (folder / name).write_text(dump_yaml(content), encoding="utf-8")
    (folder / "broken.yaml").write_text("graph: broken\nblocks: {a: {type: Sun}\n")
    (folder / "bytes.yaml").write_bytes(b"graph: \xff\xfe\n")
    (folder / "own.py").write_text(OWN)
    graph = runtime.load(folder / "tiny.yaml")
    for seed, name in enumerate(("a", "b")):
        result = graph.run(seed=seed)
        result.save(folder / "runs" / "tiny" / name)
    (folder / "runs" / "tiny" / "latest").symlink_to("b")
    for command in (
        ("sweep", "exp.yaml", "--keep", "all", "-j", "1"),
        ("ablate", "exp.yaml", "-j", "1", "--no-plots"),
    ):
        done = subprocess.run([SCRIPT, *command], cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{command}: {done.stderr}")
    return folder


@contextlib.contextmanager
def fresh() -> Iterator[Path]:
    """A copy of the folder, as the working folder."""
    above = Path(tempfile.mkdtemp(prefix="spikeblocks-fuzz-"))
    folder = above / "work"
    before = Path.cwd()
    shutil.copytree(made(), folder, symlinks=True)
    os.chdir(folder)
    try:
        yield folder
    finally:
        os.chdir(before)
        shutil.rmtree(above, ignore_errors=True)


def call(arguments: Sequence[str]) -> Answer:
    """Run a command in this process; what ends in a traceback there is raised here."""
    out = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", newline="")
    err = io.TextIOWrapper(io.BytesIO(), encoding="utf-8", errors="backslashreplace", newline="")
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = cli.run(list(arguments))
        except SystemExit as ended:
            code = ended.code if isinstance(ended.code, int) else 1
    texts = []
    for stream in (out, err):
        stream.flush()
        texts.append(stream.buffer.getvalue().decode())  # type: ignore[attr-defined]
    return Answer(code, *texts)


def spawn(arguments: Sequence[str], **variables: str) -> Answer:
    """Run the console script."""
    done = subprocess.run(
        [SCRIPT, *arguments],
        capture_output=True,
        timeout=PATIENCE,
        env={**os.environ, **variables},
        stdin=subprocess.DEVNULL,
    )
    texts = (stream.decode("utf-8", "backslashreplace") for stream in (done.stdout, done.stderr))
    return Answer(done.returncode, *texts)


def assert_answered(answer: Answer, arguments: Sequence[str]) -> None:
    """An allowed exit code with a sentence, no traceback, JSON that every reader takes."""
    assert answer.code in CODES, f"exit code {answer.code}: {answer.err[-500:]}"
    assert "Traceback (most recent call last)" not in answer.err, answer.err
    is_help = (
        any(word in ("-h", "--help", "--help-all", "--version") for word in arguments)
        or not arguments
    )
    is_json = "--json" in arguments and bool(answer.out.strip()) and not is_help
    if is_json:
        strict_json(answer.out)
    is_answered = is_help or is_json or bool(answer.err.strip())
    assert is_answered or answer.code in (0, 1), f"exit code {answer.code} without a word"
    if "control characters" not in KNOWN:
        for text in (answer.err, answer.out):
            raw = {c for c in text if unicodedata.category(c) in CONTROL} - {"\n", "\t"}
            assert not raw, f"raw control characters {raw!r}"


def strict_json(text: str) -> Any:
    """The one JSON value of a text, in which NaN and Infinity are errors."""
    return json.loads(text, parse_constant=None if "infinity" in KNOWN else _refuse)


def _refuse(name: str) -> NoReturn:
    raise AssertionError(f"{name} is no JSON")
