"""The report of one run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from runtime.compare import text_of
from runtime.document import parse_yaml
from runtime.errors import UsageError
from runtime.files import is_number
from runtime.observation import PlotSpec, Recording, RunData
from runtime.plots import symbol
from runtime.reports import pieces, zoom
from runtime.reports.findings import of_run
from runtime.reports.page import page
from runtime.runs import DIAGRAM, RESOLVED, pacing_text, read_run, run_folder
from runtime.tables import Cell, Html, Table, bullets, element, facts, join

NAMES = 6  # that a caption lists; of more columns, it names the signals
KINDS = {
    "timeseries": " over time",
    "trajectory": " in the plane",
    "spectrum": ", power over frequency",
    "raster": ", a mark for each spike",
    "heatmap": " over time, values as colours",
}
STATUS = {"complete": "good", "stopped": "good", "interrupted": "warn", "failed": "bad"}


def run_report(path: Path) -> str:
    """The report of a run as an HTML document.

    Parameters
    ----------
    path : the run's folder, a link to it, or its manifest.

    Raises
    ------
    UsageError : there is no run, or it cannot be read.
    """
    folder = run_folder(path)
    result = read_run(folder)
    sections = {
        "Metrics": _metrics(folder, result),
        "Figures": join(*_figures(result)),
        "Diagram": _diagram(folder, result),
        "Recorded signals": _signals(result),
        "Graph": _graph(folder, result),
        "Provenance": _provenance(folder, result),
    }
    has_charts = 'class="zoom"' in sections["Figures"]
    return page(
        "Run",
        result.title,
        _lead(result),
        _facts(result),
        sections,
        folder,
        of_run(result),
        style=zoom.chart_style() if has_charts else "",
        script=zoom.script() if has_charts else "",
    )


def _lead(result: RunData) -> str:
    """The source of the graph, its changes, and when it ran."""
    manifest = result.manifest
    source = manifest.get("source")
    changes = [str(text) for text in manifest["overrides"]]
    what = f"From {Path(str(source)).name}" if source else "Built in Python"
    what += f", changed: {'; '.join(changes)}" if changes else ", as written"
    return f"{what}. Run on {pieces.moment(str(manifest.get('started', '')))}."


def _facts(result: RunData) -> Html:
    manifest = result.manifest
    dt, ticks = float(manifest["dt"]), result.ticks
    return facts(
        [
            ("status", element("span", result.status, class_=STATUS.get(result.status, ""))),
            ("seed", str(manifest["seed"])),
            ("simulated", f"{ticks * dt:g} of {float(manifest['until']):g} {result.time_unit}"),
            ("base step", f"{dt:g} {result.time_unit}"),
            ("ticks", f"{ticks:,}".replace(",", "\u202f")),
            ("wall time", f"{float(manifest['wall_s']):.3g} s"),
        ]
    )


def _metrics(folder: Path, result: RunData) -> Html:
    errors = [str(result.manifest["error"])] if result.manifest.get("error") else []
    errors += result.failures
    parts = [bullets(errors, "notes failed")] if errors else []
    if result.metrics:
        parts.append(_metrics_table(folder, result))
    else:
        parts.append(element("p", "The graph has no metrics.", class_="soft"))
    if result.notes:
        parts += [element("h3", "Notes"), bullets(result.notes, "notes")]
    return join(*parts)


def _metrics_table(folder: Path, result: RunData) -> Html:
    entries = _metric_entries(result.texts[RESOLVED], str(folder / RESOLVED))
    rows, expects = [], False
    for name, value in result.metrics.items():
        entry = entries.get(name, {})
        expected = _expectation(entry, value)
        expects = expects or bool(expected)
        unit = result.units.get(name, "") if value is not None else ""
        named = value is None and name in result.never
        shown: object = Cell(result.metric_text(name)) if named else value
        if value is not None:
            shown = element("span", pieces.quantity(value, unit), title=f"{value!r} {unit}".strip())
        rows.append([name, shown, expected, _definition(entry)])
    head = ["metric", "value", "expected", "definition"]
    if not expects:
        head, rows = [*head[:2], head[3]], [[*row[:2], row[3]] for row in rows]
    return Table.of(head, rows, numbers=[1], long=[len(head) - 1]).html("metrics")


def _metric_entries(text: str, file: str) -> dict[str, dict[str, Any]]:
    """The metrics section of a resolved graph, with the values of its params."""
    plain = parse_yaml(text, file).plain()
    sections = plain if isinstance(plain, dict) else {}
    params, entries = (
        section if isinstance(section, dict) else {}
        for section in (sections.get("params"), sections.get("metrics"))
    )

    def value_of(value: Any) -> Any:
        is_param = isinstance(value, str) and value.startswith("$")
        return params.get(value[1:], value) if is_param else value

    return {
        name: {key: value_of(value) for key, value in entry.items()}
        for name, entry in entries.items()
        if isinstance(entry, dict)
    }


def _expectation(entry: Mapping[str, Any], value: float | None) -> Html:
    """A metric's bounds, and whether its value is within them."""
    bounds = [(key, entry[key]) for key in ("above", "below") if is_number(entry.get(key))]
    if not bounds:
        return Html("")
    is_met = value is not None and all(
        value > bound if key == "above" else value < bound for key, bound in bounds
    )
    message = " and ".join(f"{key} {bound:g}" for key, bound in bounds)
    verdict = element("span", "met" if is_met else "failed", class_="good" if is_met else "bad")
    return join(f"{message}: ", verdict)


def _definition(entry: Mapping[str, Any]) -> str:
    """A metric's kind and options as in its graph."""
    left = {k: v for k, v in entry.items() if k not in ("kind", "of", "below", "above")}
    message = [f"{entry.get('kind', '')} of {text_of(entry['of'])}" if "of" in entry else ""]
    if "of" not in entry:
        message = [str(entry.get("kind", ""))]
    message += [f"{key} {text_of(value)}" for key, value in left.items()]
    return ", ".join(part for part in message if part)


def _figures(result: RunData) -> Iterator[Html]:
    from runtime.plots import draw

    for i, spec in enumerate(result.plots):
        try:
            figure = draw(spec, result)
        except UsageError as error:
            yield element("p", f"{spec.name} is not drawn: {error}", class_="soft")
            continue
        yield pieces.plot(figure, f"figure-{i + 1}", _caption(spec, result))
        yield zoom.charts(spec, result)


def _caption(spec: PlotSpec, result: RunData) -> str:
    """What a figure shows, in words: "Tracking errors: distance to line and heading error"."""
    recorded = [result.probes[name] for name in spec.of if name in result.probes]
    names = [name for each in recorded for name in each.display_names]
    labels = [str(label) for label in spec.options.get("labels", ())]
    shown = list(dict.fromkeys(labels or (map(symbol, names) if len(names) <= NAMES else spec.of)))
    words = ", ".join(shown[:-1]) + " and " * (len(shown) > 1) + "".join(shown[-1:])
    title = spec.title.rstrip(".")
    return f"{title}: {words}{KINDS.get(spec.kind, '')}." if words else f"{title}."


def _diagram(folder: Path, result: RunData) -> Html:
    return pieces.diagram_file(folder / DIAGRAM, "diagram", f"block diagram of {result.title}")


def _signals(result: RunData) -> Html:
    head = ["probe", "signals", "type", "unit", "rows", "every"]
    rows = [_signal(recorded) for recorded in result.probes.values()]
    if not rows:
        return Html("")
    return Table.of(head, rows, numbers=[4, 5], long=[1]).html("recorded signals")


def _signal(recorded: Recording) -> list[str]:
    every = (
        f"{recorded.t[1] - recorded.t[0]:g} {recorded.time_unit}" if len(recorded.t) > 1 else "once"
    )
    return [
        recorded.name,
        ", ".join(recorded.addresses),
        ", ".join(dict.fromkeys(recorded.kinds)),
        ", ".join(unit for unit in dict.fromkeys(recorded.units) if unit),
        f"{len(recorded.t):,}".replace(",", "\u202f"),
        every,
    ]


def _graph(folder: Path, result: RunData) -> Html:
    message = "The graph of the run, with all that it extends and all changes of the command line. "
    purpose = " reproduces the run bit by bit."
    return pieces.graph_text(result.texts[RESOLVED], folder / RESOLVED, message, purpose)


def _provenance(folder: Path, result: RunData) -> Html:
    manifest = result.manifest
    per_tick = manifest["us_per_tick"]
    timed = manifest.get("real_time")
    more = [
        ("seed", str(manifest["seed"])),
        ("changes", "; ".join(map(str, manifest["overrides"])) or "none"),
        ("engine", str(manifest.get("engine") or "")),
        ("time per tick", "" if per_tick is None else f"{float(per_tick):.3g} µs"),
        *([("real time", pacing_text(timed))] if isinstance(timed, dict) else []),
        ("folder", str(folder.resolve())),
    ]
    return join(pieces.provenance(manifest, more), *_hashes(manifest.get("hashes")))


def _hashes(hashes: Any) -> Iterator[Html]:
    if isinstance(hashes, dict) and hashes:
        yield element("h3", "Files")
        rows = [[str(name), element("code", str(digest))] for name, digest in hashes.items()]
        yield Table.of(["file", "SHA-256"], rows, long=[1]).html("hashes of files")
