"""What each command does, from parsed options to text on stdout."""

from __future__ import annotations

import json
import math
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from runtime.document import parse_yaml
from runtime.errors import GraphError, SimulationError, UsageError
from runtime.graph import Graph, load
from runtime.result import Result


def changed(graph: Graph, options: Namespace) -> Graph:
    """The graph with the changes of the command line, in the order they were written."""
    for kind, text in options.changes or ():
        if kind == "with":
            graph = graph.overlay(text)
            continue
        if kind in ("without", "bypass"):
            names = [name.strip() for name in text.split(",") if name.strip()]
            graph = getattr(graph, kind)(*names, origin=f"--{kind} {text}")
            continue
        path, equals, value = text.partition("=")
        if not equals:
            raise UsageError(f"--{kind} {text}: expected PATH=VALUE")
        origin = f"--{kind} {text}"
        plain = parse_yaml(value, origin).plain()
        graph = (
            graph.set(path, plain, origin=origin)
            if kind == "set"
            else graph.wire(path, plain, origin=origin)
        )
    if options.seed is not None:
        graph = graph.set("run.seed", options.seed, origin="--seed")
    if options.until is not None:
        graph = graph.set("run.until", options.until, origin="--until")
    return graph


def run(options: Namespace) -> int:
    """Simulate, write the run folder and its pictures, print the metrics."""
    from runtime.progress import Progress
    from runtime.record import link_latest, new_folder, save

    graph = changed(load(options.graph), options).check()
    if options.animate:
        _check_animation(graph)
    quiet = options.quiet or options.json
    progress = Progress(graph.title, wanted=not quiet)
    failure: SimulationError | None = None
    try:
        result = graph.run(progress=progress)
    except SimulationError as error:
        if not isinstance(error.result, Result):
            raise
        failure, result = error, error.result
    finally:
        progress.close()
    folder = save(result, new_folder(Path(options.out), result.title))
    link_latest(folder)
    pictures = _pictures(result, folder, not options.no_plots, options.animate)
    if options.json:
        print(json.dumps(_summary(result, folder)))
    else:
        _print_result(result, folder, pictures, options.quiet)
    for text in ([str(failure)] if failure else []) + result.failures:
        print(text, file=sys.stderr)
    if failure is not None:
        print(f"what was recorded before is kept in {folder}", file=sys.stderr)
        return failure.exit_code
    if result.status == "interrupted":
        print(f"interrupted; what was recorded before is kept in {folder}", file=sys.stderr)
        return 130
    return 1 if result.failures else 0


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
            for key in ("status", "error", "graph", "seed", "dt", "until", "ticks")
        },
        "metrics": result.metrics,
        "wall_s": manifest["wall_s"],
        "us_per_tick": manifest["us_per_tick"],
        "failures": result.failures,
        "notes": result.notes,
    }


def _print_result(result: Result, folder: Path, pictures: list[Path], quiet: bool) -> None:
    manifest = result.manifest
    if not quiet:
        for note in result.notes:
            print(f"note: {note}", file=sys.stderr)
    simulated = manifest["ticks"] * manifest["dt"]
    print(
        f"{result.title}: {simulated:g} s in {manifest['wall_s']:.2f} s "
        f"({manifest['us_per_tick']:.1f} us a tick), seed {manifest['seed']}"
    )
    width = max((len(name) for name in result.metrics), default=0)
    for name, value in result.metrics.items():
        print(f"  {name:<{width}}  {number(value)}")
    print(f"run folder: {folder}")
    for path in pictures:
        print(f"  {path.relative_to(folder)}")


def number(value: float | None) -> str:
    """A metric for people: four digits, or a dash where it has no value."""
    return "-" if value is None or math.isnan(value) else f"{value:.4g}"


def validate(options: Namespace) -> int:
    """Check graphs, all problems of all of them at once."""
    problems: dict[str, list[str]] = {}
    for name in options.graphs:
        try:
            graph = changed(load(name), options).check()
        except GraphError as error:
            problems[name] = [str(problem) for problem in error.problems]
            if not options.json:
                print(error, file=sys.stderr)
            continue
        problems[name] = []
        if not (options.quiet or options.json):
            network = graph.network
            blocks, wires = len(network.entries), len(network.wires)
            print(f"{name}: fine ({blocks} blocks, {wires} wires, {network.ticks} ticks)")
    if options.json:
        print(json.dumps({"schema_version": 1, "problems": problems}))
    return 2 if any(problems.values()) else 0


def draw(options: Namespace) -> int:
    """Write the block diagram."""
    graph = changed(load(options.graph), options)
    network = graph.network
    written = options.out or f"{Path(options.graph).stem}.{options.format or 'svg'}"
    suffix = Path(written).suffix.lstrip(".")
    kind = options.format or {"mmd": "mermaid", "md": "mermaid", "gv": "dot"}.get(suffix, suffix)
    if written == "-":
        kind = options.format or "svg"
    from runtime.diagrams.diagram import diagram

    drawn = diagram(network, kind)
    content = drawn.encode() if isinstance(drawn, str) else drawn
    if written == "-":
        sys.stdout.buffer.write(content)
        return 0
    try:
        Path(written).write_bytes(content)
    except OSError as error:
        raise UsageError(f"cannot write '{written}': {error.strerror}") from None
    print(written)
    return 0


def explain(options: Namespace) -> int:
    """Print order, rates and types, and the function that is executed."""
    from runtime.explain import explain_json, explain_text

    graph = changed(load(options.graph), options).check()
    if options.json:
        print(json.dumps(explain_json(graph)))
    else:
        print(explain_text(graph))
    return 0


def blocks(options: Namespace) -> int:
    """Print the library, or one block."""
    from runtime.describe import describe_json, describe_text, library

    known = library(options.module)
    if options.type is not None and options.type not in known:
        from blocks.params import hint

        mend = hint(options.type, known) or f"; there are {', '.join(known)}"
        raise UsageError(f"no block type '{options.type}'{mend}")
    if options.json:
        chosen = known if options.type is None else {options.type: known[options.type]}
        print(json.dumps({name: describe_json(cls) for name, cls in chosen.items()}))
    elif options.type is None:
        width = max(map(len, known))
        for name, cls in known.items():
            summary = (cls.__doc__ or "").strip().split("\n")[0]
            print(f"{name:<{width}}  {summary}")
        print("\n'runtime blocks TYPE' shows a block's ports and parameters.")
    else:
        print(describe_text(known[options.type]))
    return 0
