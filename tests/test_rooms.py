"""The structure holds: imports run downwards and through the doors; nothing grows too long."""

from __future__ import annotations

import ast
import importlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import networkx as nx
import pytest

ROOT = Path(__file__).parent.parent
PACKAGES = ("blocks", "runtime")

# Bottom floor first. A room may import from its own files and from floors below; rooms on one floor
# do not know each other. What loads matplotlib in a room that works without it is a room by itself.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("blocks.core",),
    ("blocks.dynamics", "blocks.generic", "blocks.learning", "blocks.neural", "blocks.nonlinear"),
    ("blocks.plants", "blocks.sources", "blocks.world"),
    ("blocks.testing", "blocks.control", "blocks.vehicle"),
    ("blocks.wall_fitting", "blocks.mujoco"),
    ("blocks.registry",),
    ("blocks",),
    ("runtime.lazy",),
    ("runtime.errors", "runtime.streaming", "runtime.codegen"),
    ("runtime.files",),
    ("runtime.terminal", "runtime.dataframes", "runtime.toolchain"),
    ("runtime.document",),
    ("runtime.network",),
    ("runtime.observation", "runtime.descriptions"),
    ("runtime.compiler",),
    ("runtime.engine",),
    ("runtime.engine.compiled",),
    ("runtime.plots", "runtime.diagrams.layout"),
    ("runtime.diagrams",),
    ("runtime.runs",),
    ("runtime.graph",),
    ("runtime.compare", "runtime.rendering", "runtime.export"),
    ("runtime.compare.overlay",),
    ("runtime.experiments.design", "runtime.experiments.processes"),
    ("runtime.experiments.execution",),
    ("runtime.experiments.analysis",),
    ("runtime.experiments.analysis.sweep_plots", "runtime.experiments.analysis.ablation_plots"),
    ("runtime.experiments.tuning",),
    ("runtime.experiments.tuning.tuning_plots",),
    ("runtime.experiments",),
    ("runtime.reports", "runtime.language"),
    ("runtime.lsp",),
    ("runtime.cli",),
    ("runtime",),
)
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}
MAX_FILE, MAX_FUNCTION = 450, 45


@cache
def modules() -> dict[str, Path]:
    """All modules of the two packages, packages by their own name."""
    found = {}
    for package in PACKAGES:
        for path in sorted((ROOT / package).rglob("*.py")):
            parts = path.relative_to(ROOT).with_suffix("").parts
            found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


def room_of(module: str) -> str:
    """The innermost room that a module is in."""
    name = module
    while name not in FLOOR:
        name = name.rpartition(".")[0]
    return name


def imported(module: str) -> Iterator[tuple[str, int]]:
    """What a module imports of ours, type-checking and lazy imports included, with the line."""
    for node in ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8"))):
        names: list[str] = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            inner = [f"{node.module}.{alias.name}" for alias in node.names]
            names = [name if name in modules() else str(node.module) for name in inner]
        yield from ((name, node.lineno) for name in names if name in modules() and name != module)


def shown(room: str) -> list[str]:
    """The modules that a room's door shows as they are, as ``style`` of the plots."""
    door = importlib.import_module(room)
    return [f"{room}.{name}" for name in getattr(door, "__all__", ())]


@pytest.mark.parametrize("module", modules())
def test_imports_run_downwards_and_through_the_door(module: str) -> None:
    room, wrong = room_of(module), []
    for target, line in imported(module):
        other = room_of(target)
        if other == room:
            continue
        place = f"{modules()[module].relative_to(ROOT)}:{line}"
        if FLOOR[other] >= FLOOR[room] and module != room.partition(".")[0]:
            wrong.append(f"{place}: {room} imports {target}, which is not below it")
        inside = f"{module}.".startswith(f"{other}.") or f"{target}.".startswith(f"{room}.")
        if target not in (other, *shown(other)) and not inside:
            wrong.append(f"{place}: imports {target}; the door is {other}")
    assert not wrong, "\n".join(wrong)


def test_no_import_circle() -> None:
    graph = nx.DiGraph((m, target) for m in modules() for target, _ in imported(m))
    circles = [sorted(c) for c in nx.strongly_connected_components(graph) if len(c) > 1]
    assert circles == []


def test_every_room_is_there() -> None:
    assert [room for room in FLOOR if room not in modules()] == []


@pytest.mark.parametrize("module", modules())
def test_files_and_functions_are_of_a_size_to_read(module: str) -> None:
    text = modules()[module].read_text(encoding="utf-8")
    long = [f"{text.count(chr(10))} lines"] if text.count("\n") > MAX_FILE else []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            documented = (ast.get_docstring(node, clean=False) or "").count("\n") + 1
            lines = (node.end_lineno or 0) - node.lineno + 1 - documented
            if lines > MAX_FUNCTION:
                long.append(f"{node.name} has {lines} lines")
    assert not long
