"""``runtime lsp``: the language server for editors."""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace

from runtime.errors import MissingExtraError, UsageError

HELP = "the language server: problems, completion, hover while you type"
GROUP = "tools"
EXAMPLES = """
runtime lsp
runtime lsp --tcp 7000
"""
LOCAL = "127.0.0.1"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument(
        "--tcp", metavar="[HOST:]PORT", help="listen on a port of this machine, not on stdin"
    )
    parser.add_argument("--stdio", action="store_true", help="serve stdin and stdout (the default)")
    parser.add_argument(
        "--no-modules", action="store_true", help="never run Python files that graphs name"
    )


def run(options: Namespace) -> int:
    """Serve one editor, until it ends the session."""
    address = None if options.tcp is None else _address(options.tcp)
    if address is not None and options.stdio:
        raise UsageError("--tcp and --stdio exclude each other; keep one")
    try:
        import pygls.lsp.server  # noqa: F401
    except ImportError:
        raise MissingExtraError("the language server", "editor") from None
    from spikeblocks.lsp.server import serve_stdio, serve_tcp

    if address is None:
        serve_stdio(not options.no_modules)
    else:
        serve_tcp(not options.no_modules, *address)
    return 0


def _address(text: str) -> tuple[str, int]:
    found = re.fullmatch(r"(?:([\w.-]+|\[[\da-fA-F:]+\]):)?(\d{1,5})", text, re.ASCII)
    if found is None or int(found[2]) > 65535:
        raise UsageError(f"--tcp: expected a port, as in 7345 or {LOCAL}:7345, got '{text}'")
    return (found[1] or LOCAL).strip("[]"), int(found[2])
