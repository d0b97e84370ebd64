"""``runtime run``: simulate, record, draw the probes, print the metrics."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.arguments import Once, add_output, rare, seconds, show_folder
from runtime.cli.commands.changes import add_graph, changed_graph
from runtime.cli.commands.rivals import names, painter, rivals, run_rivals
from runtime.cli.commands.simulating import add_real_time, pacing_of, saved, simulated
from runtime.errors import SimulationError, UsageError, one_line
from runtime.terminal import number, show, show_json, table, tell

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from blocks.core import FloatArray
    from runtime.cli.commands.watching import Done
    from runtime.engine import Interrupts, Profile
    from runtime.graph import Graph
    from runtime.runs import Result

HELP = "simulate, record, draw the probes, print the metrics"
EXAMPLES = """
runtime run starters/adaptive --vs without=adaptive
runtime run my.yaml --set lqr.q='[1, 1, 1]' --seed 3
"""


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    add_output(parser, "runs", "run folders")
    parser.add_argument(
        "--vs",
        action=Once,
        metavar="CHANGE=VALUE",
        help="also run with one more change, and draw both runs in the same pictures: "
        "without=adaptive, bypass=limit, replace=lqr=PathPID, with=conditions/lag, "
        "set=lqr.q=[1,1,1]",
    )
    rare(parser).add_argument(
        "--labels", default="", metavar="A,B", help="names of both runs in the pictures of --vs"
    )
    parser.add_argument(
        "--watch",
        action="store_true",
        help="run again whenever the graph is saved, with the last run in the same pictures",
    )
    rare(parser).add_argument(
        "--checkpoint",
        action=Once,
        type=seconds,
        metavar="TIME",
        help="write the state of the run that often, as 60s or 5min of the clock: "
        "'runtime resume' goes on after whatever ended it",
    )
    add_real_time(parser)
    rare(parser).add_argument("--profile", action="store_true", help="show the time per block")
    parser.add_argument("--animate", action="store_true", help="also write plots/animation.gif")


def run(options: Namespace) -> int:
    """Simulate, write the run folder and its pictures, print the metrics."""
    if not options.watch:
        graph = changed_graph(options.graph, options).check()
        return finished(options, graph, None).code
    if options.json:
        raise UsageError("--watch prints one result after the other; --json prints one object")
    from runtime.cli.commands.watching import watch

    def once(before: Result | None) -> Done:
        return finished(options, changed_graph(options.graph, options).check(), before)

    return watch(options.graph, once)


def finished(
    options: Namespace,
    graph: Graph,
    before: Result | None,
    source: tuple[Path, Mapping[str, FloatArray]] | None = None,
) -> Done:
    """One run; ``before`` is one from before the graph was edited, which its figures show too.

    ``source`` is a checkpoint to go on from.
    """
    from runtime.cli.commands.watching import Done
    from runtime.engine import Interrupts, Profile
    from runtime.runs import Draft, link_latest, new_folder

    compared = rivals(graph, options.vs)
    _check_options(graph, options)
    pacing = pacing_of(options)
    profile = Profile() if options.profile else None
    quiet = options.quiet or options.json
    draft = Draft(new_folder(Path(options.out), graph.title))
    if not quiet:
        _report_leftovers(draft.folder.parent)
    with Interrupts() as interrupts:
        every = options.checkpoint or 0.0
        result, failure = simulated(graph, quiet, profile, draft, every, source, pacing)
        folder = saved(result, draft)
    if folder == draft.folder:
        link_latest(folder)
    code = _exit_code(result, failure, interrupts, folder == draft.folder)
    others, draws = {}, interrupts.leaves_time
    try:
        if draws and failure is None and (options.vs or not options.no_plots):
            others = run_rivals(compared, graph, quiet, Path(options.out))
    except KeyboardInterrupt:
        code, draws = code or 130, False
    if not options.json:
        # Before anything is drawn, which takes longer than many a run.
        _print_result(result, options, others, before)
    if not _shown(options, graph, result, folder, others, before, draws):
        code = code or 130
    rows = _profiled(profile, result.manifest) if profile else []
    if options.json:
        show_json(_summary(result, folder, options, others, rows))
    else:
        _show_profile(rows)
    _report_failures(result, failure, folder, compared)
    return Done(code, result, [Path(name) for name in graph.texts])


def _shown(
    options: Namespace,
    graph: Graph,
    result: Result,
    folder: Path,
    others: Mapping[str, Result],
    before: Result | None,
    draws: bool,
) -> bool:
    """Draw what is wanted and print where it is; False if that was interrupted."""
    earlier, pictures = len(result.notes), []
    done = True
    try:
        if draws:
            pictures = _pictures(result, folder, options, others, before)
            pictures += [_diagram(graph, folder)] if options.watch else []
    except KeyboardInterrupt:
        done = False
    if not options.json:
        _tell_notes(result.notes[earlier:], options)
        show_folder("run", folder, pictures)
    return done


def _import_matplotlib() -> None:
    """Import matplotlib without the tables of properties in its docstrings, a fifth of the time.

    Only in this process, which shows no help of matplotlib; as a library we leave it as it is.
    """
    if "matplotlib" not in sys.modules:
        import matplotlib.artist

        matplotlib.artist.kwdoc = lambda artist: ""


def _diagram(graph: Graph, folder: Path) -> Path:
    """Write the block diagram beside the plots."""
    from runtime.files import write_whole

    path = folder / "plots" / "diagram.svg"
    path.parent.mkdir(exist_ok=True)
    write_whole(path, graph.diagram("svg"))
    return path


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


def _report_failures(
    result: Result, failure: SimulationError | None, folder: Path, compared: Mapping[str, Graph]
) -> None:
    """Report failures, where the recording is, and which runs were left out for them."""
    for text in ([str(failure)] if failure else []) + result.failures:
        tell(text)
    if failure is not None:
        tell(f"what was recorded before is kept in {folder}")
        if compared:
            tell(f"the run with {' and '.join(compared)} was left out, since this one failed")
    elif result.status == "stopped":
        tell(f"stopped at t = {result.manifest['stopped_at']:g} {result.time_unit} (run.stop)")
    elif result.status == "interrupted":
        tell(f"interrupted; what was recorded before is kept in {folder}")


def _report_leftovers(folder: Path) -> None:
    """Report what killed runs of the same graph left behind."""
    from runtime.runs import leftovers

    found = leftovers(folder)
    if found:
        text = f"killed runs left {len(found)} hidden folder{'s' * (len(found) > 1)} in '{folder}'"
        tell(f"{text}, as '{found[0].path.name}'; 'runtime clean {folder}' lists them")


def _check_options(graph: Graph, options: Namespace) -> None:
    """Raise an error before the run if the graph does not allow an option."""
    if options.labels:
        names("", options.labels)
        if options.vs is None:
            raise UsageError(
                f"--labels {options.labels}: names the two runs of --vs, which is not given"
            )
    if options.animate:
        from runtime.plots import animated_plot

        animated_plot(graph.observation.plots, graph.network.world)
    if options.profile and graph.network.engine in ("compiled", "checked"):
        raise UsageError("--profile measures each block, which needs --engine python")


def _pictures(
    result: Result,
    folder: Path,
    options: Namespace,
    others: Mapping[str, Result],
    before: Result | None,
) -> list[Path]:
    """Draw the requested pictures into a run's folder; returns the files.

    A picture that cannot be drawn becomes a note of the result.
    """
    from runtime.terminal import Progress

    files = []
    wanted = not (options.quiet or options.json)
    drawn = painter(result, others, folder, options, before)
    if not options.no_plots:
        _import_matplotlib()
        from runtime.plots import save_plots

        drawing = Progress("drawing", wanted=wanted)
        files += save_plots(
            *(result, folder / "plots", result.notes.append, options.figures, options.style, drawn),
            progress=drawing,
            share=True,
        )
        drawing.close()
    if options.animate:
        from runtime.plots import animate

        try:
            filming = Progress("filming", wanted=wanted)
            both: dict[str, Result] = {}
            if options.vs in others:
                both = _labelled(options, result, others[options.vs])
            files.append(animate(result, folder / "plots" / "animation.gif", filming, both))
            filming.close()
        except Exception as error:  # noqa: BLE001 -- matplotlib may raise any exception for unusual numbers
            result.notes.append(f"no animation: {one_line(str(error) or type(error).__name__)}")
    return files


def _labelled(options: Namespace, result: Result, other: Result) -> dict[str, Result]:
    first, second = names(options.vs, options.labels)
    return {first: result, second: other}


def _profiled(profile: Profile, manifest: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of a profile; none of a run without a second tick."""
    later = manifest["ticks"] - 1
    return profile.rows(later, manifest["wall_s"] - manifest["ready_s"]) if later > 0 else []


def _show_profile(rows: list[dict[str, Any]]) -> None:
    from runtime.engine import profile_text

    if rows:
        show(profile_text(rows))


def _summary(
    result: Result,
    folder: Path,
    options: Namespace,
    others: Mapping[str, Result],
    rows: list[dict[str, Any]],
) -> dict[str, Any]:
    manifest = result.manifest
    more: dict[str, Any] = {"profile": rows} if rows else {}
    if "real_time" in manifest:
        more["real_time"] = manifest["real_time"]
    if options.vs in others:
        more["vs"] = {"change": options.vs, "metrics": others[options.vs].metrics}
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
        **more,
    }


def _tell_notes(notes: Sequence[str], options: Namespace) -> None:
    """Print notes, unless the user asked for quiet."""
    for note in () if options.quiet else notes:
        tell(f"note: {note}")


def _print_result(
    result: Result, options: Namespace, rivals: Mapping[str, Result], before: Result | None
) -> None:
    """Print notes and metrics, beside those of the rivals or of the run before an edit."""
    manifest = result.manifest
    others = {names(change, options.labels): other for change, other in rivals.items()}
    if not others and before is not None:
        others = {("now", "before"): before}
    _tell_notes(result.notes, options)
    simulated, per_tick = manifest["ticks"] * manifest["dt"], manifest["us_per_tick"]
    per_tick = "" if per_tick is None else f"{number(per_tick)} µs a tick, "
    show(
        f"{result.title}: {simulated:g} {result.time_unit} in {manifest['wall_s']:.2f} s "
        f"({per_tick}{manifest['engine']} engine), "
        f"seed {manifest['seed']}"
    )
    if "real_time" in manifest:
        from runtime.runs import pacing_text

        show(pacing_text(manifest["real_time"]))
    if result.metrics and others:
        own = next(iter(others))[0] if len(others) == 1 else "as written"
        head = ("", own, *(second for _, second in others))
        rows = [
            (
                name,
                *(each.metric_text(name) for each in (result, *others.values())),
                result.units.get(name, ""),
            )
            for name in result.metrics
        ]
        show(table([head, *rows], right=range(1, len(head))))
    elif result.metrics:
        units = {
            name: result.units.get(name, "") if v is not None else ""
            for name, v in result.metrics.items()
        }
        rows = [(k, f"{result.metric_text(k)} {units[k]}".rstrip()) for k in result.metrics]
        show(table(rows))
    sys.stdout.flush()  # a pipe or a file shows them before the pictures, too
