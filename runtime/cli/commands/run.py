"""``runtime run``: simulate, record, draw the probes, print the metrics."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.cli.commands import add_output, show_folder
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.errors import SimulationError, UsageError, one_line
from runtime.terminal import number, show, show_json, table, tell

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from runtime.engine import Interrupts, Profile
    from runtime.graph import Graph
    from runtime.observation import PlotSpec
    from runtime.runs import Draft, Result

HELP = "simulate, record, draw the probes, print the metrics"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    add_output(parser, "runs", "run folders")
    parser.add_argument(
        "--vs",
        metavar="CHANGE=VALUE",
        help="also run with one more change, and draw both runs in the same pictures: "
        "without=adaptive, bypass=limit, replace=lqr=PID, with=conditions/lag, set=lqr.q=[1,1,1]",
    )
    parser.add_argument(
        "--figures", default="png", metavar="FORMATS", help="formats: pdf,svg,png (png)"
    )
    parser.add_argument(
        "--style",
        choices=("screen", "paper", "paper2"),
        default="screen",
        help="of the figures: paper is one column of an IEEE page (3.5 in), paper2 both (7.16 in)",
    )
    parser.add_argument("--profile", action="store_true", help="show the time per block")
    parser.add_argument("--animate", action="store_true", help="also write plots/animation.gif")


def run(options: Namespace) -> int:
    """Simulate, write the run folder and its pictures, print the metrics."""
    from runtime.engine import Interrupts, Profile, profile_text
    from runtime.runs import Draft, link_latest, new_folder

    graph = changed_graph(options.graph, options).check()
    formats = _formats(options.figures)
    other = None if options.vs is None else _other(graph, options.vs).check()
    if options.animate:
        _check_animation(graph)
    if options.profile and graph.network.engine in ("compiled", "checked"):
        raise UsageError("--profile measures each block, which needs --engine python")
    quiet = options.quiet or options.json
    profile = Profile() if options.profile else None
    draft = Draft(new_folder(Path(options.out), graph.title))
    if not quiet:
        _report_leftovers(draft.folder.parent)
    with Interrupts() as interrupts:
        result, failure = _simulated(graph, quiet, profile, draft)
        folder = _saved(result, draft)
    if folder == draft.folder:
        link_latest(folder)
    code = _exit_code(result, failure, interrupts, folder == draft.folder)
    pictures: list[Path] = []
    rival: Result | None = None
    if interrupts.leaves_time:
        try:
            if other is not None and failure is None:
                rival = _rival(other, quiet, Path(options.out))
            pictures = _pictures(result, folder, options, formats, rival)
        except KeyboardInterrupt:
            code = code or 130
    rows = profile.rows(result.manifest["ticks"], result.manifest["wall_s"]) if profile else []
    if options.json:
        compared = {} if rival is None else {"vs": {"change": options.vs, "metrics": rival.metrics}}
        show_json(_summary(result, folder) | compared | ({"profile": rows} if rows else {}))
    else:
        _print_result(result, folder, pictures, options, rival)
    if rows and not options.json:
        show(profile_text(rows))
    _report_failures(result, failure, folder)
    return code


def _simulated(
    graph: Graph, quiet: bool, profile: Profile | None, draft: Draft
) -> tuple[Result, SimulationError | None]:
    """The result, and the error that ended the run early, if any."""
    from runtime.engine import silent
    from runtime.runs import Result, simulate
    from runtime.terminal import Progress

    progress = Progress(graph.title, wanted=not quiet)
    note = silent if quiet else tell
    try:
        folder = draft.recordings
        prepared = graph.prepared(profiled=profile is not None)
        return simulate(prepared, progress, note, profile, folder), None
    except SimulationError as error:
        if not isinstance(error.result, Result):
            draft.close()
            raise
        return error.result, error
    except BaseException:
        draft.close()
        raise
    finally:
        progress.close()


def _saved(result: Result, draft: Draft) -> Path:
    """Write the run folder; if that fails, write it to another place with enough room."""
    from runtime.runs import save_elsewhere

    try:
        folder = draft.save(result)
    except UsageError as error:
        try:
            folder = save_elsewhere(result, draft.folder.name)
        except UsageError as other:
            text = f"{error}; {other}"
            if draft.recordings.is_dir():
                text += f"; the recording is left in '{draft.partial}': free some space, then "
                text += "'runtime clean --recover' makes a run from it"
            else:
                draft.close()
            raise UsageError(text) from None
        tell(f"{error}; the run is kept in '{folder}'")
    draft.close()
    return folder


def _exit_code(
    result: Result, failure: SimulationError | None, interrupts: Interrupts, in_place: bool
) -> int:
    """The exit code: of a failure, else of a signal, else of a folder that was not writable."""
    if failure is not None:
        return failure.exit_code
    if interrupts.caught is not None or result.status == "interrupted":
        return interrupts.exit_code
    if not in_place:
        return UsageError.exit_code
    return 1 if result.failures else 0


def _report_failures(result: Result, failure: SimulationError | None, folder: Path) -> None:
    """Report failures, and where the recording is."""
    for text in ([str(failure)] if failure else []) + result.failures:
        tell(text)
    if failure is not None:
        tell(f"what was recorded before is kept in {folder}")
    elif result.status == "interrupted":
        tell(f"interrupted; what was recorded before is kept in {folder}")


def _report_leftovers(folder: Path) -> None:
    """Report what killed runs of the same graph left behind."""
    from runtime.runs import leftovers

    found = leftovers(folder)
    if found:
        text = f"killed runs left {len(found)} hidden folder{'s' * (len(found) > 1)} in '{folder}'"
        tell(f"{text}, as '{found[0].path.name}'; 'runtime clean {folder}' lists them")


def _check_animation(graph: Graph) -> None:
    """Raise an error before the run if the graph cannot be animated."""
    from runtime.plots import animated

    animated(graph.observation.plots, graph.network.world)


def _formats(text: str) -> list[str]:
    """The formats of figures.

    Raises
    ------
    UsageError : one of them is unknown.
    """
    known = ("pdf", "svg", "png")
    names = [name.strip() for name in text.split(",") if name.strip()]
    wrong = [name for name in names if name not in known]
    if wrong or not names:
        got = wrong[0] if wrong else text
        raise UsageError(f"--figures {text}: expected some of {', '.join(known)}, got '{got}'")
    return list(dict.fromkeys(names))


def _other(graph: Graph, change: str) -> Graph:
    """The graph that ``--vs`` compares with.

    Raises
    ------
    UsageError : it is no change.
    """
    from runtime.cli.commands.changes import apply

    kind, equals, text = change.partition("=")
    kinds = ("without", "bypass", "replace", "with", "set", "wire")
    if kind not in kinds or not equals:
        known = ", ".join(kinds)
        raise UsageError(f"--vs {change}: expected CHANGE=VALUE with one of {known}")
    return apply(graph, kind, text)


def _rival(graph: Graph, quiet: bool, out: Path) -> Result:
    """The result of the graph that is compared with, its folder written."""
    from runtime.runs import Draft, new_folder

    draft = Draft(new_folder(out, graph.title))
    result, failure = _simulated(graph, quiet, None, draft)
    _saved(result, draft)
    if failure is not None:
        tell(f"the run that is compared with failed: {failure}")
    return result


def _names(change: str) -> tuple[str, str]:
    """Short names of two runs that differ in one change: 'with snn', 'without snn'."""
    kind, _, text = change.partition("=")
    return (f"with {text}" if kind == "without" else "as written"), f"{kind} {text}"


def _pictures(
    result: Result,
    folder: Path,
    options: Namespace,
    formats: list[str],
    rival: Result | None,
) -> list[Path]:
    """Draw the requested pictures into a run's folder; returns the files.

    A picture that cannot be drawn becomes a note of the result.
    """
    from runtime.terminal import Progress

    files = []
    wanted = not (options.quiet or options.json)
    if not options.no_plots:
        from runtime.plots import save_plots

        made = None if rival is None else _comparing(result, rival, folder, options)
        drawing = Progress("drawing", wanted=wanted)
        files += save_plots(
            *(result, folder / "plots", result.notes.append, formats, options.style, made, drawing)
        )
        drawing.close()
    if options.animate:
        from runtime.plots import animate

        try:
            filming = Progress("filming", wanted=wanted)
            files.append(animate(result, folder / "plots" / "animation.gif", filming))
            filming.close()
        except Exception as error:  # noqa: BLE001 -- matplotlib may raise any exception for unusual numbers
            result.notes.append(f"no animation: {one_line(str(error) or type(error).__name__)}")
    return files


def _comparing(
    result: Result, rival: Result, folder: Path, options: Namespace
) -> Callable[[PlotSpec], Figure]:
    """A function that draws a plot with both runs in it."""
    from runtime.compare import Run
    from runtime.compare.overlay import versus

    named = zip(_names(options.vs), (result, rival), strict=True)
    runs = [Run(label, folder, each, {}) for label, each in named]
    return lambda plot: versus(runs, plot, options.style)


def _summary(result: Result, folder: Path) -> dict[str, Any]:
    manifest = result.manifest
    return {
        "schema_version": manifest["schema_version"],
        "run": str(folder),
        **{
            key: manifest[key]
            for key in ("status", "error", "graph", "seed", "dt", "until", "ticks", "engine")
        },
        "metrics": result.metrics,
        "wall_s": manifest["wall_s"],
        "ready_s": manifest["ready_s"],
        "us_per_tick": manifest["us_per_tick"],
        "failures": result.failures,
        "notes": result.notes,
    }


def _print_result(
    result: Result, folder: Path, pictures: list[Path], options: Namespace, rival: Result | None
) -> None:
    manifest = result.manifest
    if not options.quiet:
        for note in result.notes:
            tell(f"note: {note}")
    simulated = manifest["ticks"] * manifest["dt"]
    show(
        f"{result.title}: {simulated:g} s in {manifest['wall_s']:.2f} s "
        f"({manifest['us_per_tick']:.1f} us a tick, {manifest['engine']} engine), "
        f"seed {manifest['seed']}"
    )
    if result.metrics and rival is not None:
        other = rival.metrics
        rows = [
            (name, number(value), number(other.get(name)), result.units.get(name, ""))
            for name, value in result.metrics.items()
        ]
        show(table([("", *_names(options.vs)), *rows], right={1, 2}))
    elif result.metrics:
        values = {name: number(value) for name, value in result.metrics.items()}
        units = result.units
        show(table([(name, f"{v} {units.get(name, '')}".rstrip()) for name, v in values.items()]))
    show_folder("run", folder, pictures)
