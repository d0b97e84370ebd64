"""Plots: PLOT_KINDS is the registry of their kinds, each with its options and its signals.

In: the entries of a plot and the probes that it shows. Out: a :class:`PlotSpec`, or why such a plot
cannot show them, which is known before the run::

    path: {kind: trajectory, of: plant.pose}
    PlotSpec("path", "trajectory", ("plant.pose",), "Path", {"body_radius": 0.17})
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from blocks.core import Options, plain
from blocks.library.extensions import Registry
from runtime.network import Network
from runtime.observation.kinds import NEEDS_WORLD
from runtime.observation.plot_options import (
    Averaged,
    Checks,
    Distance,
    Figure,
    Levels,
    Map,
    Plane,
    Raster,
    Scans,
    Space,
    moments,
    ordered,
)
from runtime.observation.probes import Probe

COMMON = ("kind", "of", "title", "labels", "module")
# A function, or its name as ``module:function``; '' for none.
Function = str | Callable[..., Any]
SCANNED = ("Pose", "Scan", "PointCloud", "Path")


@dataclass(frozen=True)
class PlotSpec:
    """A plot of a graph: its kind, its probes, its title, and the options of its kind.

    ``options["engaged"]`` and ``options["over"]`` are names of probes, ``options["labels"]`` is a
    list of texts, ``options["compare"]`` a change, ``options["sort"]`` a word; all others are
    numbers. ``own`` is its kind if a Python file of the graph defines it.
    """

    name: str
    kind: str
    of: tuple[str, ...]
    title: str
    options: Mapping[str, Any] = field(default_factory=dict)
    own: PlotKind | None = None

    @property
    def definition(self) -> PlotKind:
        """Its kind.

        Raises
        ------
        KeyError : there is none of that name.
        """
        return PLOT_KINDS[self.kind] if self.own is None else self.own

    def as_dict(self) -> dict[str, Any]:
        """As plain values; ``own`` only says whether the kind is one of a Python file."""
        values = {"name": self.name, "kind": self.kind, "of": list(self.of), "title": self.title}
        return {**values, "options": dict(self.options), **({"own": True} if self.own else {})}

    @property
    def uses(self) -> tuple[str, ...]:
        """The names of all probes that it needs."""
        probes = (self.options.get(key) for key in self.definition.signals)
        return (*self.of, *(name for name in probes if name))


@dataclass(frozen=True)
class PlotKind:
    """A kind of plot: what it can show, and how it is drawn.

    A function is given as it is or by its name ``module:function``, imported when the first plot
    is drawn. Kinds of the library have theirs in ``plots/painters.py``, since what is observed does
    not know how it is drawn.

    Parameters
    ----------
    doc : what it shows.
    painter : the function that draws it and returns its top axes; its arguments are (figure,
        recordings, end of the run in s), or (figure, plot, result) for a plot ``in_world`` or
        ``with_options``.
    overlay : draws several runs in one figure, and returns its top axes, or None where too few of
        them recorded the signals: (figure, plot, runs by label, the plot's own first). Without it,
        each run has a part of the figure.
    limits : applies the options ``xlim``, ``ylim`` and others of its own: (figure, top axes, plot).
        Without it, those two limit the top axes.
    labels : applies the option ``labels`` to other things than lines: (top axes, plot); returns
        what is left for lines.
    finish : called last, when all texts and the size are final: (figure, top axes, plot).
    options : its options; ``agrees`` checks conditions across options, with their defaults.
    signals : options that name one more probe or address.
    in_world : whether it needs the graph's world.
    with_options : whether its painter needs the plot's options.
    of_tuning : whether it shows the tuning behind its signals, which needs no run.
    compared : whether `runtime compare` draws it, beside each probe over time.
    each, together : why it cannot show a probe, or several together; '' if it can.
    has_lead : whether there is nothing to draw without its first signal.
    """

    doc: str
    painter: Function = ""
    overlay: Function = ""
    limits: Function = ""
    labels: Function = ""
    finish: Function = ""
    options: type[Options] = Figure
    agrees: Callable[[Mapping[str, Any]], Checks] = lambda options: ordered(options)
    signals: tuple[str, ...] = ()
    in_world: bool = False
    with_options: bool = False
    of_tuning: bool = False
    compared: bool = False
    each: Callable[[Probe], str] = lambda probe: ""
    together: Callable[[Sequence[Probe]], str] = lambda probes: ""
    has_lead: bool = False

    @property
    def keys(self) -> tuple[str, ...]:
        """The keys of such a plot."""
        return (*COMMON, *self.options.declared, *self.signals)


def plot_keys(kind: str) -> tuple[str, ...]:
    """The keys of a plot of a kind; those of all kinds if the kind is unknown."""
    kinds = [PLOT_KINDS[kind]] if kind in PLOT_KINDS else PLOT_KINDS.values()
    return tuple(dict.fromkeys(key for entry in kinds for key in entry.keys))


def plot_kind_names(kind: str, has_world: bool) -> tuple[str, ...]:
    """The kinds that a message should name: those in a world only if there is one."""
    # Kinds that need a world are of no help in a graph without one.
    everywhere = tuple(name for name, entry in PLOT_KINDS.items() if not entry.in_world)
    names = tuple(PLOT_KINDS) if has_world or kind in PLOT_KINDS.keys() - everywhere else everywhere
    return PLOT_KINDS.names(names)


def check_options(kind: PlotKind, options: Mapping[str, Any], has_world: bool) -> Checks:
    """All errors in a plot's options, as (key, text)."""
    if kind.in_world and not has_world:
        yield "kind", NEEDS_WORLD
    faults = dict(kind.options.check(options))
    yield from faults.items()
    if not faults:
        yield from kind.agrees({**options, **kind.options.read(options)})


def used_options(kind: PlotKind, options: Mapping[str, Any]) -> dict[str, Any]:
    """The declared options that are written, as numbers; none if one is wrong."""
    if dict(kind.options.check(options)):
        return {}
    read = kind.options.read(options)
    return {key: plain(read[key]) for key in options if key in read}


def source_options(kind: PlotKind, probes: Sequence[Probe], network: Network) -> dict[str, Any]:
    """Options from the blocks of the signals: bearings of a scan, radius of a robot."""
    options: dict[str, Any] = {}
    takes = kind.options.declared
    for signal in (signal for probe in probes for signal in probe.signals):
        block = network.entries[signal.end.block].block_or_none
        if signal.kind == "Scan" and "angles" in takes and hasattr(block, "angle_min"):
            low, high = getattr(block, "angle_min", -math.pi), getattr(block, "angle_max", math.pi)
            # The first of them, if a plot shows several; what the graph says replaces it.
            options.setdefault("angles", [float(low), float(high)])
        radius = getattr(block, "body_radius", None)
        if signal.kind == "Pose" and "body_radius" in takes and radius:
            options.setdefault("body_radius", float(radius))
    return options


def title_of(name: str) -> str:
    """A plot's title if it gives none: its name, as in ``Turn rate`` for turn_rate."""
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]


def unfit(
    plot: PlotSpec, known: Mapping[str, Probe], written: str | list[str]
) -> list[tuple[str, str]] | None:
    """All errors in the signals of a plot, as (key, text).

    None if there are none, but too many of the signals ``written`` belong to removed blocks.
    """
    faults = []
    kind = plot.definition
    for key in kind.signals:
        signal = known.get(str(plot.options.get(key)))
        if signal is not None and (len(signal.shape) > 1 or math.prod(signal.shape) != 1):
            faults.append((key, f"expected one column, got {len(signal.labels)}; name one of them"))
    probes = [known[name] for name in plot.of]
    message = next(filter(None, (_misfit(kind, probe) for probe in probes)), "")
    if message:
        return [*faults, ("of", message)]
    items = [written] if isinstance(written, str) else written
    message = kind.together(probes)
    is_short = len(plot.of) < len(items)
    # Without a removed block, a comparison of two signals has one left: no mistake, but no plot.
    if is_short and (message or (kind.has_lead and plot.of[0] != items[0])):
        return None
    return [*faults, ("of", message)] if message else faults


def _misfit(kind: PlotKind, probe: Probe) -> str:
    """Why a plot cannot show a probe; '' if it can."""
    text = kind.each(probe)
    return f"{text}; '{probe.name}' is a {', '.join(sorted(_kinds(probe)))}" if text else ""


def _kinds(probe: Probe) -> set[str]:
    return {signal.kind for signal in probe.signals}


def _alone(probe: Probe) -> str:
    return probe.signals[0].kind if len(probe.signals) == 1 else ""


def _in_plane(probe: Probe) -> str:
    if _kinds(probe) & {"Pose", "Path", "PointCloud"}:
        return ""
    return "a trajectory needs a Pose, a Path or a PointCloud"


def _spikes(probe: Probe) -> str:
    if probe.synapse is not None:
        return "a raster needs spikes as they are, without a synapse"
    return "" if _kinds(probe) == {"Spikes"} else "a raster needs spikes, as in snn.spikes"


def _tuning_problem(probe: Probe) -> str:
    return "" if _kinds(probe) == {"Tuning"} else "expected the spikes of an Ensemble"


def _decoded_and_ideal(probes: Sequence[Probe]) -> str:
    if len(probes) != 2:
        return f"expected two signals, as in [decoded.value, ideal.out]; got {len(probes)}"
    first, second = (math.prod(probe.shape) for probe in probes)
    if first != second:
        return f"expected as many columns in both, got {first} and {second}"
    return _changing(probes[:1])


def _weights(probe: Probe) -> str:
    return _changing([probe]) or ("" if probe.shape else "expected weights, as in out.weights")


def _columns(probe: Probe) -> str:
    if len(probe.shape) <= 1:
        return ""
    return "a timeseries needs scalars, records or vectors; try a heatmap"


def _poses(kind: str) -> Callable[[Probe], str]:
    message = f"a {kind} needs one Pose, as in plant.pose"
    return lambda probe: "" if _alone(probe) == "Pose" else message


def _scan_problem(probe: Probe) -> str:
    if _alone(probe) in SCANNED:
        return ""
    return "scans need one Pose, Scan, PointCloud or Path each, as in lidar.scan"


def _one_pose(probes: Sequence[Probe]) -> str:
    return f"expected one Pose, got {len(probes)} signals" if len(probes) > 1 else ""


def _in_groups(size: int) -> Callable[[Sequence[Probe]], str]:
    """Why signals are not pairs or triples of columns that are recorded at the same times."""
    kind, example = (
        ("xy", "pairs of columns, across and up, as in [a.x, a.y]")
        if size == 2
        else ("xyz", "triples of columns, as in plant.position or [a.x, a.y, a.z]")
    )

    def problem(probes: Sequence[Probe]) -> str:
        count = sum(math.prod(probe.shape) for probe in probes)
        if count < size or count % size:
            return f"expected {example}; got {count}"
        if len({(probe.every, probe.first) for probe in probes}) > 1:
            return (
                f"signals of one plot {kind} must be recorded equally often; give their probes one "
                "'every'"
            )
        return _changing(probes)

    return problem


def _changing(probes: Sequence[Probe]) -> str:
    constant = [probe.name for probe in probes if probe.constant]
    return f"'{constant[0]}' is constant and recorded once" if constant else ""


def _one_of_each(probes: Sequence[Probe]) -> str:
    kinds = [probe.signals[0].kind for probe in probes]
    if "Pose" not in kinds:
        return "expected the robot's Pose among them, as in plant.pose"
    twice = [item for item in SCANNED if kinds.count(item) > 1]
    return f"expected one {twice[0]}, got {kinds.count(twice[0])}" if twice else ""


_OWN: dict[str, PlotKind] = {
    "timeseries": PlotKind(
        "columns over time, one axis per unit",
        options=Levels,
        each=_columns,
    ),
    "trajectory": PlotKind(
        "poses, paths and point clouds in the plane",
        options=Plane,
        with_options=True,
        compared=True,
        each=_in_plane,
    ),
    "xy": PlotKind(
        "the second signal of `of` over the first, as in a phase plane; further pairs likewise",
        each=_columns,
        together=_in_groups(2),
        has_lead=True,
    ),
    "xyz": PlotKind(
        "a curve in space through three columns of `of`, as a position, with its shadow on the "
        "ground; further triples likewise; of equal scales where all units are one",
        options=Space,
        each=_columns,
        together=_in_groups(3),
        has_lead=True,
    ),
    "spectrum": PlotKind(
        "power spectral density of columns, by Welch's method; one axis per unit",
        each=_columns,
        together=_changing,
    ),
    "raster": PlotKind(
        "spikes and the population's rate",
        options=Raster,
        with_options=True,
        each=_spikes,
    ),
    "tuning_curves": PlotKind(
        "steady rates of an Ensemble's neurons over the represented value, one axes per dimension "
        "(the others 0), from the tuning at the start: `runtime explain --plots` draws it "
        "without a run",
        of_tuning=True,
        each=_tuning_problem,
    ),
    "response_curves": PlotKind(
        "steady rates of an Ensemble's neurons over the input along their own encoders, and "
        "histograms of intercepts and largest rates; likewise without a run",
        of_tuning=True,
        each=_tuning_problem,
    ),
    "decoded": PlotKind(
        "a decoded signal and the ideal one, the first and the second of `of`: mean and standard "
        "deviation over time, or over the signal `over`, and the error",
        options=Averaged,
        signals=("over",),
        with_options=True,
        each=_columns,
        together=_decoded_and_ideal,
        has_lead=True,
    ),
    "weights": PlotKind(
        "weights over time, those that end largest and smallest and some between, and the root "
        "mean square of the change of all",
        each=_weights,
    ),
    "heatmap": PlotKind("any array over time"),
    "map": PlotKind(
        "the world, the trajectory of the first pose of `of`, other poses as points; `engaged` (a "
        "probe or address that rises above 0.5) adds a dot where following begins",
        options=Map,
        signals=("engaged",),
        in_world=True,
        compared=True,
        each=_poses("map"),
        has_lead=True,
    ),
    "wall_distance": PlotKind(
        "distance of a pose to the nearest wall, minus `distance`, over time; `engaged` as in map",
        options=Distance,
        signals=("engaged",),
        in_world=True,
        each=_poses("wall_distance"),
        together=_one_pose,
    ),
    "scans": PlotKind(
        "a pose, a scan, a fitted wall (point cloud) and a path, around the robot, at the times "
        "`at` or four after `engaged`",
        options=Scans,
        agrees=moments,
        signals=("engaged",),
        in_world=True,
        each=_scan_problem,
        together=_one_of_each,
    ),
}

# Those of the library, and by their names those of packages.
PLOT_KINDS: Registry[PlotKind] = Registry("plots", PlotKind, "a PlotKind", own=_OWN)
