"""The command line: ``runtime run graph.yaml`` and the other verbs. Exit codes:
0 success; 1 an expectation failed; 2 usage or an invalid graph; 3 the simulation failed (what was
recorded is kept); 4 an optional extra is missing; 130, 143, 129 interrupted by Ctrl-C, SIGTERM,
SIGHUP. Results go to stdout, everything else to stderr.
"""

from __future__ import annotations

import argparse
import io
import os
import re
import signal
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from types import FrameType
from typing import NoReturn, TextIO

from blocks.extensions import BrokenPackageError
from runtime.cli.commands import VERBS, Verb
from runtime.cli.problems import report
from runtime.errors import SpikeblocksError, UsageError, one_line, raised_at
from runtime.terminal import printable, show, tell

EPILOG = """examples:
  runtime run line_actuator_failure                  a shipped graph, by name
  runtime run my.yaml --without adaptive --seed 3    remove a block
  runtime run my.yaml --set lqr.q='[1, 1, 1]'        change a value
  runtime run my.yaml --wire lqr.error=error.state   change a wire
"""


class _Parser(argparse.ArgumentParser):
    """Reports a usage error in one line, with exit code 2."""

    def error(self, message: str) -> NoReturn:
        kinds = {"float": "a number", "int": "an integer"}
        if wrong := re.fullmatch(r"(argument .*: )invalid (float|int) value: ('.*')", message):
            message = f"{wrong[1]}expected {kinds[wrong[2]]}, got {wrong[3]}"
        message = f"{self.prog}: {message}{self._suggestion(message)}"
        self.exit(2, printable(f"{message}; '{self.prog} --help' shows the usage\n"))

    def _suggestion(self, message: str) -> str:
        """The verb or option that a misspelt one is close to."""
        from blocks.core import hint

        choice = re.search(r"invalid choice: '([^']*)' \(choose from (.*)\)", message)
        if choice is not None:
            close = hint(choice[1], re.findall(r"[\w-]+", choice[2]))
            is_graph = "argument COMMAND" in message and (choice[1].endswith((".yaml", ".yml")))
            return f", did you mean 'runtime run {choice[1]}'?" if is_graph else close
        option = re.match(r"unrecognized arguments: (--[\w-]+)", message)
        if option is None:
            return ""
        return hint(option[1], self._option_string_actions)

    def _joined(self, words: Sequence[str], left: str) -> str:
        """How an option is written that was followed by a word which it does not take."""
        at = words.index(left) if left in words else 0
        if at and words[at - 1] == "--resume":
            return "; --resume takes no folder: it continues the one of --out DIR and --name NAME"
        action = self._option_string_actions.get(words[at - 2]) if at > 1 else None
        if action is None or "=" not in str(action.metavar) or "=" in words[at - 1]:
            return ""
        return f"; write {words[at - 2]} {words[at - 1]}={left}"

    def parse_known_args(self, args=None, namespace=None):  # type: ignore[no-untyped-def]
        """As in argparse; what a verb does not know is an error of the verb."""
        words = list(sys.argv[1:] if args is None else args)
        found, rest = super().parse_known_args(args, namespace)
        if rest and " " in self.prog:
            self.error(f"unrecognized arguments: {' '.join(rest)}{self._joined(words, rest[0])}")
        return found, rest


def make_parser(verbs: Mapping[str, Verb] | None = None) -> argparse.ArgumentParser:
    """The command line with these verbs; by default with all, those of packages included."""
    parser = _Parser(
        prog="runtime",
        description="Simulate control diagrams written in YAML.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND", parser_class=_Parser)

    for name, verb in (_usable() if verbs is None else verbs).items():
        verb.add(commands.add_parser(name, help=str(verb.HELP).replace("%", "%%")))
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
        except Exception as error:
            raise BrokenPackageError(_blamed(name, error)) from error
    return verb


def _blamed(verb: str, error: Exception) -> str:
    """What a package's verb did wrong: the package, the error, and where it was raised."""
    where = raised_at(error)
    text = one_line(f"{type(error).__name__}: {error}") + (f" ({where})" if where else "")
    return f"{VERBS.offers()[verb]}: {text}"


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command line, and exit with its exit code."""
    _open_streams()
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
        parser.print_help()
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
    except (OSError, RecursionError) as error:
        return _report(_reason(error), UsageError.exit_code)
    return code


def _done(options: argparse.Namespace) -> int:
    """Run the chosen verb; what one of a package raises is no traceback, but names the package."""
    name = str(options.command)
    try:
        return VERBS[name].run(options)
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
