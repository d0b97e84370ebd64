"""What a command imports: a graph of few types of blocks does not wait for the library.

Modules are counted, since a time says more about the machine. A bound that is met by little was
measured; raise it only with what imports the further module at a place where it is needed.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

GRAPH = """\
run: {dt: 0.01, until: 0.1}
blocks:
  one: {type: Constant, value: 1}
  lag: {type: Lowpass, tau: 0.1}
wires:
  lag: {input: one.value}
probes: {y: lag.out}
"""
CODE = """if True:
    import sys
    from runtime.cli import run
    code = run(sys.argv[1:])
    print("MODULES", *sys.modules)
    sys.exit(code)
"""
DRAWING = ("matplotlib", "runtime.plots")


@pytest.fixture
def graph(tmp_path: Path) -> Path:
    path = tmp_path / "lag.yaml"
    path.write_text(GRAPH, encoding="utf-8")
    return path


def modules_of(*words: str) -> list[str]:
    """The modules that are there after a command in a new interpreter."""
    done = subprocess.run([sys.executable, "-c", CODE, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.rpartition("MODULES ")[2].split()


def under(modules: list[str], *rooms: str) -> list[str]:
    return [m for m in modules if any(f"{m}.".startswith(f"{room}.") for room in rooms)]


@pytest.mark.parametrize(
    ("words", "ours", "absent"),
    [
        (
            ("validate",),
            109,
            ("scipy", "networkx", "runtime.runs", "runtime.engine.engine", "runtime.toolchain"),
        ),
        (("run", "--no-plots"), 129, ("scipy", "networkx", "runtime.language", "runtime.compiler")),
    ],
)
def test_a_small_graph_imports_few_modules(
    graph: Path, words: tuple[str, ...], ours: int, absent: tuple[str, ...]
) -> None:
    out = ("--out", str(graph.parent)) if words[0] == "run" else ()
    modules = modules_of(words[0], str(graph), *words[1:], *out)
    assert under(modules, *DRAWING, *absent) == []
    kinds = [m for m in under(modules, "blocks") if not under([m], "blocks.core")]
    assert len(kinds) <= 26, kinds
    assert "blocks.generic.memory" in kinds
    assert under(kinds, "blocks.control", "blocks.plants", "blocks.wall_fitting") == []
    assert len(under(modules, "runtime")) <= ours


def test_help_needs_no_numpy() -> None:
    assert under(modules_of("run", "--help"), "numpy", "yaml") == []
