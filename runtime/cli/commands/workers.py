"""What ``sweep``, ``ablate`` and ``tune`` share: their options, and the request made of them.

In: options as argparse read them. Out: the experiment that they ask for, and how to run it::

    --vary a=1..2:3 --name x --resume  ->  a Request of vary and name, added to the file;
                                           RunOptions(folder=sweeps/x, resume=True)
"""

from __future__ import annotations

from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import Once, add_output, at_least, integer, rare, show_folder
from runtime.arguments import seconds as clock
from runtime.cli.commands.changes import add_changes, changed
from runtime.errors import UsageError
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.experiments.design import Experiment, Named
    from runtime.experiments.execution import Note, Outcome, RunOptions
    from runtime.terminal import Progress

MAX_JOBS = 4096
AGAIN = ("lost", "failed", "invalid", "timeout")


def add_experiment(
    parser: ArgumentParser, kind: str, folder: str, seeds: str, variants: bool = False
) -> None:
    """Declare the options that the three verbs share.

    Parameters
    ----------
    kind : what the verb runs, such as ``sweep``.
    folder : for experiments of this kind.
    seeds : the default seeds, for the help.
    variants : whether changes of the graph may begin variants.
    """
    parser.add_argument(
        "--name", help=f"the {kind}'s name: it is written to DIR/NAME (the graph's)"
    )
    parser.add_argument(
        "--resume", action="store_true", help=f"continue the {kind} in DIR/NAME, if it is there"
    )
    parser.add_argument("--seeds", metavar="SEEDS", help=f"0..9, 3, or 0,4,7..9 ({seeds})")
    rare(parser).add_argument(
        "--mixed",
        action="store_true",
        help="accept rows and workers of another version of the program: numbers may differ",
    )
    jobs = integer(1, MAX_JOBS)
    parser.add_argument(
        "-j", "--jobs", type=jobs, metavar="N", help="worker processes (one per processor)"
    )
    seconds = at_least(0.0, above=True)
    rare(parser).add_argument(
        "--timeout", type=seconds, metavar="S", help="time limit of a trial, seconds"
    )
    rare(parser).add_argument(
        "--checkpoint",
        action=Once,
        type=clock,
        metavar="TIME",
        help="store the state of each running trial, as every 60s: --resume goes on from there",
    )
    rare(parser).add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help="run the trials on a Dask cluster: tcp://host:8786",
    )
    add_output(parser, folder, folder)
    add_changes(parser, seed=False, variants=variants)


def add_again(parser: ArgumentParser) -> None:
    """Declare ``--again``, for experiments whose trials do not depend on each other."""
    rare(parser).add_argument(
        "--again",
        type=_statuses,
        metavar="STATUSES",
        default=("lost",),
        help="with --resume: run trials of these statuses again, as lost,failed,invalid (lost)",
    )


def _statuses(text: str) -> tuple[str, ...]:
    """The type of ``--again``."""
    from blocks.core import hint

    found = tuple(part.strip() for part in text.split(",") if part.strip())
    for status in found:
        if status not in AGAIN:
            raise ArgumentTypeError(
                f"expected some of {', '.join(AGAIN)}, got '{status}'{hint(status, AGAIN)}"
            )
    return found


def add_factors(parser: ArgumentParser) -> None:
    """Declare ``--vary`` and the seed of what is sampled."""
    parser.add_argument(
        "--vary",
        action="append",
        metavar="PATH=VALUES",
        default=[],
        help="a factor: lqr.q='[[1, 1, 1], [2, 2, 2]]', a=0.1..0.9:5, b='log(1e-5..1e-2):7', "
        "n='int(50..200):4'; without ':n' any value of the range; repeatable",
    )
    parser.add_argument("--sampling-seed", type=int, metavar="K", help="seed of the samples (0)")


def start_early(options: Namespace) -> None:
    """Start a fork server, so that it imports while the graph is read and checked."""
    if options.scheduler is None:
        from runtime.experiments.processes import choice

        choice.start_early()


def experiment_of(options: Namespace, variants: Named = ()) -> Experiment:
    """The experiment of a file or graph with all that the command line adds to it."""
    from runtime.experiments.design import ENTRY_KEYS, ON_COMMAND_LINE, Request, read_experiment

    experiment = read_experiment(
        options.graph, lambda graph: changed(graph, options), modules=not options.no_modules
    )
    written = vars(options)
    vary = []
    for text in written.get("vary", ()):
        path, equals, values = text.partition("=")
        if not equals:
            raise UsageError(f"--vary {text}: expected PATH=VALUES")
        vary.append((path.strip(), values))
    # --figures are the formats of pictures.
    entries = {key: written.get(key) for key in ENTRY_KEYS if key not in ("vary", "figures")}
    request = Request.of(
        entries, vary=vary, name=options.name, variants=variants, option=ON_COMMAND_LINE
    )
    return request.apply_to(experiment)


def run_options(options: Namespace, name: str) -> RunOptions:
    """How the experiment of this name is run: in which folder, by which workers."""
    from runtime.experiments.design import ON_COMMAND_LINE
    from runtime.experiments.execution import LOST, RunOptions

    return RunOptions(
        folder=Path(options.out) / name,
        resume=options.resume,
        jobs=options.jobs,
        scheduler=options.scheduler,
        keep=getattr(options, "keep", "none"),
        timeout=options.timeout,
        checkpoint=options.checkpoint,
        mixed=options.mixed,
        again=getattr(options, "again", (LOST,)),
        option=ON_COMMAND_LINE,
        note=note_of(options),
    )


def note_of(options: Namespace) -> Note:
    """Where notes go: to stderr, or nowhere."""
    from runtime.engine import silent

    return silent if options.quiet or options.json else tell


def progress_of(options: Namespace, name: str) -> Progress:
    """The progress bar, if one is wanted."""
    from runtime.terminal import Progress

    return Progress(name, wanted=not (options.quiet or options.json))


def conclude(options: Namespace, result: Outcome, *, figures: bool = True) -> int:
    """Draw and print what an experiment has given, or say that it was interrupted.

    Returns
    -------
    int : the exit code.
    """
    if result.is_interrupted:
        tell(f"interrupted{result.so_far}; --resume continues {result.folder}")
        return 130
    pictures: list[Path] = []
    if figures and not options.no_plots:
        from runtime.experiments.drawing import draw_figures

        pictures = draw_figures(result, options.style, options.figures)
    show_results(options, result.to_dict(), f"{result.text}\n", pictures)
    return result.exit_code


def show_results(
    options: Namespace, data: Mapping[str, Any], text: str, pictures: Sequence[Path] = ()
) -> None:
    """Print what an experiment has given: one JSON object, or text and what was written."""
    if options.json:
        show_json({**data, "plots": [str(path) for path in pictures]})
        return
    show(text)
    show_folder(data["kind"], Path(data["folder"]), pictures)
