"""A controller as a shared library with a Python module that loads it.

In goes what :func:`export` takes, out come its files, the library, and a module of the standard
library alone, so that it runs where this project is not installed::

    from controller import Controller
    controller = Controller()
    out = controller.step(plant_pose=[0.0, 0.1, 0.0])   # {"limit_limited": [1.0, 0.0]}
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any

from runtime.errors import UsageError
from runtime.export.controller import Exported, export
from runtime.files import system_errors, write_files
from runtime.graph import Graph
from runtime.toolchain import find_compiler

ENDINGS = {"win32": "dll", "darwin": "dylib"}  # of other systems: so
FLAGS = ("-std=c99", "-O2", "-fPIC", "-shared", "-ffp-contract=off")
TEMPLATES = Path(__file__).parent / "python"


def export_library(
    graph: Graph, folder: str | Path, *, name: str = "controller", **options: Any
) -> Exported:
    """Write blocks of a graph as C, compile them, and write a Python module that calls them.

    Raises
    ------
    UsageError, GraphError : as of :func:`export`; the compiler does not accept the text.
    MissingCompilerError : there is no C compiler.
    """
    compiler = find_compiler().command
    made = export(graph, folder, name=name, **options)
    ending = ENDINGS.get(sys.platform, "so")
    library = f"{name}_library.{ending}"
    parts = {
        **{"name": name, "upper": name.upper(), "library": library, "title": title_of(name)},
        "inputs": _sizes(made.members[0]),
        "outputs": _sizes(made.members[1]),
        "number": "c_float" if options.get("float32") else "c_double",
        "about": made.report.partition("\n\n")[0],
        "learning": "c->learning = on;" if made.learns else "(void)c;\n    (void)on;",
    }
    templates = {f"{name}.py": "controller.py.txt", f"{name}_library.c": "library.c"}
    texts = {
        file: Template((TEMPLATES / template).read_text(encoding="utf-8")).substitute(parts)
        for file, template in templates.items()
    }
    with system_errors(f"write to '{folder}'"):
        write_files({made.folder / file: text for file, text in texts.items()})
    sources = (f"{name}.c", f"{name}_library.c")
    command = [*compiler, *FLAGS, *sources, "-lm", "-o", library]
    done = subprocess.run(command, cwd=made.folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        raise UsageError(f"the C compiler cannot make {library}: {lines[0]}")
    return replace(made, files=(*made.files, *texts, library))


def title_of(name: str) -> str:
    """The name of the class: ``my_controller`` gives ``MyController``."""
    return "".join(word[:1].upper() + word[1:] for word in name.split("_") if word)


def _sizes(members: Iterable[tuple[str, int]]) -> str:
    """A dictionary of names with the count of their numbers, 0 of a number that is no array."""
    return "{" + ", ".join(f'"{member}": {size}' for member, size in members) + "}"
