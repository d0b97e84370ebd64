"""Commands of the server: the diagram of a document as it is, and runs of a saved graph.

Each answers with plain data; editors without an interface of their own show what it writes to disk.
"""

from __future__ import annotations

import asyncio
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.lsp.server import LanguageServer

from runtime.errors import SpikeblocksError
from runtime.files import write_whole
from spikeblocks.lsp.session import Session, path_of

COMMANDS = {
    "run": "spikeblocks.run",
    "compare": "spikeblocks.compare",
    "diagram": "spikeblocks.showDiagram",
    "svg": "spikeblocks.diagram",
}
MAX_OUTPUT = 2**24


def add_commands(server: LanguageServer, session: Session) -> None:
    """Make a server carry out its commands."""

    @server.command(COMMANDS["svg"])
    def diagram(ls: LanguageServer, uri: str, *rest: Any) -> dict[str, str]:
        return _diagram(session, uri)

    @server.command(COMMANDS["diagram"])
    def show_diagram(ls: LanguageServer, uri: str, *rest: Any) -> dict[str, str]:
        found = _diagram(session, uri)
        if "svg" not in found:
            _tell(ls, found["error"], types.MessageType.Warning)
            return found
        folder = Path(tempfile.mkdtemp(prefix="spikeblocks-"))
        path = folder / f"{path_of(uri).stem}.svg"
        write_whole(path, found["svg"])
        _show(ls, session, path)
        return {"file": str(path)}

    @server.command(COMMANDS["run"])
    async def run(ls: LanguageServer, uri: str, *rest: Any) -> dict[str, Any]:
        return await _run(ls, path_of(uri))

    @server.command(COMMANDS["compare"])
    async def compare(ls: LanguageServer, uri: str, block: str, *rest: Any) -> dict[str, Any]:
        return await _run(ls, path_of(uri), "--vs", f"without={block}")


def _diagram(session: Session, uri: str) -> dict[str, str]:
    """The diagram of a document as SVG, or why there is none."""
    from runtime.diagrams import diagram

    model = session.model(uri)
    network = model.network if model.kind in ("graph", "part") else None
    if network is None or model.problems:
        first = model.problems[0].text if model.problems else "there is no graph here"
        return {"error": f"no diagram: {first}"}
    try:
        probes = model.observation.probes.values() if model.observation is not None else ()
        return {"svg": str(diagram(network, "svg", probes=probes))}
    except SpikeblocksError as error:
        return {"error": str(error)}


def _tell(ls: LanguageServer, text: str, kind: types.MessageType = types.MessageType.Info) -> None:
    ls.window_show_message(types.ShowMessageParams(kind, text))


def _show(ls: LanguageServer, session: Session, path: Path) -> None:
    """Let the editor open a file outside of it, if it can."""
    window = ls.client_capabilities.window
    if window is not None and window.show_document is not None and window.show_document.support:
        shown = types.ShowDocumentParams(session.uri(path), external=True)
        ls.window_show_document(shown, lambda result: None)
    else:
        _tell(ls, f"the diagram is in {path}")


async def _run(ls: LanguageServer, path: Path, *options: str) -> dict[str, Any]:
    """Run a saved graph in a process of its own; what the command line printed as JSON."""
    start = "from runtime.cli import main; main()"
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-c", start, "run", str(path), "--json", *options),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.PIPE,
        cwd=path.parent,
    )
    try:
        printed, errors = await process.communicate()
    except asyncio.CancelledError:
        process.kill()
        raise
    text = errors.decode("utf-8", "replace").strip()
    try:
        result: dict[str, Any] = json.loads(printed[:MAX_OUTPUT] or b"{}")
    except ValueError:
        result = {}
    if process.returncode not in (0, 1):
        _tell(ls, text.splitlines()[0] if text else "the run failed", types.MessageType.Error)
    else:
        folder = result.get("folder") or result.get("run") or ""
        _tell(ls, f"run folder: {path.parent / str(folder)}")
    return {"code": process.returncode, "cwd": str(path.parent), "messages": text, "result": result}
