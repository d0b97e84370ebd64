"""The parser of a command line: its usage errors, and its help.

In: a verb's description, options and examples. Out: help that begins with what the verb does and
ends with examples; the options that change a graph and the rare ones are named there, and explained
by ``--help-all``::

    rare options:
      --checkpoint, --profile: 'runtime run --help-all'
"""

from __future__ import annotations

import argparse
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NoReturn

from runtime.arguments import RARE
from runtime.terminal import printable

CHANGES = "changes to the graph"


def examples(text: str) -> str:
    """The end of a help text: a verb's commands, one a line."""
    return f"examples:\n{textwrap.indent(text.strip(), '  ')}" if text.strip() else ""


class _Help(argparse.RawDescriptionHelpFormatter):
    """Paragraphs as wide as the terminal; lines that are indented stay as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        room = {"initial_indent": indent, "subsequent_indent": indent, "break_on_hyphens": False}
        return "\n\n".join(
            textwrap.indent(each, indent)
            if "\n" in each and (indent or "\n  " in each)
            else textwrap.fill(each, width, **room)  # type: ignore[arg-type]
            for each in text.split("\n\n")
        )


class _HelpAll(argparse.Action):
    """``--help-all``: print the help with every option explained, and exit."""

    def __call__(self, parser, namespace, values, option_string=None):  # type: ignore[no-untyped-def]
        parser.explains = (CHANGES, RARE)
        parser.print_help()
        parser.exit()


class Parser(argparse.ArgumentParser):
    """Reports a usage error in one line, with exit code 2.

    verb_groups : titles of the groups of its verbs, and the names of the verbs in each.
    explains : of the two groups CHANGES and RARE, those whose options its help explains; it names
        those of the others.
    """

    explains: Sequence[str] = ()

    def __init__(self, **options: Any) -> None:
        super().__init__(**{"formatter_class": _Help, **options})
        self.verb_groups: Mapping[str, Sequence[str]] = {}
        if self.add_help:
            self.add_argument("--help-all", action=_HelpAll, nargs=0, help=argparse.SUPPRESS)

    def format_help(self) -> str:
        """The help text, which begins with what the verb does."""
        with self._brief():
            text = super().format_help()
        if not self.description:
            return text
        usage, about, rest = text.split("\n\n", 2)
        return f"{about}\n\n{usage}\n\n{rest}"

    def format_usage(self) -> str:
        """The usage alone."""
        with self._brief():
            return super().format_usage()

    @contextmanager
    def _brief(self) -> Iterator[None]:
        """While it is open, changes and rare options are a sentence each, which names them, and
        verbs stand in their groups."""
        actions, groups = self._actions, self._action_groups
        self._action_groups = [brief for each in groups for brief in self._brief_group(each)]
        hidden = [a for group in groups if self._names_only(group) for a in group._group_actions]
        self._actions = [action for action in actions if action not in hidden]
        try:
            yield
        finally:
            self._actions, self._action_groups = actions, groups

    def _brief_group(self, group: argparse._ArgumentGroup) -> list[argparse._ArgumentGroup]:
        """What the help shows for a group: itself, the names of its options, or groups of verbs."""
        if self._names_only(group):
            named = ", ".join(action.option_strings[0] for action in group._group_actions)
            where = "runtime help changes" if group.title == CHANGES else f"{self.prog} --help-all"
            return [argparse._ArgumentGroup(self, group.title, f"{named}: '{where}'")]
        if self.verb_groups and group is self._positionals:
            lines = {v.dest: f"{v.dest:<12} {str(v.help) % {}}" for v in self._verbs()}
            return [
                argparse._ArgumentGroup(self, title, "\n".join(lines[name] for name in names))
                for title, names in self.verb_groups.items()
            ]
        return [group]

    def _names_only(self, group: argparse._ArgumentGroup) -> bool:
        return group.title in (CHANGES, RARE) and group.title not in self.explains

    def _verbs(self) -> list[argparse.Action]:
        (verbs,) = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        return verbs._choices_actions

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
