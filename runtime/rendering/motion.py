"""What a run recorded of a robot with physics: all that a picture of it needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from blocks.mujoco_vacuum import MujocoVacuum
from blocks.params import hint
from blocks.signals import FloatArray
from blocks.world import World
from runtime.errors import UsageError
from runtime.graph import load
from runtime.record import RESOLVED
from runtime.reopen import open_run, run_folder

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
    name : the block; may be left out where there is one of its kind.

    Raises
    ------
    UsageError : there is no such block, or its states were not recorded.
    """
    folder = run_folder(path)
    result = open_run(folder)
    network = load(folder / RESOLVED).network
    robots = {
        key: entry.block
        for key, entry in network.entries.items()
        if isinstance(entry.block, MujocoVacuum)
    }
    chosen = _chosen(robots, name, folder)
    address = f"{chosen}.{STATE}"
    if network.world is None or address not in result or not len(result[address]):
        said = f"'{folder}' has no states of '{chosen}' to draw; record them with probes: "
        raise UsageError(f"{said}{{{STATE}: {{of: {address}, every: 50}}}}, and run it again")
    states = result[address]
    return Motion(result.title, robots[chosen], network.world, result.time(address), states)


def _chosen(robots: dict[str, Any], name: str, folder: Path) -> str:
    if not robots:
        raise UsageError(f"'{folder}' has no MujocoVacuum in its graph: nothing to render")
    if name in robots:
        return name
    listed = ", ".join(robots)
    if name:
        mend = hint(name, robots) or f"; there is {listed}"
        raise UsageError(f"'{folder}' has no MujocoVacuum '{name}'{mend}")
    if len(robots) > 1:
        raise UsageError(f"'{folder}' has several robots; choose one with --block: {listed}")
    return next(iter(robots))
