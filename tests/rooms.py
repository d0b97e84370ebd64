"""Sizes of the rooms: what each is for, its lines of code, and the most that it may have.

``python -m tests.rooms`` writes the table into docs/architecture.md; tests hold the budgets::

    room_sizes()["runtime/plan"]    # 1543
"""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parent.parent
PAGE = ROOT / "docs" / "architecture.md"
MARKS = ("<!-- rooms: made by `python -m tests.rooms` -->\n", "<!-- end of rooms -->")
CORE, BRIDGES = ("blocks", "runtime"), "spikeblocks"

# The most lines of code that a room may have. A number that is raised needs its reason beside it.
BUDGETS: dict[str, int] = {
    "blocks/__init__.py": 60,
    "blocks/foreign.py": 50,
    "blocks/library": 550,
    "blocks/limits.py": 70,
    "blocks/messages.py": 130,
    "blocks/files.py": 140,
    "blocks/core": 4050,
    "blocks/dynamics": 2150,
    "blocks/generic": 850,
    "blocks/neural": 3600,
    "blocks/nonlinear": 350,
    "blocks/plants": 600,
    "blocks/sensors": 400,
    "blocks/sources": 1050,
    "blocks/world": 900,
    "blocks/control": 2050,
    "blocks/vehicle": 750,
    "blocks/wall_fitting": 1550,
    "runtime/__init__.py": 70,
    "runtime/codegen": 4200,
    "runtime/errors.py": 120,
    "runtime/solvers.py": 140,
    "runtime/streaming.py": 80,
    "runtime/files.py": 220,
    "runtime/terminal.py": 120,
    "runtime/toolchain": 500,
    "runtime/arguments.py": 110,
    "runtime/tables": 240,
    "runtime/document": 2000,
    "runtime/network": 3200,
    "runtime/descriptions.py": 200,
    "runtime/observation": 2300,
    "runtime/compiler": 950,
    "runtime/memory": 650,
    "runtime/plan": 1350,
    "runtime/checking": 450,
    "runtime/engine": 5050,
    "runtime/diagrams": 2350,
    "runtime/plots": 2900,
    "runtime/runs": 2350,
    "runtime/sessions": 700,
    "runtime/graph": 1000,
    "runtime/compare": 750,
    "runtime/export": 2400,
    "runtime/experiments": 8200,
    "runtime/fitting": 600,
    "runtime/language": 3700,
    "runtime/reports": 1350,
    "runtime/cli": 3400,
    "spikeblocks/__init__.py": 30,
    "spikeblocks/fmu": 850,
    "spikeblocks/gym": 230,
    "spikeblocks/lsp": 700,
    "spikeblocks/mujoco": 1000,
    "spikeblocks/nengo": 2300,
    "spikeblocks/nir": 240,
    "spikeblocks/page": 550,
    "spikeblocks/robot": 1800,
    "spikeblocks/studio": 1450,
}


@cache
def room_sizes() -> dict[str, int]:
    """Lines of code by room: without comments, docstrings and blank lines."""
    sizes: dict[str, int] = {}
    for package in (*CORE, BRIDGES):
        for path in sorted((ROOT / package).rglob("*.py")):
            room = "/".join(path.relative_to(ROOT).parts[:2])
            sizes[room] = sizes.get(room, 0) + code_lines(path.read_text(encoding="utf-8"))
    return sizes


def code_lines(text: str) -> int:
    """The lines of a module that are neither blank nor a comment nor in a docstring."""
    documented: set[int] = set()
    kinds = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, kinds) and ast.get_docstring(node, clean=False) is not None:
            documented.update(range(node.body[0].lineno, (node.body[0].end_lineno or 0) + 1))
    return sum(
        bool(line.strip()) and not line.lstrip().startswith("#") and number not in documented
        for number, line in enumerate(text.split("\n"), 1)
    )


def purpose(room: str) -> str:
    """What a room is for: the first sentence of its docstring, Sphinx's roles as code."""
    path = ROOT / room
    text = (path / "__init__.py" if path.is_dir() else path).read_text(encoding="utf-8")
    first = (ast.get_docstring(ast.parse(text)) or "").split("\n\n")[0]
    sentence = re.split(r"\.(?:\s|$)", " ".join(first.split()))[0].removesuffix(":")
    return re.sub(r"(?::\w+:)?`+([^`]*)`+", r"`\1`", sentence)


def table() -> str:
    """The table of the rooms, lowest first, with a sum for the core and for the bridges."""
    sizes = room_sizes()
    lines = ["| room | what it is for | lines | budget |", "|---|---|---:|---:|"]
    lines += [
        f"| `{room}` | {purpose(room)} | {sizes[room]:,} | {BUDGETS[room]:,} |"
        for room in _ordered()
    ]
    for name, packages in (("core", CORE), ("bridges", (BRIDGES,))):
        rooms = [room for room in sizes if room.split("/")[0] in packages]
        lines_of, most = (sum(of[room] for room in rooms) for of in (sizes, BUDGETS))
        lines.append(f"| **{name}** | | {lines_of:,} | {most:,} |")
    return "\n".join(lines) + "\n"


def _ordered() -> list[str]:
    """All rooms in the order of the floors; modules beside the rooms are put with their package."""
    from tests.test_rooms import FLOORS

    floor = {name: number for number, names in enumerate(FLOORS) for name in names}

    def height(room: str) -> tuple[int, str]:
        name = room.removesuffix(".py").replace("/", ".").removesuffix(".__init__")
        own = [at for each, at in floor.items() if f"{each}.".startswith(f"{name}.")]
        return min(own, default=floor[name.partition(".")[0]]), room

    return sorted(room_sizes(), key=height)


def main() -> None:
    """Write the table into the page."""
    before, rest = PAGE.read_text(encoding="utf-8").split(MARKS[0])
    PAGE.write_text(f"{before}{MARKS[0]}{table()}{MARKS[1]}{rest.split(MARKS[1])[1]}", "utf-8")


if __name__ == "__main__":
    main()
