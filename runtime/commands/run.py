"""``runtime run``: simulate, record, draw the probes, print the metrics."""

from __future__ import annotations

import math
import shutil
from argparse import ArgumentParser, Namespace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from runtime.commands.changes import add_graph, changed
from runtime.errors import SimulationError, UsageError
from runtime.terminal import show, show_json, tell

if TYPE_CHECKING:
    from runtime.graph import Graph
    from runtime.profile import Profile
    from runtime.result import Result

HELP = "simulate, record, draw the probes, print the metrics"


def add(parser: ArgumentParser) -> None:
    """Declare the options."""
    add_graph(parser)
    parser.add_argument("--out", default="runs", metavar="DIR", help="where run folders go (runs)")
    parser.add_argument("--no-plots", action="store_true", help="draw nothing")
    parser.add_argument("--profile", action="store_true", help="show what each block takes")
    parser.add_argument("--animate", action="store_true", help="write plots/animation.gif, too")
    parser.add_argument(
        "--json", action="store_true", help="print one JSON object and nothing else"
    )
    parser.add_argument("-q", "--quiet", action="store_true", help="no progress, no notes")


def run(options: Namespace) -> int:
    """Simulate, write the run folder and its pictures, print the metrics."""
    from runtime.graph import load
    from runtime.profile import Profile, profile_text
    from runtime.record import link_latest, new_folder, save

    graph = changed(load(options.graph, modules=not options.no_modules), options).check()
    if options.animate:
        _check_animation(graph)
    if options.profile and graph.network.engine == "compiled":
        raise UsageError("--profile times blocks one by one, which takes --engine python")
    profile = Profile() if options.profile else None
    folder = new_folder(Path(options.out), graph.title)
    # What does not fit into memory lies beside the run's folder until that is written.
    recordings = folder.with_name(f".{folder.name}.recording")
    result, failure = _simulated(graph, options.quiet or options.json, profile, recordings)
    save(result, folder)
    shutil.rmtree(recordings, ignore_errors=True)
    link_latest(folder)
    pictures = _pictures(result, folder, not options.no_plots, options.animate)
    rows = profile.rows(result.manifest["ticks"], result.manifest["wall_s"]) if profile else []
    if options.json:
        show_json(_summary(result, folder) | ({"profile": rows} if rows else {}))
    else:
        _print_result(result, folder, pictures, options.quiet)
    if rows and not options.json:
        show(profile_text(rows))
    return _ended(result, failure, folder)


def _simulated(
    graph: Graph, quiet: bool, profile: Profile | None, recordings: Path
) -> tuple[Result, SimulationError | None]:
    """What was recorded, and what ended it early if something failed."""
    from runtime.progress import Progress
    from runtime.result import Result
    from runtime.running import silent
    from runtime.simulate import simulate

    progress = Progress(graph.title, wanted=not quiet)
    note = silent if quiet else _note
    try:
        return simulate(graph, progress, note=note, profile=profile, folder=recordings), None
    except SimulationError as error:
        if not isinstance(error.result, Result):
            raise
        return error.result, error
    finally:
        progress.close()


def _ended(result: Result, failure: SimulationError | None, folder: Path) -> int:
    """Say what went wrong; returns the exit code."""
    for text in ([str(failure)] if failure else []) + result.failures:
        tell(text)
    if failure is not None:
        tell(f"what was recorded before is kept in {folder}")
        return failure.exit_code
    if result.status == "interrupted":
        tell(f"interrupted; what was recorded before is kept in {folder}")
        return 130
    return 1 if result.failures else 0


def _note(text: str) -> None:
    tell(text)


def _check_animation(graph: Graph) -> None:
    """Refuse an animation of what has none before the run, not after it."""
    from runtime.observe import observe
    from runtime.pictures.animation import animated

    animated(observe(graph.network).plots, graph.network.world)


def _pictures(result: Result, folder: Path, plots: bool, animation: bool) -> list[Path]:
    """Draw what was asked for into a run's folder; returns the files."""
    files = []
    if plots:
        from runtime.pictures.plots import save_plots

        files += save_plots(result, folder / "plots")
    if animation:
        from runtime.pictures.animation import animate

        files.append(animate(result, folder / "plots" / "animation.gif"))
    return files


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


def _print_result(result: Result, folder: Path, pictures: list[Path], quiet: bool) -> None:
    manifest = result.manifest
    if not quiet:
        for note in result.notes:
            tell(f"note: {note}")
    simulated = manifest["ticks"] * manifest["dt"]
    show(
        f"{result.title}: {simulated:g} s in {manifest['wall_s']:.2f} s "
        f"({manifest['us_per_tick']:.1f} us a tick, {manifest['engine']} engine), "
        f"seed {manifest['seed']}"
    )
    width = max((len(name) for name in result.metrics), default=0)
    for name, value in result.metrics.items():
        show(f"  {name:<{width}}  {number(value)}")
    show(f"run folder: {folder}")
    for path in pictures:
        show(f"  {path.relative_to(folder)}")


def number(value: float | None) -> str:
    """A metric for people: four digits, or a dash where it has no value."""
    return "-" if value is None or math.isnan(value) else f"{value:.4g}"
