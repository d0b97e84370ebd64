"""``runtime new``: begin a graph with a copy of a commented one, or a package of own blocks."""

from __future__ import annotations

import re
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from runtime.errors import UsageError
from runtime.terminal import show, table

if TYPE_CHECKING:
    from runtime.cli.shipped import Shipped

HELP = "begin a graph with a commented starter, or a package of blocks"
EXAMPLES = """
runtime new my.yaml
runtime new my.yaml --from gallery/cart_pole_push
"""
DEFAULT = "adaptive"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("file", nargs="?", help="the graph to write, such as my.yaml")
    parser.add_argument(
        "--from",
        dest="start",
        metavar="NAME",
        default=DEFAULT,
        help=f"a starter, or a shipped graph ({DEFAULT}); without FILE, 'new' lists the starters",
    )
    parser.add_argument(
        "--package",
        metavar="NAME",
        help="write a package that can be installed, with a block, metric, plot, verb and test",
    )


def run(options: Namespace) -> int:
    """Write the graph, and the Python file of its own blocks; or list the starters."""
    from runtime.cli.shipped import RUNNABLE, schema_line, shipped

    if options.package is not None:
        return _package(options.package, options.file)
    starters = shipped("starters")
    if options.file is None:
        show(table([(each.name, each.summary) for each in starters], indent=""))
        show("\n'runtime new my.yaml --from NAME' writes one, or any of 'runtime graphs'")
        return 0
    target = Path(options.file)
    if target.suffix not in (".yaml", ".yml"):
        raise UsageError(f"'{target}': expected a file that ends with .yaml, as in my.yaml")
    source = _chosen(options.start, [each for each in shipped() if each.group in RUNNABLE])
    text = source.path.read_text(encoding="utf-8")
    # Its schema is not beside the copy.
    text = text.removeprefix(schema_line(text)).replace("my.yaml", target.name)
    # Parts are known by their names, too: parts/thalamus.yaml.
    text = re.sub(r"(\.\./)+(?=\w)", "", text)
    text = text.replace("my.py", f"{target.stem}.py")
    written = {target: text}
    # Its own blocks and its data are beside it, and will be beside the copy.
    for path in sorted(source.path.parent.glob("*")):
        if path.suffix in (".py", ".csv") and path.name in text:
            own = target.with_suffix(path.suffix)
            written = {**written, target: written[target].replace(path.name, own.name)}
            written[own] = path.read_text(encoding="utf-8")
    _write(written)
    for path in written:
        show(path)
    show(f"next: runtime run {target}")
    return 0


def _package(name: str, file: str | None) -> int:
    """Write a package into a folder of its name."""
    from runtime.cli.new_package import texts
    from runtime.runs import versions

    if file is not None:
        raise UsageError(f"--package writes a folder '{name}'; leave '{file}' out")
    version = ".".join(versions()["spikeblocks"].split(".")[:2])
    folder = Path(name)
    _write({folder / path: text for path, text in texts(name, version).items()}, folders=True)
    show(table([(str(folder / path), "") for path in texts(name, version)], indent=""))
    show(f"next: pip install -e '{name}[test]' && pytest {name} && runtime plugins")
    show("without a network: pip install --no-build-isolation -e ..., with setuptools 77 or newer")
    return 0


def _chosen(name: str, known: list[Shipped]) -> Shipped:
    from blocks.core import hint

    # A starter and a graph are also known by their short names, the first of a name.
    by_name = {each.name: each for each in reversed(known) if each.group in ("graphs", "starters")}
    by_name |= {f"{each.group}/{each.name}": each for each in known}
    if name not in by_name:
        suggestion = hint(name, by_name) or "; 'runtime graphs' lists what is shipped"
        raise UsageError(f"--from {name}: no such starter or graph{suggestion}")
    return by_name[name]


def _write(texts: dict[Path, str], folders: bool = False) -> None:
    """Write files that must not exist yet, all or none, perhaps with their folders.

    Raises
    ------
    UsageError : one of them exists, or cannot be written.
    """
    from runtime.files import system_errors, write_files

    for path in texts:
        if path.exists() or path.is_symlink():
            raise UsageError(f"'{path}' exists already; choose another name, or remove it")
    with system_errors():
        write_files(texts, folders)
