"""``runtime check``: check the blocks of a Python file against the rules, and say what compiles."""

from __future__ import annotations

import warnings
from argparse import ArgumentParser, Namespace
from typing import TYPE_CHECKING, Any

from runtime.arguments import add_json
from runtime.errors import UsageError, raised_text
from runtime.terminal import show, show_json

if TYPE_CHECKING:
    from blocks.core import Block

HELP = "check the blocks of a Python file, and say what compiles"
EXAMPLES = """
runtime check my.py
runtime check my.py Backlash --set width=0.2
"""
COMPILES = "compiles; each compiled run compares it with its Python form on some ticks"
EXIT = {"fine": 0, "broken": 1, "not checked": 2}


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", help="a Python file that defines blocks")
    parser.add_argument("types", nargs="*", metavar="type", help="only these of its blocks")
    parser.add_argument(
        "--set",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="a parameter, for the blocks that have it, as in width=0.2",
    )
    add_json(parser)


def run(options: Namespace) -> int:
    """Check each block, and print what was found."""
    from blocks.core import hint
    from runtime.descriptions import own_blocks

    if options.file.endswith((".yaml", ".yml")):
        text = f"'{options.file}': expected a Python file; 'runtime validate' checks a graph"
        raise UsageError(text)
    known = own_blocks(options.file)
    for name in options.types:
        if name not in known:
            suggestion = hint(name, known) or f"; it defines {', '.join(known) or 'no blocks'}"
            raise UsageError(f"'{options.file}' has no block '{name}'{suggestion}")
    if not known:
        raise UsageError(f"'{options.file}' defines no blocks")
    values = _values(options.set)
    names = options.types or known
    wanted = {name for cls in known.values() for name in cls.spec.params}
    for name in values.keys() - wanted:
        raise UsageError(f"--set {name}: no block has this parameter{hint(name, wanted)}")
    found = {name: _checked(known[name], values) for name in names}
    if options.json:
        show_json({"schema_version": 1, "blocks": found})
    else:
        for name, facts in found.items():
            show("\n  ".join([f"{name}: {facts['status']}", *_lines(facts)]))
    return max(EXIT[facts["status"]] for facts in found.values())


def _values(texts: list[str]) -> dict[str, Any]:
    """The parameters that were given, by name."""
    from runtime.document import parse_yaml

    values = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals:
            raise UsageError(f"--set {text}: expected NAME=VALUE, as in width=0.2")
        values[name.strip()] = parse_yaml(value, f"--set {text}").plain()
    return values


def _checked(cls: type[Block], values: dict[str, Any]) -> dict[str, Any]:
    """What is wrong with a block, and which of its methods are called from Python, and why."""
    from blocks.core import ParameterError
    from runtime.checking import CheckError, NotCompiledWarning, NotCopiedWarning, check_block

    given = {name: value for name, value in values.items() if name in cls.spec.params}
    facts: dict[str, Any] = {
        "status": "fine",
        "problems": [],
        "called_from_python": [],
        "not_copied": [],
    }
    with warnings.catch_warnings(record=True) as caught:
        for kind in (NotCompiledWarning, NotCopiedWarning):
            warnings.simplefilter("always", kind)
        try:
            check_block(cls(**given))
        except CheckError as error:
            return facts | {"status": "broken", "problems": [str(error)]}
        except ParameterError as error:
            problems = [f"{name}: {text}" for name, text in error.problems]
            return facts | {"status": "not checked", "problems": problems}
        except BaseException as error:  # noqa: BLE001 -- a user's block may raise anything
            return facts | {"status": "broken", "problems": [raised_text(error)]}
    refused = [each for each in caught if issubclass(each.category, NotCompiledWarning)]
    facts["called_from_python"] = [str(each.message) for each in refused]
    kept = [each for each in caught if issubclass(each.category, NotCopiedWarning)]
    facts["not_copied"] = [str(each.message) for each in kept]
    return facts


def _lines(facts: dict[str, Any]) -> list[str]:
    if facts["status"] == "not checked":
        return [*facts["problems"], "give parameters as in --set width=0.2"]
    if facts["problems"]:
        return list(facts["problems"])
    refused, kept = facts["called_from_python"], facts["not_copied"]
    found = ["called from Python by the compiled engine:", *refused] if refused else [COMPILES]
    return [*found, *kept]
