"""``runtime schema``: a JSON Schema of graph files, for editors without the language server."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from runtime.terminal import show_json

HELP = "print a JSON Schema of graph files, for editors without 'lsp'"
ABOUT = "The first line '# yaml-language-server: $schema=FILE' of a graph names the schema."
EXAMPLES = """
runtime schema > graph.schema.json
runtime schema | head
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options: there are none."""


def run(options: Namespace) -> int:
    """Print the schema."""
    from runtime.language import json_schema

    show_json(json_schema())
    return 0
