"""The recorded states of a robot with physics, read from a run folder."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blocks.core import FloatArray, ParameterError, hint
from blocks.world import World
from runtime.document import parse_yaml
from runtime.errors import Problems, UsageError
from runtime.network import expand
from runtime.observation import RunData
from runtime.runs import RESOLVED, read_run, run_folder
from spikeblocks.mujoco import MujocoVacuum

STATE = "physics"


@dataclass(frozen=True)
class Motion:
    """A robot's states over a run.

    title : of the graph. t : times (s), (n,). states : the block's ``physics``, (n, size).
    """

    title: str
    robot: MujocoVacuum
    world: World
    t: FloatArray
    states: FloatArray


def recorded_motion(path: str | Path, name: str = "") -> Motion:
    """Read a robot's states from a run.

    Parameters
    ----------
    path : a run folder.
    name : the block; optional if the graph has only one robot.

    Raises
    ------
    UsageError : there is no such block, or its states were not recorded.
    """
    folder = run_folder(path)
    result = read_run(folder)
    robots = _robots(result, str(folder / RESOLVED))
    chosen = _chosen(robots, name, folder)
    address = f"{chosen}.{STATE}"
    if result.world is None or address not in result or not len(result[address]):
        message = f"'{folder}' has no recorded states of '{chosen}'; record them with probes: "
        raise UsageError(f"{message}{{{STATE}: {{of: {address}, every: 50}}}}, and run it again")
    states = result[address]
    return Motion(result.title, robots[chosen], result.world, result.time(address), states)


def _robots(result: RunData, file: str) -> dict[str, MujocoVacuum]:
    """The graph's robots, from its text: reading a run does not import its modules."""
    problems = Problems()
    scope, _ = expand(parse_yaml(result.texts[RESOLVED], file), problems)
    problems.raise_any()
    known, removed = MujocoVacuum.spec.params, result.manifest["removed"]
    robots = {}
    for inner in scope.walk():
        for name, node in inner.blocks.items():
            kind = node.get("type")
            is_robot = kind is not None and kind.value == MujocoVacuum.__name__
            if not is_robot or node.get("module") or inner.prefix + name in removed:
                continue
            values = {key: item.plain() for key, item in node.items() if key in known}
            try:
                robots[inner.prefix + name] = MujocoVacuum(**values)
            except ParameterError as error:
                raise UsageError(f"'{file}': block '{inner.prefix}{name}': {error}") from None
    return robots


def _chosen(robots: dict[str, Any], name: str, folder: Path) -> str:
    if not robots:
        raise UsageError(f"'{folder}' has no MujocoVacuum in its graph: nothing to render")
    if name in robots:
        return name
    listed = ", ".join(robots)
    if name:
        suggestion = hint(name, robots) or f"; there is {listed}"
        raise UsageError(f"'{folder}' has no MujocoVacuum '{name}'{suggestion}")
    if len(robots) > 1:
        raise UsageError(f"'{folder}' has several robots; choose one with --block: {listed}")
    return next(iter(robots))
