"""How a run is presented: notes, metrics, pictures, a profile, and what failed.

In: an Outcome of ``running`` and the options of ``runtime run``. Out: the exit code.
"""

from __future__ import annotations

import sys
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.messages import as_note
from runtime.arguments import show_folder
from runtime.cli.commands.running import names
from runtime.errors import one_line
from runtime.terminal import number, show, show_json, tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from runtime.cli.commands.running import Outcome
    from runtime.observation import PlotSpec
    from runtime.runs import Result


def present(outcome: Outcome, options: Namespace) -> int:
    """Print and draw what the options ask for; returns the exit code."""
    if not options.json:
        # Before anything is drawn, which takes longer than many a run.
        _print_result(outcome, options)
    code = outcome.code
    if not _draw(outcome, options):
        code = code or 130
    if options.json:
        show_json(_summary(outcome, options))
    elif outcome.profile:
        from runtime.engine import profile_text

        show(profile_text(outcome.profile))
    _report_failures(outcome)
    return code


def _draw(outcome: Outcome, options: Namespace) -> bool:
    """Draw what is wanted and print where it is; False if that was interrupted."""
    result, folder = outcome.result, outcome.folder
    earlier, pictures = len(result.notes), []
    done = True
    try:
        if outcome.draws:
            pictures = _pictures(outcome, options)
            pictures += [_diagram(outcome)] if options.watch else []
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


def _diagram(outcome: Outcome) -> Path:
    """Write the block diagram beside the plots."""
    from runtime.files import write_whole

    path = outcome.folder / "plots" / "diagram.svg"
    path.parent.mkdir(exist_ok=True)
    write_whole(path, outcome.graph.diagram("svg"))
    return path


def _report_failures(outcome: Outcome) -> None:
    """Report failures, where the recording is, and which runs were left out for them."""
    result, failure, folder = outcome.result, outcome.failure, outcome.folder
    for text in ([str(failure)] if failure else []) + result.failures:
        tell(text)
    if failure is not None:
        tell(f"what was recorded before is kept in {folder}")
        if outcome.compared:
            tell(
                f"the run with {' and '.join(outcome.compared)} was left out, since this one failed"
            )
    elif result.status == "stopped":
        tell(f"stopped at t = {result.manifest['stopped_at']:g} {result.time_unit} (run.stop)")
    elif result.status == "interrupted":
        tell(f"interrupted; what was recorded before is kept in {folder}")


def _pictures(outcome: Outcome, options: Namespace) -> list[Path]:
    """Draw the requested pictures into a run's folder; returns the files.

    A picture that cannot be drawn becomes a note of the result.
    """
    from runtime.terminal import Progress

    files = []
    result, others = outcome.result, outcome.others
    plots = outcome.folder / "plots"
    wanted = not (options.quiet or options.json)
    if not options.no_plots:
        _import_matplotlib()
        from runtime.plots import save_plots

        drawing = Progress("drawing", wanted=wanted)
        files += save_plots(
            result,
            plots,
            note=result.notes.append,
            formats=options.figures,
            look=options.style,
            draw_plot=painter(result, others, outcome.folder, options, outcome.before),
            progress=drawing,
            share=True,
        )
        drawing.close()
    if options.animate:
        from runtime.plots import animate

        try:
            filming = Progress("filming", wanted=wanted)
            both = {}
            if options.vs in others:
                first, second = names(options.vs, options.labels)
                both = {first: result, second: others[options.vs]}
            files.append(animate(result, plots / "animation.gif", filming, both))
            filming.close()
        except Exception as error:  # noqa: BLE001 -- matplotlib may raise any exception for unusual numbers
            result.notes.append(f"no animation: {one_line(str(error) or type(error).__name__)}")
    return files


def _summary(outcome: Outcome, options: Namespace) -> dict[str, Any]:
    """What ``--json`` prints."""
    result, others, manifest = outcome.result, outcome.others, outcome.result.manifest
    more: dict[str, Any] = {"profile": outcome.profile} if outcome.profile else {}
    if "real_time" in manifest:
        more["real_time"] = manifest["real_time"]
    if options.vs in others:
        more["vs"] = {"change": options.vs, "metrics": others[options.vs].metrics}
    return {
        "schema_version": manifest["schema_version"],
        "run": str(outcome.folder),
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
        "messages": [as_note(note).plain() for note in result.notes],
        **more,
    }


def _tell_notes(notes: Sequence[str], options: Namespace) -> None:
    """Print notes, unless the user asked for quiet."""
    for note in () if options.quiet else notes:
        tell(f"note: {note}")


def _print_result(outcome: Outcome, options: Namespace) -> None:
    """Print notes and metrics, beside those of other runs or of the run before an edit."""
    result, manifest = outcome.result, outcome.result.manifest
    others = {names(change, options.labels): other for change, other in outcome.others.items()}
    if not others and outcome.before is not None:
        others = {("now", "before"): outcome.before}
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
    if result.metrics:
        from runtime.runs import compared_metrics, metrics_table

        shown = metrics_table(result)
        if others:
            own = next(iter(others))[0] if len(others) == 1 else "as written"
            runs = {own: result} | {second: other for (_, second), other in others.items()}
            units = [result.units.get(name, "") for name in result.metrics]
            shown = compared_metrics(runs, result.metrics).append("", units, "number")
        show(shown.text())
    sys.stdout.flush()  # a pipe or a file shows them before the pictures, too


def painter(
    result: Result,
    others: Mapping[str, Result],
    folder: Path,
    options: Namespace,
    before: Result | None = None,
) -> Callable[[PlotSpec], Figure] | None:
    """A function that draws a plot with another run in it; None if there is no other run.

    Parameters
    ----------
    others : runs by the change that made them.
    options : ``vs`` is the change that all plots show, without which each shows the one that it
        names itself; ``labels`` are names of both runs, ``style`` is that of the figures.
    before : a run from before the graph was edited, for plots that show no other.
    """
    if not others and before is None:
        return None
    from runtime.compare import Run
    from runtime.compare.overlay import versus
    from runtime.plots import draw

    def drawn(plot: PlotSpec) -> Figure:
        change = options.vs or str(plot.options.get("compare", ""))
        if change in others:
            shown, other = names(change, options.labels), others[change]
        elif before is not None:
            shown, other = ("now", "before"), before
        else:
            return draw(plot, result, options.style)
        first, second = shown
        runs = [Run(first, folder, result, {}), Run(second, folder, other, {})]
        return versus(runs, plot, options.style)

    return drawn
