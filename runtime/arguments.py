"""What the arguments of several verbs share: options, types of values, names in registries.

parser.add_argument("--fps", type=integer(1, 240))
add_json(parser)
chosen(FORMATS, "svgg", "diagram format")       # no diagram format 'svgg', did you mean 'svg'?
"""

from __future__ import annotations

import math
from argparse import Action, ArgumentParser, ArgumentTypeError, Namespace, _ArgumentGroup
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

from runtime.errors import UsageError
from runtime.terminal import show

if TYPE_CHECKING:
    from blocks.library.extensions import Registry

T = TypeVar("T")
RARE = "rare options"


class Once(Action):
    """An option that may be given once; of two, argparse would keep the last without a word."""

    def __call__(
        self, parser: ArgumentParser, namespace: Namespace, value: object, option: str | None = None
    ) -> None:
        if getattr(namespace, self.dest) is not None:
            parser.error(f"{option} is given twice; it takes one value")
        setattr(namespace, self.dest, value)


def rare(parser: ArgumentParser) -> _ArgumentGroup:
    """The group of a verb's options that its help only names; ``--help-all`` explains them."""
    found = [group for group in parser._action_groups if group.title == RARE]
    return found[0] if found else parser.add_argument_group(RARE)


def add_no_modules(parser: ArgumentParser) -> None:
    """``--no-modules``: nothing that a graph names is executed."""
    rare(parser).add_argument(
        "--no-modules",
        action="store_true",
        help="execute nothing that the graph names: Python files, FMUs; what needs one is an error",
    )


def add_json(parser: ArgumentParser) -> None:
    """Declare ``--json``."""
    parser.add_argument("--json", action="store_true", help="print one JSON object, nothing else")


def add_output(parser: ArgumentParser, folder: str, of: str) -> None:
    """Declare the options of a verb that writes folders: where to, with pictures, and how much."""
    parser.add_argument("--out", default=folder, metavar="DIR", help=f"folder for {of} ({folder})")
    parser.add_argument(
        "--figures",
        type=_formats,
        default="png",
        metavar="FORMATS",
        help="formats of the figures: pdf,svg,png (%(default)s)",
    )
    add_style(parser)
    parser.add_argument("--no-plots", action="store_true", help="draw nothing")
    add_json(parser)
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress, no notes")


def add_style(parser: ArgumentParser) -> None:
    """Declare ``--style``."""
    parser.add_argument(
        "--style",
        choices=("screen", "paper", "paper2"),
        default="screen",
        help="of the figures: paper is one column of an IEEE page (3.5 in), paper2 both (7.16 in; "
        "%(default)s)",
    )


def _formats(text: str) -> list[str]:
    """The type of ``--figures``."""
    known = ("pdf", "svg", "png")
    names = [name.strip() for name in text.split(",") if name.strip()]
    wrong = [name for name in names if name not in known]
    if wrong or not names:
        got = wrong[0] if wrong else text
        raise ArgumentTypeError(f"expected some of {', '.join(known)}, got '{got}'")
    return list(dict.fromkeys(names))


def show_folder(kind: str, folder: Path, files: Iterable[Path]) -> None:
    """Print a folder that was written, and the pictures in it."""
    show(f"{kind} folder: {folder}")
    for path in files:
        show(f"  {path.relative_to(folder)}")


def at_least(low: float, *, above: bool = False) -> Callable[[str], float]:
    """The type of an option that is a finite number of at least ``low``, or above it."""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not low <= value < math.inf or (above and value == low):
            bound = f"above {low:g}" if above else f"of at least {low:g}"
            raise ArgumentTypeError(f"expected a number {bound}, got '{text}'")
        return value

    return read


def seconds(text: str) -> float:
    """The type of an option that is a time of the clock: ``60s``, ``5min``, ``0.5h`` or ``90``."""
    factors = {"ms": 1e-3, "min": 60.0, "s": 1.0, "h": 3600.0, "": 1.0}
    unit = next(unit for unit in factors if text.endswith(unit))
    try:
        value = float(text.removesuffix(unit)) * factors[unit]
    except ValueError:
        value = math.nan
    if not 0.0 < value < math.inf:
        raise ArgumentTypeError(f"expected a time above 0, such as 60s or 5min, got '{text}'")
    return value


def integer(low: int, high: int, *, even: bool = False) -> Callable[[str], int]:
    """The type of an option that is an integer between two bounds."""

    def read(text: str) -> int:
        value = int(text) if text.isdecimal() else -1
        if not low <= value <= high or (even and value % 2):
            kind = "an even number" if even else "an integer"
            raise ArgumentTypeError(f"expected {kind} from {low} to {high}, got '{text}'")
        return value

    return read


def chosen(registry: Registry[T], name: str, what: str) -> T:
    """The entry of a registry that an argument names; ``what`` says what it is.

    Raises
    ------
    UsageError : there is none, or the package that offers it is broken.
    """
    from blocks.core import hint
    from blocks.library.extensions import BrokenPackageError

    try:
        found = registry.find(name)
    except BrokenPackageError as error:
        raise UsageError(str(error)) from None
    if found is None:
        known = registry.names()
        suggestion = hint(name, known) or f"; expected {', '.join(known)}"
        raise UsageError(f"no {what} '{name}'{suggestion}")
    return found
