"""The server: one handler per request; each asks the language service and converts the answer."""

from __future__ import annotations

import asyncio
import gc
import logging
import os
import sys
from importlib.metadata import PackageNotFoundError, version

from lsprotocol import types
from pygls.exceptions import JsonRpcInvalidParams
from pygls.io_ import run_async
from pygls.lsp.server import LanguageServer

from runtime.errors import UsageError
from runtime.language import Isolation, diagnose
from spikeblocks.lsp.commands import add_commands
from spikeblocks.lsp.convert import Converter
from spikeblocks.lsp.requests import add_requests
from spikeblocks.lsp.session import Session

STDOUT, STDERR = 1, 2
PATIENCE = 0.3  # how long a request waits for the import of a user's file, s
# How long to wait for more edits before a document is checked, s; a graph of many blocks takes more
# than 50 ms to check, so that is done once the typing pauses.
PAUSE, LONG_PAUSE = 0.02, 0.25
MANY_BLOCKS = 300


def _is_news(record: logging.LogRecord) -> bool:
    """Whether a message of pygls is not about a refusal, which the editor shows."""
    error = record.exc_info[1] if record.exc_info else next(iter(record.args or ()), None)
    return not isinstance(error, JsonRpcInvalidParams)


class _Checks:
    """Publishes diagnostics of open documents, after the last of the edits that came together."""

    def __init__(self, server: LanguageServer, session: Session) -> None:
        self.server, self.session = server, session
        self.converter = Converter(session)
        self.timer: asyncio.TimerHandle | None = None
        self.first = ""
        self.pause = PAUSE

    def ask(self, uri: str = "") -> None:
        """Check all open documents soon, one of them first."""
        self.session.changed()
        self.first = uri or self.first
        if self.timer is not None:
            self.timer.cancel()
        self.timer = asyncio.get_running_loop().call_later(self.pause, self.run)

    def run(self) -> None:
        self.timer = None
        for uri in sorted(self.session.open, key=lambda uri: uri != self.first):
            self.publish(uri)
        is_long = any(count > MANY_BLOCKS for count in self.session.block_counts())
        self.pause = LONG_PAUSE if is_long else PAUSE

    def publish(self, uri: str) -> None:
        model = self.session.model(uri)
        found = diagnose(model) if model.is_ours else []
        version = self.server.workspace.get_text_document(uri).version
        shown = [self.converter.diagnostic(model, each) for each in found]
        self.server.text_document_publish_diagnostics(
            types.PublishDiagnosticsParams(uri, shown, version)
        )

    def clear(self, uri: str) -> None:
        self.server.text_document_publish_diagnostics(types.PublishDiagnosticsParams(uri, []))


def make_server(modules: bool = True) -> LanguageServer:
    """A server for one editor; with ``modules=False`` no Python file of a graph is ever run."""
    try:
        number = version("spikeblocks")
    except PackageNotFoundError:
        number = "0"
    for name in ("pygls.protocol.json_rpc", "pygls.server"):
        logging.getLogger(name).addFilter(_is_news)
    server = LanguageServer(
        "spikeblocks", number, text_document_sync_kind=types.TextDocumentSyncKind.Incremental
    )
    isolation = Isolation(PATIENCE) if modules else None
    session = Session(server, isolation)
    checks = _Checks(server, session)
    _add_texts(server, session, checks, isolation)
    add_requests(server, session)
    add_commands(server, session)
    return server


def _add_texts(
    server: LanguageServer, session: Session, checks: _Checks, isolation: Isolation | None
) -> None:
    """What happens as documents are opened, changed, saved and closed."""

    @server.feature(types.INITIALIZED)
    def initialized(ls: LanguageServer, params: types.InitializedParams) -> None:
        if isolation is not None:
            loop = asyncio.get_running_loop()
            isolation.on_change = lambda: _soon(loop, checks)
        workspace = ls.client_capabilities.workspace
        watching = workspace.did_change_watched_files if workspace is not None else None
        if watching is not None and watching.dynamic_registration:
            patterns = ("**/*.yaml", "**/*.yml", "**/*.py")
            watchers = [types.FileSystemWatcher(pattern) for pattern in patterns]
            options = types.DidChangeWatchedFilesRegistrationOptions(watchers)
            method = types.WORKSPACE_DID_CHANGE_WATCHED_FILES
            registration = types.Registration("files", method, options)
            ls.client_register_capability(types.RegistrationParams([registration]))

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def did_open(ls: LanguageServer, params: types.DidOpenTextDocumentParams) -> None:
        checks.ask(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def did_change(ls: LanguageServer, params: types.DidChangeTextDocumentParams) -> None:
        checks.ask(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def did_save(ls: LanguageServer, params: types.DidSaveTextDocumentParams) -> None:
        checks.ask(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def did_close(ls: LanguageServer, params: types.DidCloseTextDocumentParams) -> None:
        session.closed(params.text_document.uri)
        checks.clear(params.text_document.uri)

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def files_changed(ls: LanguageServer, params: types.DidChangeWatchedFilesParams) -> None:
        checks.ask()

    @server.feature(types.SHUTDOWN)
    def shut_down(ls: LanguageServer, params: None) -> None:
        if isolation is not None:
            isolation.close()


def _soon(loop: asyncio.AbstractEventLoop, checks: _Checks) -> None:
    """Check the documents again, asked for by a thread that waited for an import."""
    if not loop.is_closed():
        loop.call_soon_threadsafe(checks.ask)


def settle() -> None:
    """Take what is loaded so far out of garbage collections, which go through it at each edit."""
    gc.collect()
    gc.freeze()


def serve_stdio(modules: bool) -> None:
    """Serve the editor at the other end of standard input and output.

    At the end pygls closes what it writes to, which is a copy, so that stdout stays open. Meanwhile
    stdout is stderr: what a package prints would not be a message of the protocol.
    """
    server = make_server(modules)
    settle()
    sys.stdout.flush()
    kept = os.dup(STDOUT)
    os.dup2(STDERR, STDOUT)
    try:
        with os.fdopen(os.dup(kept), "wb") as messages:
            server.start_io(stdout=messages)
    finally:
        os.dup2(kept, STDOUT)
        os.close(kept)


class _Headers:
    """A reader of messages that ends at a line that is no header of the protocol.

    Without it a web page could send one to a local port, inside an HTTP request.
    """

    def __init__(self, reader: asyncio.StreamReader) -> None:
        self.reader = reader

    async def readline(self) -> bytes:
        line = await self.reader.readline()
        is_header = not line.strip() or line.lower().startswith(b"content-")
        return line if is_header else b""

    async def readexactly(self, n: int) -> bytes:
        return await self.reader.readexactly(n)


def serve_tcp(modules: bool, host: str, port: int) -> None:
    """Serve one editor that connects to a port.

    Raises
    ------
    UsageError : the port cannot be listened on.
    """
    from threading import Event

    from runtime.terminal import tell

    server = make_server(modules)
    settle()
    ended: list[asyncio.Event] = []

    async def connected(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if server.protocol.writer is not None:
            writer.close()  # one editor at a time
            return
        server.protocol.set_writer(writer)
        await run_async(Event(), _Headers(reader), server.protocol)
        writer.close()
        ended[0].set()

    async def listen() -> None:
        ended.append(asyncio.Event())
        try:
            listening = await asyncio.start_server(connected, host, port)
        except OSError as error:
            raise UsageError(f"cannot listen on {host}:{port}: {error.strerror}") from None
        async with listening:
            tell(f"listening on {host}:{listening.sockets[0].getsockname()[1]}")
            await ended[0].wait()

    asyncio.run(listen())
