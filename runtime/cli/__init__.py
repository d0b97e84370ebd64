"""The command line: ``runtime run graph.yaml`` and the other verbs. Exit codes:
0 success; 1 an expectation failed; 2 usage or an invalid graph; 3 the simulation failed (what was
recorded is kept); 4 an optional extra is missing; 130, 143, 129 interrupted by Ctrl-C, SIGTERM,
SIGHUP. Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import argparse
import atexit
import io
import os
import signal
import sys
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from sysconfig import get_paths
from textwrap import indent
from types import FrameType
from typing import NoReturn, TextIO

from blocks.library.extensions import BrokenPackageError
from runtime.cli.commands import VERBS, Verb, groups_of
from runtime.cli.parser import Parser, examples
from runtime.cli.problems import report
from runtime.errors import (
    ROOT,
    GraphError,
    SpikeblocksError,
    UsageError,
    one_line,
    raised_text,
    text_of,
)
from runtime.terminal import show, show_json, tell

ABOUT = "Simulate control diagrams written in YAML."
EXAMPLES = """
runtime run starters/adaptive --vs without=adaptive  with neurons, and without
runtime new my.yaml                                  a graph of your own
runtime graphs                                       what the package has
runtime blocks                                       the library of blocks
"""
BEGIN = f"""{ABOUT} Begin with one of these:
{indent(EXAMPLES, "  ").rstrip()}

'runtime --help' lists the other commands, and 'runtime COMMAND --help' explains one.
"""


def make_parser(verbs: Mapping[str, Verb] | None = None) -> argparse.ArgumentParser:
    """The command line with these verbs; by default with all, those of packages included."""
    parser = Parser(prog="runtime", description=ABOUT, epilog=examples(EXAMPLES))
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)

    if verbs is None:
        verbs = _usable()
        parser.verb_groups = groups_of(verbs)
    for name, verb in verbs.items():
        told = str(verb.HELP).replace("%", "%%")
        about = f"{told[:1].upper()}{told[1:].rstrip('.')}.\n\n{getattr(verb, 'ABOUT', '').strip()}"
        shown = examples(getattr(verb, "EXAMPLES", ""))
        verb.add(commands.add_parser(name, help=told, description=about.strip(), epilog=shown))
    return parser


def _usable() -> dict[str, Verb]:
    """All verbs; one that cannot be used is a note, and the others go on."""
    verbs = {}
    for name in VERBS.names():
        try:
            verbs[name] = _tried(name)
        except BrokenPackageError as error:
            tell(f"note: {error}")
    return verbs


def _tried(name: str) -> Verb:
    """A verb whose options can be declared.

    Raises
    ------
    BrokenPackageError : the package that offers it is broken.
    """
    verb = VERBS[name]
    if name not in VERBS.lazy:
        try:
            verb.add(argparse.ArgumentParser())
        except BaseException as error:
            raise BrokenPackageError(_blamed(name, error)) from error
    return verb


def _blamed(verb: str, error: BaseException) -> str:
    """What a package's verb did wrong: the package, the error, and where it was raised."""
    return f"{VERBS.offers()[verb]}: {one_line(raised_text(error))}"


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line, and exit with its exit code."""
    _open_streams()
    warnings.showwarning = _warn
    interrupted = False

    def interrupt(number: int, frame: FrameType | None) -> None:
        nonlocal interrupted
        interrupted = True
        signal.default_int_handler(number, frame)

    # Ignored signals, as of a job in the background of a script, stay ignored.
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, interrupt)
    try:
        code = run(arguments)
    except (Exception, KeyboardInterrupt):
        # Not only KeyboardInterrupt: where a module in C is being imported, it becomes an
        # ImportError without a cause (NumPy's "PyCapsule_Import could not import module").
        if not interrupted:
            raise
        code = _report("interrupted", 130)
    if interrupted:
        # Nothing is left to interrupt; a second Ctrl-C would end the exit with a traceback.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    # The work is done: a Ctrl-C while Python ends would make the exit code that of the signal. It
    # waits for threads before, which may be of own modules, and can be interrupted there.
    atexit.register(signal.signal, signal.SIGINT, signal.SIG_IGN)
    sys.exit(_flushed(code))


class _Messages(io.TextIOWrapper):
    """stderr that ignores write errors, such as a full disk or a closed terminal."""

    def write(self, text: str) -> int:
        with suppress(OSError):
            super().write(text)
        return len(text)

    def flush(self) -> None:
        with suppress(OSError):
            super().flush()


def _open_streams() -> None:
    """Make stdout and stderr accept any text, and open them if they are closed.

    The next file that is opened would get the number of a closed stream, and with it the messages:
    so that stream is opened on /dev/null. Characters that an encoding lacks become escapes.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            devnull = os.open(os.devnull, os.O_RDONLY if number == 0 else os.O_WRONLY)
            if devnull != number:
                os.dup2(devnull, number)
                os.close(devnull)
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
    """The exit code after flushing stdout; 2 if results could not be written."""
    if sys.stdout.closed:  # by own code; what was to be written then is an error already
        return code
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        # The reader of our output has closed it (as in '| head'): no more is written.
        _discard(sys.stdout)
    except OSError as error:
        _discard(sys.stdout)
        code = code or _report(f"cannot write to stdout: {error.strerror}", UsageError.exit_code)
    return code


def _discard(stream: TextIO) -> None:
    """Discard the rest of a stream's buffer, which would fail again at exit."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, stream.fileno())
    os.close(devnull)


def _report(text: str, code: int) -> int:
    """Print the error that ends a command; returns its exit code."""
    tell(text)
    return code


def run(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit code."""
    words = sys.argv[1:] if arguments is None else arguments
    # The other verbs' options would take longer than many a verb does.
    alone = bool(words) and (words[0] in VERBS.lazy or words[0] in VERBS.names())
    try:
        parser = make_parser({words[0]: _tried(words[0])} if alone else None)
    except BrokenPackageError as error:
        return _report(str(error), UsageError.exit_code)
    options = parser.parse_args(words)
    if options.version:
        from runtime.runs import versions

        show(f"spikeblocks {versions()['spikeblocks']}")
        return 0
    if options.command is None:
        show(BEGIN.rstrip())
        return 2
    try:
        code = _done(options)
        sys.stdout.flush()
    except SpikeblocksError as error:
        report(error)
        return error.exit_code
    except KeyboardInterrupt:
        return _report("interrupted", 130)
    except BrokenPipeError:
        # The reader of our output has closed it (as in '| head'): no more is written.
        _discard(sys.stdout)
        return 0
    except MemoryError:
        return _report("there is not enough memory", UsageError.exit_code)
    except (OSError, RecursionError) as error:
        return _report(_reason(error), UsageError.exit_code)
    return code


def _warn(
    message: Warning | str,
    category: type[Warning],
    filename: str,
    lineno: int,
    file: TextIO | None = None,
    line: str | None = None,
) -> None:
    """Show a warning in one line, with control characters escaped; those of NumPy are not shown.

    NumPy warns of a result that is not finite, which the engine reports where it matters.
    """
    text = text_of(message) if isinstance(message, Warning) else message
    others = [get_paths()[key] for key in ("stdlib", "purelib", "platlib")]
    inside = (*others, *(ROOT / package for package in ("blocks", "runtime", "spikeblocks")))
    is_own = not filename.startswith(tuple(f"{folder}{os.sep}" for folder in inside))
    place = f"{filename}:{lineno}: " if is_own else ""
    if place or not issubclass(category, RuntimeWarning):
        tell(f"{place}{category.__name__}: {one_line(text)}")


def _done(options: argparse.Namespace) -> int:
    """Run the chosen verb; what one of a package raises is no traceback, but names the package."""
    name = str(options.command)
    try:
        return VERBS[name].run(options)
    except GraphError as error:
        report(error)
        if getattr(options, "json", False):
            problems = [problem.plain() for problem in error.problems]
            show_json({"schema_version": 1, "problems": problems})
        return error.exit_code
    except (SpikeblocksError, OSError, RecursionError):
        raise
    except Exception as error:
        if name in VERBS.lazy:
            raise
        raise UsageError(_blamed(name, error)) from error


def _reason(error: OSError | RecursionError) -> str:
    """The message for an error that the verb did not handle itself."""
    if isinstance(error, RecursionError):
        return "the input is nested too deeply"
    named = f"'{error.filename}': " if error.filename else "cannot write to stdout: "
    return f"{named}{error.strerror or error}"
