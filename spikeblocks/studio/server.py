"""The server of one studio: the page, its files, and the socket behind it, on loopback only.

In: a :class:`Room` and a token. Out: an application. Whoever connects must come from the page
itself (Origin and Host are compared) and know the token, which only the address has that was
printed; the page takes it out of the address bar. Nothing but the page's own files is served.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import secrets
from collections.abc import AsyncIterator
from pathlib import Path

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Route, WebSocketRoute
from starlette.websockets import WebSocket, WebSocketDisconnect

from spikeblocks.studio.room import Room

PAGE = Path(__file__).parent / "page"
TYPES = {
    ".js": "text/javascript",
    ".css": "text/css",
    ".html": "text/html",
    ".svg": "image/svg+xml",
}
NAMES = ("127.0.0.1", "localhost")
PATIENCE = 10.0  # s to say the token
QUEUE = 64  # messages that a slow page may have waiting; frames beyond that are dropped


class _Connection:
    """A page behind a socket: what is posted is sent in order."""

    def __init__(self, socket: WebSocket) -> None:
        self.socket = socket
        self.queue: asyncio.Queue[str | bytes] = asyncio.Queue()
        self.missed = False

    def post(self, data: str | bytes) -> None:
        """Send it something; a page that is too slow for frames gets all of them later."""
        if isinstance(data, bytes) and self.queue.qsize() > QUEUE:
            self.missed = True
            return
        self.queue.put_nowait(data)

    async def send(self, room: Room) -> None:
        """Send what is posted."""
        while True:
            data = await self.queue.get()
            try:
                if isinstance(data, bytes):
                    await self.socket.send_bytes(data)
                else:
                    await self.socket.send_text(data)
            except (WebSocketDisconnect, RuntimeError):
                return  # it was closed meanwhile, which who receives is told
            if self.missed and self.queue.empty():
                self.missed = False
                room.process.send("all")


class Service:
    """The page's files and its socket.

    Parameters
    ----------
    token : which a page must know. port : that the addresses of pages have.
    """

    def __init__(self, room: Room, token: str, port: int) -> None:
        self.room, self.token, self.port = room, token, port
        self.origins = {f"http://{name}:{port}" for name in NAMES}

    async def asset(self, request: Request) -> Response:
        """One of the page's files."""
        name = request.path_params.get("name", "index.html")
        path = PAGE / name
        if "/" in name or "\\" in name or path.suffix not in TYPES or not path.is_file():
            return PlainTextResponse("there is no such file", 404)
        nonce = secrets.token_urlsafe(16)
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".html":
            text = text.replace("@nonce@", nonce)
        headers = {
            "Content-Security-Policy": _policy(nonce, self.port),
            "Cache-Control": "no-store",
            "Referrer-Policy": "no-referrer",
            "X-Content-Type-Options": "nosniff",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
        }
        return Response(text, headers=headers, media_type=TYPES[path.suffix])

    async def socket(self, websocket: WebSocket) -> None:
        """Serve one page, until it is closed."""
        if websocket.headers.get("origin") not in self.origins:
            await websocket.close(4403)
            return
        await websocket.accept()
        page = _Connection(websocket)
        with contextlib.suppress(TimeoutError):
            first = await asyncio.wait_for(_receive(websocket), PATIENCE)
            given = str((first or {}).get("token", "")).encode("utf-8", "replace")
            if not secrets.compare_digest(given, self.token.encode()):
                if first is not None:
                    await websocket.close(4401)
                return
            self.room.join(page)
            sending = asyncio.create_task(page.send(self.room))
            try:
                while (message := await _receive(websocket)) is not None:
                    await self.room.handle(page, message)
            finally:
                sending.cancel()
                self.room.leave(page)

    @contextlib.asynccontextmanager
    async def lifespan(self, app: Starlette) -> AsyncIterator[None]:
        """The session's process lives as long as the server."""
        self.room.start()
        watching = asyncio.create_task(self.room.watch())
        try:
            yield
        finally:
            watching.cancel()
            self.room.process.stop()


def application(room: Room, token: str, port: int) -> Starlette:
    """The application that serves a room."""
    service = Service(room, token, port)
    return Starlette(
        routes=[
            Route("/", service.asset),
            WebSocketRoute("/socket", service.socket),
            Route("/{name}", service.asset),
        ],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=list(NAMES))],
        lifespan=service.lifespan,
    )


async def _receive(websocket: WebSocket) -> dict[str, object] | None:
    """The next message of a page; None once it is closed, and an empty one for bytes."""
    try:
        return _read(await websocket.receive_text())
    except KeyError:
        return {}
    except (WebSocketDisconnect, RuntimeError):  # it may have been closed while something was sent
        return None


def _read(text: str) -> dict[str, object]:
    """A message of a page; an empty one if it is none."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _policy(nonce: str, port: int) -> str:
    """A content security policy: the page's own files, and its own socket."""
    sockets = " ".join(f"ws://{name}:{port}" for name in NAMES)
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self' 'nonce-{nonce}'; "
        f"img-src 'self' data:; font-src 'self'; connect-src 'self' {sockets}; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
