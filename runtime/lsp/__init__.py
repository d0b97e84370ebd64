"""The language server: the Language Server Protocol in front of :mod:`runtime.language` (pygls)."""

from runtime.lsp.server import make_server, serve_stdio, serve_tcp

__all__ = ["make_server", "serve_stdio", "serve_tcp"]
