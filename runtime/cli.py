"""The command line: ``runtime run graph.yaml`` and its sisters.

Exit codes: 0 fine; 1 it ran and an expectation failed; 2 usage or an invalid graph; 3 the
simulation failed (what was recorded is kept); 4 an optional extra is missing; 130 interrupted
(``runtime run`` keeps what was recorded on SIGTERM and SIGHUP, too, and ends with 143 and 129).
Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import NoReturn, TextIO

from runtime.commands import NAMES, command
from runtime.errors import SpikeblocksError, UsageError
from runtime.terminal import printable, show, tell

EPILOG = """examples:
  runtime run line_actuator_failure                  a shipped graph, by name
  runtime run my.yaml --without adaptive --seed 3    an ablation
  runtime run my.yaml --set lqr.q='[1, 1, 1]'        another value
  runtime run my.yaml --wire lqr.error=error.state   another wire
"""


class _Parser(argparse.ArgumentParser):
    """Ends with exit code 2 and one line that says how to go on."""

    def error(self, message: str) -> NoReturn:
        said = f"{self.prog}: {message}; '{self.prog} --help' shows the usage\n"
        self.exit(2, printable(said))


def make_parser() -> argparse.ArgumentParser:
    """The whole command line."""
    parser = _Parser(
        prog="runtime",
        description="Simulate control diagrams that are written as YAML.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    for name in NAMES:
        module = command(name)
        module.add(commands.add_parser(name, help=module.HELP))
    return parser


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line and leave with its exit code."""
    _open_streams()
    sys.exit(_flushed(run(arguments)))


class _Messages(io.TextIOWrapper):
    """stderr, where a message that cannot be written ends nothing: a full disk, a terminal gone."""

    def write(self, text: str) -> int:
        with suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            super().flush()


def _open_streams() -> None:
    """Make stdout and stderr take any text, and be there at all.

    A closed stream gives its number to the next file that is opened, which then gets the messages:
    so it is opened to nowhere. What a terminal's encoding does not have is written as an escape.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
            if nowhere != number:
                os.dup2(nowhere, number)
                os.close(nowhere)
            setattr(sys, name, os.fdopen(number, "r" if number == 0 else "w", encoding="utf-8"))
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")
    if isinstance(sys.stderr, io.TextIOWrapper):
        # Detached, since a wrapper that nobody holds any more closes its buffer.
        encoding = sys.stderr.encoding
        sys.stderr = _Messages(
            sys.stderr.detach(), encoding, "backslashreplace", line_buffering=True
        )


def _flushed(code: int) -> int:
    """The exit code, once all is written; 2 where results could not be, for want of room."""
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of our output is gone (as in '| head'): nothing is left to say to it.
        _to_nowhere(sys.stdout)
    except OSError as error:
        _to_nowhere(sys.stdout)
        code = code or _told(f"cannot write to stdout: {error.strerror}", UsageError.exit_code)
    return code


def _to_nowhere(stream: TextIO) -> None:
    """Let what is left in a stream's buffer go nowhere, instead of failing again at the end."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, stream.fileno())
    os.close(nowhere)


def _told(text: str, code: int) -> int:
    """Say what ends a command; returns its exit code."""
    tell(text)
    return code


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    parser = make_parser()
    options = parser.parse_args(arguments)
    if options.version:
        from runtime.simulate import versions

        show(f"spikeblocks {versions()['spikeblocks']}")
        return 0
    if options.command is None:
        parser.print_help()
        return 2
    try:
        code = command(options.command).run(options)
        sys.stdout.flush()
    except SpikeblocksError as error:
        return _told(str(error), error.exit_code)
    except KeyboardInterrupt:
        return _told("interrupted", 130)
    except BrokenPipeError:
        # The reader of our output is gone (as in '| head'): nothing is left to say to it.
        _to_nowhere(sys.stdout)
        return 0
    except (OSError, RecursionError) as error:
        return _told(_reason(error), UsageError.exit_code)
    return code


def _reason(error: OSError | RecursionError) -> str:
    """What the system refused, where a verb has no better words for it."""
    if isinstance(error, RecursionError):
        return "something in the input is nested too deep"
    named = f"'{error.filename}': " if error.filename else "cannot write to stdout: "
    return f"{named}{error.strerror or error}"
