"""``runtime completion``: a script that completes commands, options and graphs in a shell."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace

from runtime.errors import MissingExtraError

HELP = "print a script that completes commands in your shell"
SHELLS = ("bash", "zsh", "tcsh")
EXAMPLES = """
runtime completion bash > ~/.local/share/bash-completion/completions/runtime
runtime completion zsh > ~/.zfunc/_runtime  (fpath+=~/.zfunc before compinit)
runtime completion tcsh >> ~/.tcshrc
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("shell", choices=SHELLS)


def run(options: Namespace) -> int:
    """Print the script."""
    try:
        import shtab
    except ImportError:
        raise MissingExtraError("completion of commands", "completion") from None
    from runtime.cli import make_parser

    parser = make_parser()
    _mark_files(parser, shtab.FILE)
    sys.stdout.write(shtab.complete(parser, shell=options.shell))
    return 0


FILES = {"graph", "graphs", "file", "out", "module", "run", "runs", "folder", "resume"}


def _mark_files(parser: ArgumentParser, files: dict[str, str]) -> None:
    """Complete the arguments that are files by the names of files."""
    for action in parser._actions:
        if isinstance(action.choices, dict):
            for verb in action.choices.values():
                _mark_files(verb, files)
        elif action.dest in FILES or action.option_strings[:1] == ["--with"]:
            action.complete = files  # type: ignore[attr-defined]
