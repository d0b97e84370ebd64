"""``runtime import``: a model of another program as a graph."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path

from runtime.arguments import add_json, add_no_modules, at_least, integer
from runtime.errors import MissingExtraError, UsageError
from runtime.terminal import show, show_json, tell

HELP = "write a model of Nengo as a graph with the same neurons"
GROUP = "export and import"
EXAMPLES = """
runtime import nengo model.py -o my.yaml
runtime import nengo model.py:network -o my.yaml --compare
runtime import nengo model.py -o my.yaml --redraw
"""
SUFFIX = ".yaml"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    parser.add_argument("program", choices=("nengo",), help="the program that the model is of")
    parser.add_argument(
        "model", help="its Python file, which is executed: model.py or model.py:NAME"
    )
    parser.add_argument("-o", "--out", metavar="FILE", help="the graph (NAME.yaml)")
    parser.add_argument("--redraw", action="store_true", help="leave out what Nengo drew")
    parser.add_argument(
        "--dt", type=at_least(1e-9), default=0.001, metavar="S", help="step (0.001)"
    )
    parser.add_argument(
        "--until", type=at_least(1e-9), default=1.0, metavar="S", help="length of a run (1)"
    )
    parser.add_argument(
        "--seed", type=integer(0, 2**31 - 1), metavar="N", help="seed of the simulator"
    )
    parser.add_argument(
        "--compare",
        action="store_true",
        help="run both, compare spikes and probes; exit code 1 if they differ",
    )
    add_no_modules(parser)
    add_json(parser)


def run(options: Namespace) -> int:
    """Write the files and print a summary."""
    if options.no_modules:
        message = "is executed, as Python would, which is refused (--no-modules)"
        raise UsageError(f"'{options.model}' {message}")
    try:
        import nengo  # noqa: F401
    except ImportError:
        raise MissingExtraError("importing a model of Nengo", "nengo") from None
    from spikeblocks.nengo.importing import import_file, is_equal
    from spikeblocks.nengo.reading import functions_of

    source = Path(options.model.partition(":")[0] if ":" in options.model else options.model)
    path = Path(options.out) if options.out else Path(source.stem + SUFFIX)
    if path.suffix != SUFFIX:
        raise UsageError(f"-o: expected a file that ends in {SUFFIX}, got '{path}'")
    if source.is_file():  # else reading it says what is missing
        tell(f"executing '{source}', as Python would")
    with functions_of(options.model):
        done = import_file(
            options.model,
            path,
            dt=options.dt,
            until=options.until,
            seed=options.seed,
            redraw=options.redraw,
        )
        compared = done.compare() if options.compare else None
    if options.json:
        facts = {"files": [str(p) for p in done.files], "blocks": done.blocks, "notes": done.notes}
        show_json(facts | ({} if compared is None else {"compared": compared}))
    else:
        show(done.summary())
        for name, line in (compared or {}).items():
            show(f"  {name}: {line}")
    return 0 if all(map(is_equal, (compared or {}).values())) else 1
