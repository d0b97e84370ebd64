"""``runtime studio``: see the loop run in a browser, change it by hand, keep what happened."""

from __future__ import annotations

import secrets
import socket
import sys
import webbrowser
from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.errors import NOWHERE, MissingExtraError, UsageError
from runtime.terminal import show

HELP = "see a graph run in the browser, and change it by hand"
GROUP = "run"
EXAMPLES = """
runtime studio wall_following
runtime studio my.yaml --port 7000 --no-browser
"""
LOCAL = "127.0.0.1"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "graph", nargs="?", metavar="GRAPH", help="a graph; the choice of one by default"
    )
    parser.add_argument(
        "--port", type=int, default=0, help="of this machine; a free one by default"
    )
    parser.add_argument(
        "--no-browser", action="store_true", help="print the address only, open no browser"
    )
    parser.add_argument(
        "--trust", action="store_true", help="run Python files that the graph names without asking"
    )


def run(options: Namespace) -> int:
    """Serve until Ctrl-C."""
    if not 0 <= options.port <= 65535:
        raise UsageError(f"--port: expected a number up to 65535, got {options.port}")
    try:
        import starlette  # noqa: F401
        import uvicorn
        import websockets  # noqa: F401
    except ImportError:
        raise MissingExtraError("the studio", "studio") from None
    # It loads NumPy, which --help does without.
    from runtime.document import find_file
    from spikeblocks.studio.room import Room
    from spikeblocks.studio.server import application

    path = None if options.graph is None else find_file(options.graph, (NOWHERE, ""), Path())
    room = Room(path, options.trust)
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((LOCAL, options.port))
        listening.listen()  # the browser may come before the server is ready
    except OSError as error:
        listening.close()
        raise UsageError(f"--port {options.port}: {error.strerror or error}") from None
    port, token = listening.getsockname()[1], secrets.token_urlsafe(24)
    address = f"http://{LOCAL}:{port}/?token={token}"
    show(f"the studio is at {address}")
    show("Ctrl-C ends it")
    sys.stdout.flush()
    if not options.no_browser:
        webbrowser.open(address)
    app = application(room, token, port)
    config = uvicorn.Config(
        app, log_level="error", ws="websockets-sansio", ws_max_size=2**23, access_log=False
    )
    server = uvicorn.Server(config)
    try:
        with listening:
            server.run(sockets=[listening])
    except KeyboardInterrupt:
        pass
    return 0
