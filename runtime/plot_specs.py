"""What a graph says of its pictures: their kinds, and which signals each can show."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from blocks.params import show
from runtime.network import Network
from runtime.signals import Probe

COMMON = ("kind", "of", "title")
_FLAT = ("timeseries", "trajectory", "raster", "heatmap")
# Pictures of the graph's world, and the options that each takes beside the common ones.
WORLD_OPTIONS: Mapping[str, tuple[str, ...]] = {
    "map": ("distance", "engaged", "body_radius"),
    "wall_distance": ("distance", "engaged"),
    "scans": ("distance", "engaged", "body_radius", "at", "angles"),
}
PLOT_KINDS = (*_FLAT, *WORLD_OPTIONS)
SCANNED = ("Pose", "Scan", "PointCloud", "Path")


@dataclass(frozen=True)
class PlotSpec:
    """A picture: its kind, the probes it shows, its title, and what else its kind needs.

    ``options["engaged"]`` is the name of a probe; everything else is a number or some.
    """

    name: str
    kind: str
    of: tuple[str, ...]
    title: str
    options: Mapping[str, Any] = field(default_factory=dict)


def plot_keys(kind: str) -> tuple[str, ...]:
    """What may stand in a plot of a kind; in any plot, where the kind is none that is known."""
    if kind in _FLAT:
        return COMMON
    every = [key for options in WORLD_OPTIONS.values() for key in options]
    return tuple(dict.fromkeys([*COMMON, *WORLD_OPTIONS.get(kind, every)]))


def offered(kind: str, has_world: bool) -> tuple[str, ...]:
    """The kinds that a message should name: those of a world only where there is one."""
    return PLOT_KINDS if has_world or kind in WORLD_OPTIONS else _FLAT


def check_options(
    kind: str, options: Mapping[str, Any], has_world: bool
) -> Iterable[tuple[str, str]]:
    """Everything wrong with a plot's options, as (key, text)."""
    if kind not in WORLD_OPTIONS:
        return
    if not has_world:
        yield "kind", "needs a world, as in 'world: worlds/paper_room.yaml'"
    if "distance" not in options and kind == "wall_distance":
        yield "distance", "missing; expected the distance to follow (m)"
    for key in ("distance", "body_radius"):
        if key in options and not (_is_number(options[key]) and options[key] > 0.0):
            yield key, f"expected a number above 0 m, got {show(options[key])}"
    if "at" in options:
        moments = options["at"] if isinstance(options["at"], list) else [options["at"]]
        if not moments or not all(_is_number(item) and item >= 0.0 for item in moments):
            said = f"expected times from 0 s, as in [20, 40], got {show(options['at'])}"
            yield "at", said
    if "angles" in options:
        angles = options["angles"]
        pair = isinstance(angles, list) and len(angles) == 2 and all(map(_is_number, angles))
        if not pair or angles[0] >= angles[1]:
            said = "expected the scan's first and last bearing (rad), as in [-1.57, 1.57], got "
            yield "angles", said + show(angles)


def source_options(kind: str, probes: Sequence[Probe], network: Network) -> dict[str, Any]:
    """Options that the blocks behind the signals know: bearings of a scan, radius of a robot."""
    found: dict[str, Any] = {}
    takes = WORLD_OPTIONS.get(kind, ())
    for signal in (signal for probe in probes for signal in probe.signals):
        block = network.entries[signal.end.block].block
        if signal.kind == "Scan" and "angles" in takes and hasattr(block, "angle_min"):
            low, high = getattr(block, "angle_min", -math.pi), getattr(block, "angle_max", math.pi)
            found.setdefault("angles", [float(low), float(high)])
        radius = getattr(block, "body_radius", None)
        if signal.kind == "Pose" and "body_radius" in takes and radius:
            found.setdefault("body_radius", float(radius))
    return found


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def unfit(
    plot: PlotSpec, known: Mapping[str, Probe], written: str | list[str]
) -> list[tuple[str, str]] | None:
    """Everything wrong with the signals of a plot, as (key, text).

    None if nothing is but too much of what was ``written`` is gone with its blocks to draw it.
    """
    engaged = known.get(str(plot.options.get("engaged")))
    faults = []
    if engaged is not None and (len(engaged.shape) > 1 or math.prod(engaged.shape) != 1):
        faults.append(("engaged", "expected one column, as in explore.engaged"))
    probes = [known[name] for name in plot.of]
    said = next(filter(None, (_misfit(plot.kind, probe) for probe in probes)), "")
    if said:
        return [*faults, ("of", said)]
    items = [written] if isinstance(written, str) else written
    said = _lacking(plot.kind, probes)
    # The robot of a map is the first of its signals.
    is_short = len(plot.of) < len(items)
    if is_short and (said or (plot.kind == "map" and plot.of[0] != items[0])):
        return None
    return [*faults, ("of", said)] if said else faults


def _misfit(kind: str, probe: Probe) -> str:
    """Why a picture cannot show a probe; '' if it can."""
    kinds = {signal.kind for signal in probe.signals}
    alone = probe.signals[0].kind if len(probe.signals) == 1 else ""
    text = ""
    if kind == "trajectory" and not kinds & {"Pose", "Path", "PointCloud"}:
        text = "a trajectory needs a Pose, a Path or a PointCloud"
    elif kind == "raster" and kinds != {"Spikes"}:
        text = "a raster needs spikes, as in snn.spikes"
    elif kind == "timeseries" and len(probe.shape) > 1:
        text = "a timeseries needs scalars, records or vectors; try a heatmap"
    elif kind in ("map", "wall_distance") and alone != "Pose":
        text = f"a {kind} needs one Pose, as in plant.pose"
    elif kind == "scans" and alone not in SCANNED:
        text = "scans need one Pose, Scan, PointCloud or Path each, as in lidar.scan"
    return f"{text}; '{probe.name}' is a {', '.join(sorted(kinds))}" if text else ""


def _lacking(kind: str, probes: Sequence[Probe]) -> str:
    """What is wrong with the signals of a picture as a whole; '' if nothing is."""
    if kind == "wall_distance" and len(probes) > 1:
        return f"expected one Pose, got {len(probes)} signals"
    if kind != "scans":
        return ""
    kinds = [probe.signals[0].kind for probe in probes]
    if "Pose" not in kinds:
        return "expected the robot's Pose among them, as in plant.pose"
    twice = [item for item in SCANNED if kinds.count(item) > 1]
    return f"expected one {twice[0]}, got {kinds.count(twice[0])}" if twice else ""
