"""Other packages, each used as its users would.

The modules of PEERS have the diagram without neurons: ``poses(steps, dt)`` builds, runs, and gives
the seconds of the run alone with the pose at every step. Those of SOLVER_PEERS have the problems of
``benchmarks/problems.py``: ``solve(title, rtol)`` gives a Solved or raises NotImplementedError,
SOLVERS names the solvers and NOTE says what is to be known.
"""

from __future__ import annotations

import importlib
from collections.abc import Iterable
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from types import ModuleType


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


SOLVER_PEERS = (
    Peer("PathSim", "pathsim", "solve_in_pathsim"),
    Peer("diffrax", "diffrax", "solve_in_diffrax"),
)


def installed(peers: Iterable[Peer]) -> tuple[dict[str, ModuleType], dict[str, str]]:
    """Modules of the peers that can run, and for each that cannot the reason."""
    found: dict[str, ModuleType] = {}
    missing: dict[str, str] = {}
    for peer in peers:
        try:
            version(peer.package)
        except PackageNotFoundError:
            missing[peer.title] = "is not installed"
            continue
        try:
            found[peer.title] = importlib.import_module(f"{__name__}.{peer.module}")
        except (ImportError, AttributeError) as error:
            missing[peer.title] = f"cannot be imported: {error}"
    return found, missing
