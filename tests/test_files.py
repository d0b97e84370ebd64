"""Files are opened in one way and written in one way: searched in the sources."""

from __future__ import annotations

import ast

from tests.test_rooms import modules, place

READS = ("open", "read_bytes", "read_text", "fdopen", "memmap", "ZipFile", "fromfile", "loadtxt")
WRITES = ("write_text", "write_bytes", "savez", "savez_compressed", "savetxt", "tofile")
OWN = "files of the package itself"
TEMPORARY = "files in a temporary folder that it has just made"
# Where a file is read or written in another way, each with the reason.
EXCEPTIONS = {
    "blocks.files": "the way to read a file",
    "blocks.core.extras": "read_text of importlib.metadata",
    "blocks.library.lazy": OWN,
    "runtime.files": "the way to write a file",
    "runtime.streaming": "writes an archive into a file that its caller opened, or to a new folder",
    "runtime.engine.recorder": "rows of a run, appended in its own hidden folder",
    "runtime.experiments.processes.forkserver": "opens the current folder, and pipes",
    "runtime.plots.sharing": "a pipe",
    "runtime.language.module_worker": "standard streams",
    "spikeblocks.lsp.server": "standard streams",
    "spikeblocks.robot.driving": "opens an adapter",
    "spikeblocks.robot.transports": "opens a session of zenoh",
    "spikeblocks.robot.bags": "appends to a file that open_file of runtime.files has opened",
    "runtime.cli": "standard streams",
    "runtime.export.library": OWN,
    "runtime.export.report": TEMPORARY,
    "spikeblocks.fmu.export.writing": "files of the package itself; a library it has just built",
    "spikeblocks.page.wasm": TEMPORARY,
    "spikeblocks.studio.room": OWN,
    "spikeblocks.studio.server": OWN,
    "spikeblocks.studio.verb": "opens a browser",
    "spikeblocks.page.writing": OWN,
    "runtime.cli.shipped": OWN,
    "runtime.cli.commands.new": OWN,
    "runtime.cli.commands.graphs": OWN,
    "runtime.codegen.source": OWN,
    "runtime.codegen.ziggurat": OWN,
    "runtime.reports.zoom": OWN,
    "runtime.reports.page": OWN,
    "runtime.runs.fingerprint": "read_text of importlib.metadata",
    "runtime.runs.commit": "a git folder that it has just made",
    "runtime.toolchain.compilers": "the system's description of its processors",
    "runtime.toolchain.library": TEMPORARY,
}


def direct(module: str) -> list[tuple[int, str]]:
    """Calls of a module that open a file by themselves: line and name."""
    found = []
    for node in ast.walk(ast.parse(modules()[module].read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        function = node.func
        if isinstance(function, ast.Attribute):
            owner = ast.unparse(function.value)
            # Members of an open archive, a method of the same class, sessions, builders of text.
            if function.attr == "open" and owner in ("members", "self", "session", "written"):
                continue
            is_numpy = owner in ("np", "numpy") and function.attr in ("load", "save")
            if is_numpy or function.attr in (*READS, *WRITES):
                found.append((node.lineno, function.attr))
        elif isinstance(function, ast.Name) and function.id in ("open", "ZipFile", "memmap"):
            found.append((node.lineno, function.id))
    return found


def test_files_are_opened_and_written_in_one_way() -> None:
    ours = [m for m in modules() if m.split(".")[0] in ("blocks", "runtime", "spikeblocks")]
    found = {m: calls for m in ours if (calls := direct(m))}
    others = {m: calls for m, calls in found.items() if m not in EXCEPTIONS}
    assert [
        f"{place(m, line)}: {name}" for m, calls in others.items() for line, name in calls
    ] == []
    # A bridge can be deleted.
    kept = [m for m in EXCEPTIONS if m in modules() or not m.startswith("spikeblocks.")]
    assert [m for m in kept if m not in found] == [], "no longer an exception"
