"""Mutated graphs run, or are errors with a location: no other exception, no unbounded work.

Mutations of the tree are tried on resolved graphs, as a mapping and as a file, whose errors must be
the same. Mutations of the text are tried on every shipped file as it is written, for what it is:
a graph, a part, a world, a condition that overlays a graph, or an experiment.
"""

from __future__ import annotations

import atexit
import difflib
import re
import shutil
import tempfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from hypothesis import strategies as st

import runtime
from runtime.document.node import dump_yaml
from runtime.errors import GraphError, SimulationError, SpikeblocksError
from runtime.experiments.design.experiment import read_experiment
from tests.fuzz.campaign import Record, campaign
from tests.fuzz.mutation import entries, mutate_bytes, mutate_text, mutate_tree

TITLE = "Graphs"
WHAT = (
    "Shipped graphs, parts, worlds, conditions and experiments with up to three random changes of "
    "their text, bytes or tree are loaded, checked and, where they are accepted, run for 3 ticks."
)
HOLDS = (
    "Each is accepted or refused with problems that have a place or an address; a mapping and its "
    "text have the same problems; an accepted graph reads back equal from its own text, and runs "
    "or fails in a named block."
)
SHIPPED = Path(runtime.__file__).parent.parent / "graphs"
BREAKS = re.compile("\r\n|[\n\r\x85\u2028\u2029]")
TICKS = 3
SOUND: dict[str, Any] = {
    "graph": "sound",
    "run": {"dt": 0.001, "until": 0.004, "seed": 1},
    "params": {"v": 1.0, "neurons": 4},
    "world": {"circles": [[50.0, 5.0, 0.5]], "room": [[-9, -9], [90, -9], [90, 90], [-9, 90]]},
    "blocks": {
        "track": {"type": "LinePath", "samples": 11},
        "match": {"type": "MatchingPoint", "v_r": "$v", "dt": 0.002},
        "error": {"type": "TrackingError"},
        "part": {
            "params": {"n": "$neurons", "k": 2.0},
            "inputs": {"x": "Scalar", "e": {"type": "Scalar", "optional": True}},
            "outputs": {"y": "gain.out"},
            "blocks": {
                "snn": {"type": "AdaptiveEnsemble", "neurons": "$n"},
                "gain": {"type": "Gain", "gain": "$k"},
            },
            "wires": {
                "snn": {"input": "inputs.x", "error": "inputs.x"},
                "gain": {"input": "snn.output"},
            },
        },
        "mux": {"type": "Mux"},
        "total": {"type": "Sum", "signs": [1, -1]},
        "limit": {"type": "Saturator", "omega_max": 1.0},
        "plant": {"type": "DifferentialDrive", "x0": [0.0, 0.5, 0.0]},
    },
    "wires": {
        "match": {"pose": "plant.pose", "path": "track.path"},
        "error": {"pose": "plant.pose", "reference": "match.reference"},
        "part": {"x": "error.position"},
        "mux": {"omega": "part.y"},
        "total": {"terms": ["match.feedforward", "mux.out"]},
        "limit": {"command": "total.out"},
        "plant": {"command": "limit.limited"},
    },
    "without": ["part.gain"],
    "bypass": ["limit"],
    "probes": {
        "pose": {"of": "plant.pose", "every": 2},
        "both": ["error.position", "plant.pose.theta"],
        "spikes": "part.snn.spikes",
    },
    "plots": {
        "way": {"kind": "trajectory", "of": ["pose", "track.path"], "title": "The way"},
        "raster": {"kind": "raster", "of": "spikes"},
        "map": {"kind": "map", "of": ["pose", "match.reference"], "distance": 1.0},
    },
    "metrics": {
        "settled": {"kind": "settling_time", "of": "both", "band": [0.1, 0.2]},
        "fast": {"kind": "first_time", "of": "plant.pose.x", "level": 0.001},
        "near": {"kind": "distance_mae", "of": "pose", "distance": 2.0},
        "last": {"kind": "final", "of": "plant.pose.x", "above": -10.0, "after": 0.001},
    },
}


@dataclass(frozen=True)
class Mutant:
    """A mutated tree (``file`` is ""), or a shipped file with another content."""

    file: str
    content: Any

    def __repr__(self) -> str:
        """What differs from the shipped file; the whole of a tree."""
        if not self.file:
            return dump_yaml(self.content)
        before = (SHIPPED / self.file).read_text(encoding="utf-8")
        after = self.content.decode("utf-8", "backslashreplace")
        lines = (before.splitlines(), after.splitlines(), self.file, self.file)
        return "\n".join(difflib.unified_diff(*lines, n=0, lineterm=""))


@cache
def folder() -> Path:
    """A copy of the shipped graphs, to be mutated file by file."""
    made = Path(tempfile.mkdtemp(prefix="spikeblocks-fuzz-"))
    atexit.register(shutil.rmtree, made, ignore_errors=True)
    for path in files():
        (made / path).parent.mkdir(parents=True, exist_ok=True)
        (made / path).write_bytes((SHIPPED / path).read_bytes())
    return made


@cache
def files() -> tuple[str, ...]:
    """The shipped YAML files, by their names below graphs/."""
    return tuple(sorted(str(path.relative_to(SHIPPED)) for path in SHIPPED.rglob("*.yaml")))


@cache
def trees() -> list[dict[str, Any]]:
    """Whole graphs as mappings that need no other file: ours with everything in it, and theirs."""
    roots = [name for name in files() if "/" not in name]
    return [SOUND, *(runtime.load(SHIPPED / name).to_dict() for name in roots)]


@cache
def words(index: int) -> tuple[list[str], list[str]]:
    """Keys of a tree, and texts that mean something in it."""
    paths = list(entries(trees()[index]))
    names = sorted({str(key) for path in paths for key in path})
    return names, sorted({str(path[-1]) for path in paths} | {"plant.pose", "$v_r", "inputs.x"})


@st.composite
def mutants(draw: st.DrawFn) -> Mutant:
    """Mutants of trees, texts and now and then bytes."""
    kind = draw(st.sampled_from(["tree", "tree", "text", "text", "bytes"]))
    if kind == "tree":
        index = draw(st.sampled_from([0, *range(len(trees()))]))
        return Mutant("", mutate_tree(draw, trees()[index], *words(index)))
    name = draw(st.sampled_from(files()))
    data = (SHIPPED / name).read_bytes()
    if kind == "bytes":
        return Mutant(name, mutate_bytes(draw, data))
    text = mutate_text(draw, data.decode())
    return Mutant(name, text.encode("utf-8", "surrogatepass"))


def check(mutant: Mutant) -> str:
    """Load, check and run a mutant; returns "accepted" or "refused"."""
    return _check_tree(mutant.content) if not mutant.file else _check_file(mutant)


def _check_tree(tree: dict[str, Any]) -> str:
    error = run_or_refuse(lambda: runtime.load(tree))
    for problem in error.problems if isinstance(error, GraphError) else ():
        assert problem.address or problem.text.startswith("algebraic loop"), problem
        assert "\n" not in str(problem)
    path = folder() / "mutant.yaml"
    text = dump_yaml(tree)
    path.write_text(text, encoding="utf-8", newline="")
    again = run_or_refuse(lambda: runtime.load(path))
    assert _texts(error) == _texts(again)
    lines = text.split("\n")
    for problem in again.problems if isinstance(again, GraphError) else ():
        assert problem.where.file == str(path)
        if not problem.text.startswith("algebraic loop"):
            line, column = problem.where.line, problem.where.column
            assert 1 <= line <= len(lines), problem
            assert 1 <= column <= len(lines[line - 1]) + 1, problem
    return "refused" if error else "accepted"


def _check_file(mutant: Mutant) -> str:
    path = folder() / mutant.file
    path.write_bytes(mutant.content)
    try:
        error = run_or_refuse(lambda: _used(path, mutant.file))
    finally:
        path.write_bytes((SHIPPED / mutant.file).read_bytes())
    lines = BREAKS.split(mutant.content.decode("utf-8-sig", "replace"))
    for problem in error.problems if isinstance(error, GraphError) else ():
        placed = problem.where.file or problem.address
        assert placed or problem.text.startswith("algebraic loop"), problem
        assert "\n" not in str(problem)
        if problem.where.line and problem.where.file == str(path):
            assert 1 <= problem.where.line <= len(lines), problem
            assert 1 <= problem.where.column <= len(lines[problem.where.line - 1]) + 1, problem
    return "refused" if error else "accepted"


def _used(path: Path, name: str) -> runtime.Graph:
    """The graph that a shipped file is for."""
    room, _, _ = name.rpartition("/")
    root = folder() / "line_actuator_failure.yaml"
    if room == "experiments":
        return read_experiment(str(path)).graph
    if room == "worlds":
        return runtime.load(folder() / "wall_following.yaml").set("world", str(path))
    if room == "conditions":
        return runtime.load(root).overlay(path)
    if room == "wheel_faults":
        return runtime.load(folder() / "wall_following_mujoco.yaml").overlay(path)
    homes = {"parts": root, "plants": folder() / "wall_following_mujoco.yaml"}
    return runtime.load(homes.get(room, path))


def run_or_refuse(load: Any) -> SpikeblocksError | None:
    """What a graph is refused with; None where it runs, or fails in one of its blocks."""
    try:
        graph = load().check()
        network = graph.network
        short = graph if network.ticks <= TICKS else graph.set("run.until", TICKS * network.dt)
        short.check()
    except SpikeblocksError as error:
        assert str(error).strip()
        assert not isinstance(error, GraphError) or error.problems
        return error
    try:
        short.run(engine="python")
    except SimulationError as error:
        assert error.block in network.entries
    again = folder() / "again.yaml"
    again.write_text(graph.to_yaml(), encoding="utf-8", newline="")
    assert _same(runtime.load(again).check().to_dict(), graph.to_dict())
    return None


def _same(a: Any, b: Any) -> bool:
    """Equal, where NaN equals NaN."""
    return repr(a) == repr(b)


def _texts(error: SpikeblocksError | None) -> set[str]:
    return {problem.text for problem in error.problems} if isinstance(error, GraphError) else set()


def run(examples: int, seed: int) -> Record:
    """Try mutants."""
    return campaign("graphs", mutants(), check, examples, seed)
