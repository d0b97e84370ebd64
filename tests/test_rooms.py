"""The structure holds: imports run downwards and through the doors; nothing grows too long."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from functools import cache
from itertools import chain
from pathlib import Path

import networkx as nx

from docs.describe import ROOMS
from tests.rooms import BUDGETS, room_sizes

ROOT = Path(__file__).parent.parent
PACKAGES = ("blocks", "runtime", "spikeblocks", "graphs", "benchmarks", "examples")

# Packages that can be deleted with their lines in pyproject.toml: the rest names none of them.
BRIDGES = tuple(
    sorted(f"spikeblocks.{f.parent.name}" for f in ROOT.glob("spikeblocks/*/__init__.py"))
)

# Bottom floor first. A room may import from its own files and from floors below; rooms on one floor
# do not know each other. What loads matplotlib in a room that works without it is a room by itself.
FLOORS: tuple[tuple[str, ...], ...] = (
    ("blocks.foreign", "blocks.library.index", "blocks.limits", "blocks.messages"),
    ("blocks.library.extensions", "blocks.files", "blocks.library.lazy"),
    ("blocks.core",),
    ("blocks.dynamics", "blocks.generic", "blocks.neural", "blocks.nonlinear"),
    ("blocks.plants", "blocks.sensors", "blocks.sources", "blocks.world"),
    ("blocks.control", "blocks.vehicle"),
    ("blocks.wall_fitting",),
    ("blocks.library.registry",),
    ("blocks",),
    ("runtime.errors", "runtime.streaming", "runtime.codegen", "runtime.solvers"),
    ("runtime.files",),
    ("runtime.terminal", "runtime.toolchain"),
    ("runtime.arguments", "runtime.tables"),
    ("runtime.document",),
    ("runtime.network",),
    ("runtime.observation", "runtime.descriptions"),
    ("runtime.compiler", "runtime.memory"),
    ("runtime.plan",),
    ("runtime.engine", "runtime.checking"),
    ("runtime.engine.compiled",),
    ("runtime.plots", "runtime.diagrams.layout"),
    ("runtime.diagrams",),
    ("runtime.runs",),
    ("runtime.sessions",),
    ("runtime.graph",),
    ("runtime.compare", "runtime.export"),
    ("runtime.compare.overlay",),
    ("runtime.experiments.design", "runtime.experiments.processes"),
    ("runtime.experiments.execution",),
    ("runtime.experiments.analysis",),
    ("runtime.experiments.analysis.figures",),
    ("runtime.experiments.analysis.sweep_plots", "runtime.experiments.analysis.ablation_plots"),
    ("runtime.experiments.analysis.study_figures",),
    ("runtime.experiments.tuning",),
    ("runtime.experiments.tuning.tuning_plots", "runtime.experiments.tuning.contest_plots"),
    ("runtime.experiments",),
    ("runtime.experiments.drawing",),
    ("runtime.fitting",),
    ("runtime.reports", "runtime.language"),
    ("runtime.cli",),
    ("runtime",),
    ("spikeblocks",),
    BRIDGES,
    ("spikeblocks_command", "graphs", "benchmarks", "examples"),
)
FLOOR = {room: floor for floor, rooms in enumerate(FLOORS) for room in rooms}

OURS = ("blocks", "runtime", "spikeblocks")

# Imports that go up or past a door, each with the reason: (importing module, imported) -> why.
EXCEPTIONS = {
    (
        "runtime.experiments.processes.forkserver",
        "runtime.experiments.execution.worker",
    ): "the process that forks workers imports, by name, what the first trial of most graphs needs",
}
BY_NAME = ("import_module", "__import__")
# Modules that import by a name that no text shows, and what the name can be.
COMPUTED = {
    "blocks": "one of its rooms",
    "blocks.core.extras": "an optional package of others",
    "blocks.library.extensions": "an entry of the library's own, counted as strings; of index.py",
    "blocks.library.lazy": "what the text of a door imports for type checkers",
    "runtime.plots.painters": "a function of another package, or of a graph's own file",
    "runtime.experiments.processes.forkserver": "one of PRELOADED, counted as strings",
    "runtime.cli.commands.plugins": "one of REGISTRIES, counted as strings",
    "spikeblocks.robot.transports": "a module of an adapter, which a robot.yaml names",
    "benchmarks.peers": "one of its own modules, a peer",
}
# Keyword arguments on lines of their own count as one line for each call (see ``keyword_lines``).
MAX_FILE, MAX_FUNCTION = 450, 45
# Functions that may be longer, each with the reason.
LONG = {"benchmarks.by_hand:numpy_case_a": "one loop as a person writes it, which is compared"}


@cache
def modules() -> dict[str, Path]:
    """All modules, packages by their own name."""
    paths = chain.from_iterable(sorted((ROOT / name).rglob("*.py")) for name in PACKAGES)
    named = {}
    for path in (*paths, ROOT / "spikeblocks_command.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        named[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return named


@cache
def nodes(module: str) -> list[ast.AST]:
    """What rules look at in a module's text: imports, strings, calls and functions."""
    kinds = (ast.Import, ast.ImportFrom, ast.Constant, ast.Call, ast.FunctionDef)
    every = ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8")))
    return [node for node in every if isinstance(node, (*kinds, ast.AsyncFunctionDef))]


def place(module: str, line: int) -> str:
    return f"{modules()[module].relative_to(ROOT)}:{line}"


def room_of(module: str) -> str:
    """The innermost room that a module is in."""
    name = module
    while name not in FLOOR:
        name = name.rpartition(".")[0]
    return name


def names_in(node: ast.AST, module: str) -> list[str]:
    """The modules that one node of a text may import.

    A string that is the name of a module, or module:name, counts as an import of it, since such
    strings are given to ``import_module`` and to other processes.
    """
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    if isinstance(node, ast.ImportFrom):
        origin = node.module or ""
        if node.level:
            is_package = modules()[module].name == "__init__.py"
            parts = module.split(".")
            above = parts[: len(parts) - node.level + is_package]
            origin = ".".join([*above, *filter(None, [node.module])])
        inner = [f"{origin}.{alias.name}" for alias in node.names]
        return [name if name in modules() else origin for name in inner]
    if isinstance(node, ast.Constant) and isinstance(node.value, str) and "." in node.value:
        return [node.value.partition(":")[0]]
    return []


@cache
def imported(module: str) -> list[tuple[str, int]]:
    """What a module imports of ours, for type checking, lazily and by strings included."""
    return [
        (name, getattr(node, "lineno", 0))
        for node in nodes(module)
        for name in names_in(node, module)
        if name in modules() and name != module
    ]


def computed(module: str) -> list[int]:
    """The lines on which a module imports by a name that is not a literal."""
    return [
        node.lineno
        for node in nodes(module)
        if isinstance(node, ast.Call)
        and getattr(node.func, "attr", getattr(node.func, "id", "")) in BY_NAME
        and not (node.args and isinstance(node.args[0], ast.Constant))
    ]


@cache
def shown(room: str) -> set[str]:
    """The modules that a room's door shows: as they are, or as a function of the same name."""
    imports = (node for node in nodes(room) if isinstance(node, ast.ImportFrom))
    return {f"{room}.{alias.name}" for node in imports for alias in node.names}


def violations(module: str) -> Iterator[tuple[str, str]]:
    """What a module imports against the order of the rooms, with a line that says so."""
    room = room_of(module)
    for target, line in imported(module):
        other = room_of(target)
        if other == room:
            continue
        if FLOOR[other] >= FLOOR[room] and module != room.partition(".")[0]:
            reason = f"{room} imports {target}, which is not below it"
            yield target, f"{place(module, line)}: {reason}"
        inside = f"{module}.".startswith(f"{other}.") or f"{target}.".startswith(f"{room}.")
        if target != other and not inside and target not in shown(other):
            yield target, f"{place(module, line)}: imports {target}; the door is {other}"


def test_imports_run_downwards_and_through_the_doors() -> None:
    assert [room for room in FLOOR if room not in {*modules(), *PACKAGES}] == []
    found = {(m, target): line for m in modules() for target, line in violations(m)}
    assert [line for pair, line in found.items() if pair not in EXCEPTIONS] == []
    assert [pair for pair in EXCEPTIONS if pair not in found] == [], "no longer an exception"
    by_name = {m: lines for m in modules() if (lines := computed(m))}
    assert [place(m, n) for m, lines in by_name.items() for n in lines if m not in COMPUTED] == []
    # A bridge can be deleted.
    kept = [m for m in COMPUTED if m in modules() or not m.startswith("spikeblocks.")]
    assert [m for m in kept if m not in by_name] == [], "no longer an exception"


def test_no_bridge_is_named_outside_of_its_folder() -> None:
    named = [
        f"{place(m, line)}: names {target}, which can be deleted"
        for m in modules()
        for target, line in imported(m)
        if m.partition(".")[0] in OURS
        and room_of(target) in BRIDGES
        and room_of(m) != room_of(target)
    ]
    assert named == []


def test_no_door_exports_a_name_that_one_of_its_modules_has() -> None:
    # Python would put that module into the place of what is imported when it is first used.
    doors = [m for m, path in modules().items() if "= door(__name__)" in path.read_text("utf-8")]
    exported = {
        f"{m}.{alias.asname or alias.name}"
        for m in doors
        for node in nodes(m)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }
    assert len(doors) > 10
    assert sorted(exported & modules().keys()) == []


def test_type_checkers_know_every_room_of_blocks() -> None:
    starred = [
        node.module
        for node in nodes("blocks")
        if isinstance(node, ast.ImportFrom) and node.names[0].name == "*"
    ]
    assert starred == sorted(f"blocks.{room}" for room in ROOMS)


def test_every_room_keeps_to_its_budget() -> None:
    """A reason for a larger one is written beside it in tests/rooms.py."""
    sizes = room_sizes()
    over = {room: n - BUDGETS.get(room, 0) for room, n in sizes.items() if n > BUDGETS.get(room, 0)}
    assert over == {}


def test_no_import_circle() -> None:
    graph = nx.DiGraph((m, target) for m in modules() for target, _ in imported(m))
    circles = [sorted(c) for c in nx.strongly_connected_components(graph) if len(c) > 1]
    assert circles == []


def test_modules_begin_with_what_goes_in_and_what_comes_out() -> None:
    rooms = ("compiler", "codegen", "engine", "experiments", "language")
    unsaid = []
    for module, path in modules().items():
        if module.startswith(tuple(f"runtime.{room}." for room in rooms)):
            told = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
            said = re.search(r"\bin(:|\s+go(es)?\b).*\bout(\s+comes?\b|:)", told, re.I | re.S)
            unsaid += [module] if said is None and path.name != "__init__.py" else []
    assert unsaid == []


def keyword_lines(every: list[ast.AST]) -> set[int]:
    """The lines that are not counted: of each call all keyword arguments but the first, where each
    has a line of its own.

    A table of named values is easier to read than the same values without names; counted, it would
    be written as tuples behind stars.
    """
    lines: set[int] = set()
    for call in every:
        if isinstance(call, ast.Call):
            alone = {k.lineno for k in call.keywords if k.lineno == k.value.end_lineno}
            lines |= {*sorted(alone - {call.lineno, call.func.end_lineno})[1:]}
    return lines


def test_files_and_functions_are_of_a_size_to_read() -> None:
    long = []
    for module, path in modules().items():
        uncounted = keyword_lines(nodes(module))
        lines = path.read_text(encoding="utf-8").count("\n")
        if lines - len(uncounted) > MAX_FILE:
            long.append(f"{place(module, lines)}: more than {MAX_FILE} lines")
        for node in nodes(module):
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                documented = (ast.get_docstring(node, clean=False) or "").count("\n") + 1
                whole = range(node.lineno, (node.end_lineno or 0) + 1)
                lines = len(whole) - documented - len(uncounted.intersection(whole))
                if lines > MAX_FUNCTION and f"{module}:{node.name}" not in LONG:
                    long.append(f"{place(module, node.lineno)}: {node.name} has {lines} lines")
    assert long == []


def test_keyword_arguments_count_as_one_line_for_each_call() -> None:
    text = """
made = Table(
    first,
    name="a",
    rows=[
        1,
    ],
    unit=Unit(
        kind="length",
        symbol="m", scale=1.0,
    ),
    note="",
    doc="",
)
short = f(a=1, b=2)
"""
    # Of Table: name, note and doc; of Unit: two lines of keywords; values of several lines count.
    assert keyword_lines(list(ast.walk(ast.parse(text)))) == {10, 12, 13}
