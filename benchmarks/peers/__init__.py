"""The diagram without neurons in other packages, each wired as its users would.

Every module has ``poses(steps, dt)``: builds, runs, and gives the seconds of the run alone with
the pose at every step.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version

from benchmarks.agreement import Run


@dataclass(frozen=True)
class Peer:
    """A package to compare with.

    Parameters
    ----------
    title : its name in tables.
    package : its name on PyPI.
    module : in this folder.
    note : what is to be known about the comparison.
    """

    title: str
    package: str
    module: str
    note: str = ""


PEERS = (
    Peer("bdsim", "bdsim", "in_bdsim", "a clocked diagram"),
    Peer("pathsim", "pathsim", "in_pathsim", "solver EUF"),
    Peer("pydrake", "drake", "in_drake", "LeafSystems in Python; sum and constant are Drake's own"),
    Peer("python-control", "control", "in_control", "discrete systems, interconnected"),
    Peer("simupy", "simupy", "in_simupy", "with an Euler integrator, and np.Inf put back"),
)


def installed() -> tuple[dict[str, Callable[[int, float], Run]], dict[str, str]]:
    """Peers that can run, and for each that cannot the reason."""
    found: dict[str, Callable[[int, float], Run]] = {}
    missing: dict[str, str] = {}
    for peer in PEERS:
        try:
            version(peer.package)
        except PackageNotFoundError:
            missing[peer.title] = "is not installed"
            continue
        try:
            found[peer.title] = importlib.import_module(f"{__name__}.{peer.module}").poses
        except (ImportError, AttributeError) as error:
            missing[peer.title] = f"cannot be imported: {error}"
    return found, missing
