"""Reading the sections probes, plots and metrics into what a run records, draws and measures.

In: a network with its document. Out: an :class:`Observation`. A plot or metric may name a probe or
an address, which is then recorded by itself::

    metrics: {miss: {kind: rms, of: error.lateral}}    ->    probes["error.lateral"], auto=True
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from blocks.core import SettingError, misspelt
from blocks.library.registry import Modules
from blocks.messages import Note
from blocks.neural import Synapse
from runtime.document import (
    SECTIONS,
    Node,
    check_keys,
    expected_form,
    misspelt_keys,
    name_problem,
    section,
    strings,
)
from runtime.errors import Problems, Where
from runtime.network import (
    MAX_BYTES,
    AddressError,
    Network,
    ReportedError,
    check_output,
    find,
    follow,
    missing_block,
    whole_shape,
)
from runtime.observation.default_plots import default_plots
from runtime.observation.kinds import choose
from runtime.observation.metrics import METRIC_KINDS, Metric, ProbeInfo
from runtime.observation.observation import Observation, StopTest
from runtime.observation.plots import (
    COMMON,
    PLOT_KINDS,
    check_options,
    plot_kind_names,
    source_options,
    title_of,
    unfit,
    used_options,
)
from runtime.observation.plots import PlotSpec as PlotSpec
from runtime.observation.probe_sampling import sampling
from runtime.observation.probes import (
    MAX_RECORDING,
    PROBE_KEYS,
    Signal,
    describe_signals,
    event_blocks,
    make_signal,
    make_tuning,
    no_component,
    ticks_of_rows,
    with_names,
    with_units,
)
from runtime.observation.probes import Probe as Probe
from runtime.terminal import readable_bytes

MAX_COLUMNS = 1_000_000
SIGNS = {"rising": 1.0, "falling": -1.0, "either": 0.0}
_SOURCE = "a probe's name or an address"


def observe(network: Network, problems: Problems, modules: Modules = True) -> Observation:
    """Read the sections probes, plots and metrics, as far as their blocks have no errors.

    ``modules`` is whether Python files that the graph names are imported, or how they are read.
    """
    reader = _Reader(network, problems, modules)
    reader.read(network.document)
    probes = reader.observation.probes.values()
    total = sum(probe.size(network.ticks) for probe in probes)
    if total > MAX_RECORDING and not problems.items:
        worst = max(probes, key=lambda probe: probe.size(network.ticks))
        message = f"recording takes {readable_bytes(total)}, most of it '{worst.name}'; record it "
        message += f"less often, {{of: {worst.signals[0].end}, every: 100}}, or run shorter"
        problems.add(*reader.places[worst.name], message)
    return reader.observation


class _Reader:
    """Turns the three sections into an observation; ``places`` locates the origin of each probe."""

    def __init__(self, network: Network, problems: Problems, modules: Modules) -> None:
        self.network, self.modules = network, modules
        self.problems = problems
        # A world with errors is reported once, at its own location.
        self.has_world = (network.document.get("world") or Node(None)).value is not None
        self.observation = Observation(notes=list(network.notes), time_unit=network.time_unit)
        self.declared: set[str] = set()
        self.unread: set[str] = set()
        self.places: dict[str, tuple[Where, str]] = {}

    def read(self, document: Node) -> None:
        probes = section(document, "probes", "probes", self.problems, self.unread)
        self.unread |= misspelt_keys(document, SECTIONS)
        # Names first: a plot of a probe that has an error must not say that there is none.
        self.declared = set(probes)
        for name, node in probes.items():
            self.check_name(name, node, f"probes.{name}")
            self.probe(name, node, f"probes.{name}")
        # After the probes, which both may name.
        for kind, reader in (("plots", self.plot), ("metrics", self.metric)):
            for name, node in section(document, kind, kind, self.problems).items():
                address = f"{kind}.{name}"
                self.check_name(name, node, address)
                if node.is_map:
                    reader(name, node, address)
                else:
                    message = f"{expected_form(kind)}, got {node.describe()}"
                    self.problems.add(node.where, address, message)
        self.observation.stop = self.stop()
        self.observation.plots[:] = [self.with_band(plot) for plot in self.observation.plots]
        if document.get("plots") is None:
            self.observation.defaults[:] = default_plots(self.observation.probes.values())

    def stop(self) -> StopTest | None:
        """What ends the run early; None, with a note, if its block is removed."""
        stop = self.network.stop
        if stop is None:
            return None
        signal = self.signal(stop.node, "run.stop.when", "cannot end the run (run.stop)")
        if signal is None:
            return None
        message = ""
        if signal.shape:
            first = signal.labels[0].rpartition(".")[2]
            message = f"expected one number, got {len(signal.labels)}; name one, as in "
            message += f"{stop.when}.{first}" if "[" not in first else f"{stop.when}.0"
        elif signal.is_event:
            message = "an event cannot end the run; name an output or another state"
        if message:
            self.problems.add(stop.node.where, "run.stop.when", message)
            return None
        return StopTest(signal, SIGNS[stop.direction], stop.level)

    def with_band(self, plot: PlotSpec) -> PlotSpec:
        """A time series with the band of the settling times of what it shows."""
        bands = [
            metric.options.get("band")
            for metric in self.observation.metrics
            if metric.kind == "settling_time" and metric.inputs["of"] in plot.of
        ]
        if plot.kind != "timeseries" or "band" in plot.options or len(plot.of) > 1 or not bands:
            return plot
        band = bands[0]
        if not isinstance(band, (int, float)) or any(other != band for other in bands):
            return plot
        return replace(plot, options={**plot.options, "band": float(band)})

    def check_name(self, name: str, node: Node, address: str) -> None:
        message = name_problem(name, address.startswith("probes"))
        if message:
            self.problems.add(node.key, address, message)

    def probe(self, name: str, node: Node, address: str) -> None:
        of: Node | None = node
        if node.is_map:
            check_keys(node, tuple(PROBE_KEYS), address, self.problems, "key")
            of, blocks = node.get("of"), node.get("events")
            if blocks is not None:
                found = event_blocks(self.network, blocks, f"{address}.events", self.problems)
                self.observation.events[name] = found
                return
        if of is None or of.value == []:
            where = node.key if of is None else of.where
            message = "expected an address, as in {of: plant.pose}"
            self.problems.add(where, address, message)
            return
        place = address if of is node else f"{address}.of"
        items = strings(of, place, "an address, as in plant.pose", self.problems)
        signals = [self.signal(item, where) for item, where in items]
        every_node = node.get("every")
        every, offset, mean = sampling(every_node, f"{address}.every", self.problems)
        synapse = self.synapse(node.get("synapse"), f"{address}.synapse")
        signals = describe_signals(
            signals, node.get("label"), f"{address}.label", with_names, self.problems
        )
        signals = describe_signals(
            signals, node.get("unit"), f"{address}.unit", with_units, self.problems
        )
        present = tuple(signal for signal in signals if signal is not None)
        probe = Probe(name, present, every, synapse=synapse, first=offset or 0, mean=mean)
        if every_node is not None and every and probe.missed_event():
            self.problems.add(every_node.where, f"{address}.every", probe.missed_event())
        else:
            self.add(probe, of.where, place, offset)

    def synapse(self, node: Node | None, address: str) -> Synapse | None:
        """The filter of a probe; None for none."""
        if node is None:
            return None
        try:
            synapse: Synapse = Synapse.read(node.plain())
        except SettingError as error:
            for key, text in error.problems:
                self.problems.add(node.where, f"{address}.{key}" if key else address, text)
            return None
        return synapse if synapse.order else None

    def add(self, probe: Probe, where: Where, address: str, offset: int | None = None) -> None:
        """Add a probe if its signals can be recorded together; an offset is as it is written."""
        if not probe.signals:
            return
        every, first = ticks_of_rows(probe.signals, probe.every)
        probe = replace(probe, every=every, first=first if offset is None else offset)
        clash = probe.clash()
        if clash:
            self.problems.add(where, address, clash)
        else:
            self.observation.probes[probe.name] = probe
            self.places[probe.name] = (where, address)

    def signal(self, node: Node, address: str, otherwise: str = "is not recorded") -> Signal | None:
        """The signal at an address; None if it is wrong, unknown, or its block is removed, of which
        a note says what happens ``otherwise``.
        """
        try:
            target = find(self.network.scope, node.value)
        except ReportedError:
            return None
        except AddressError as error:
            self.problems.add(*(error.location or (node.where, address)), error.message)
            return None
        text: str | None = check_output(self.network, target.end, states=True)
        real = follow(self.network, target.end)
        if not text and real is not None:
            shape = whole_shape(self.network, real)
            if shape is None or 8 * math.prod(shape) > MAX_BYTES:
                return None  # reported with the block
            columns = shape[0] if shape and not real.component else 1
            # A path has few points, each of several columns: it is recorded whole.
            is_path = len(shape) > 1 and (real.block, real.port) in self.network.types
            if columns <= MAX_COLUMNS or is_path:
                signal = make_signal(self.network, real, node.value)
                if signal is not None:
                    return signal
                text = no_component(self.network, real)
            else:
                text = f"{columns} columns are too many to record; name one, '{node.value}.0'"
        elif not text:
            block = missing_block(self.network, target.end)
            text = f"'{node.value}' {otherwise}: block '{block}' is removed"
            note = Note(text, "not-recorded", block=block, name=str(node.value))
            if note not in self.observation.notes:
                self.observation.notes.append(note)
            return None
        self.problems.add(*(target.location or (node.where, address)), text)
        return None

    def sources(
        self, owner: Node, key: str, keys: tuple[str, ...], address: str
    ) -> list[tuple[Node, str]]:
        """The addresses or probe names under a key, each with its own address."""
        node = owner.get(key)
        if (node is None and key not in misspelt_keys(owner, keys)) or (node and node.value == []):
            where = owner.key if node is None else node.where
            self.problems.add(where, address, f"missing; expected {_SOURCE}", "missing-value")
        return strings(node, address, _SOURCE, self.problems)

    def tunings(self, owner: Node, key: str, keys: tuple[str, ...], address: str) -> list[str]:
        """Names of the probes of the tuning behind the signals under a key."""
        names = []
        for item, place in self.sources(owner, key, keys, address):
            probe = self.observation.probes.get(item.value)
            signals = (self.signal(item, place),) if probe is None else probe.signals
            for signal in filter(None, signals):
                name = self.tuning(signal, item.where, place)
                if not name:
                    message = "expected the spikes of an Ensemble, as in a.spikes, got "
                    self.problems.add(item.where, place, f"{message}'{signal.address}'")
                names.append(name)
        return [name for name in names if name]

    def tuning(self, signal: Signal, where: Where, address: str) -> str:
        """The name of the probe of the tuning behind a signal; '' if none is published."""
        tuning_signal = make_tuning(self.network, signal.end, signal.address)
        if tuning_signal is None:
            return ""
        self.add(Probe(tuning_signal.address, (tuning_signal,), 0, auto=True), where, address)
        return tuning_signal.address

    def with_sort_order(self, plot: PlotSpec, node: Node, address: str) -> PlotSpec:
        """A raster that needs them, with the preferred directions of its neurons."""
        if plot.options.get("sort") != "direction":
            return plot
        signals = [signal for name in plot.of for signal in self.observation.probes[name].signals]
        names = [self.tuning(signal, node.where, address) for signal in signals]
        for signal, name in zip(signals, names, strict=True):
            if not name:
                message = f"the preferred directions behind '{signal.address}' are not known; "
                message += "expected the spikes of an Ensemble"
                self.problems.add(node.value["sort"].where, f"{address}.sort", message)
        return replace(plot, of=(*plot.of, *filter(None, names)))

    def probe_names(self, owner: Node, key: str, keys: tuple[str, ...], address: str) -> list[str]:
        """Names of the probes for the addresses or probe names under a key."""
        names = []
        for item, place in self.sources(owner, key, keys, address):
            name = item.value
            # With a section probes that could not be read, any name may be one of its entries.
            if "probes" in self.unread and "." not in name:
                continue
            if name not in self.observation.probes and name not in self.declared:
                message = self.no_probe(name)
                if message:
                    self.problems.add(item.where, place, message)
                    continue
                signal = self.signal(item, place)
                if signal is not None:
                    self.add(Probe(name, (signal,), 0, auto=True), item.where, place)
            if name in self.observation.probes:
                names.append(name)
        return names

    def no_probe(self, name: str) -> str:
        """Why a name can be neither a probe's name nor an address; '' if it may be one."""
        head, dot, rest = name.partition(".")
        scope = self.network.scope
        known = {*scope.blocks, *scope.broken, *scope.outputs}
        if not dot and head.partition("[")[0] in known:
            return ""
        if not dot:
            probes, other = [*self.declared, *scope.outputs], f"; expected {_SOURCE}"
            return misspelt("unknown-probe", f"there is no probe '{name}'", name, probes, other)
        if head in self.declared and head not in scope.names():
            return f"'{head}' is a probe; '.{rest}' needs the address that it records"
        owner = name.removesuffix(".time")
        if owner != name and owner in self.declared:
            return f"the times of probe '{owner}' are stored as '{name}'; rename that probe"
        return ""

    def plot(self, name: str, node: Node, address: str) -> None:
        known = partial(plot_kind_names, has_world=self.has_world)
        choice = choose(PLOT_KINDS, node, address, known, self.problems, self.modules)
        if choice is None:
            return
        self.observation.files.update(choice.files)
        kind, definition, keys = choice.name, choice.declared, choice.keys
        read = self.tunings if definition is not None and definition.of_tuning else self.probe_names
        of = read(node, "of", keys, f"{address}.of")
        title = node.get("title")
        if title is not None and not isinstance(title.value, (str, int, float)):
            message = f"expected a string, got {title.describe()}"
            self.problems.add(title.where, f"{address}.title", message)
        options = {key: item.plain() for key, item in node.items() if key not in COMMON}
        if definition is not None:
            self.report(node, keys, address, check_options(definition, options, self.has_world))
        marked, hits = options.get("events"), self.observation.events
        if marked is not None and marked not in hits:
            text = f"there is no probe of events '{marked}'"
            text = misspelt("unknown-probe", text, marked, hits)
            self.report(node, keys, address, [("events", text)])
        if node.get("labels") is not None:
            what = "a string for each line, as in [position, heading]"
            labels = strings(node.get("labels"), f"{address}.labels", what, self.problems)
            options["labels"] = [str(item.value) for item, _ in labels]
            if kind == "timeseries":
                self.count_labels(node, address, len(labels), of)
        for key in () if definition is None else definition.signals:
            if key in options:
                options[key] = self.role_probe(node, key, keys, address)
        if definition is not None and of:
            text = str(title.value) if title is not None else title_of(name)
            options |= used_options(definition, options)
            of_blocks = source_options(
                definition, [self.observation.probes[p] for p in of], self.network
            )
            plot = PlotSpec(name, kind, tuple(of), text, {**of_blocks, **options}, choice.own)
            faults = unfit(plot, self.observation.probes, node.value["of"].plain())
            if faults is not None:
                self.report(node, keys, address, faults)
                self.observation.plots.append(self.with_sort_order(plot, node, address))

    def report(
        self, node: Node, keys: tuple[str, ...], address: str, checks: Iterable[tuple[str, str]]
    ) -> None:
        """Report the errors of entries, except missing ones whose key is misspelt."""
        for key, text in checks:
            item = node.get(key)
            if item is not None or key not in misspelt_keys(node, keys):
                where = node.key if item is None else item.where
                self.problems.add(where, f"{address}.{key}", text)

    def count_labels(self, node: Node, address: str, count: int, of: Sequence[str]) -> None:
        """Report labels of which the last have no line that they could name."""
        lines = sum(len(self.observation.probes[name].labels) for name in of)
        # Lines of removed blocks are missing, and their labels stay in the file.
        if of and count > lines and not self.network.removed:
            message = f"expected a label for each line, {lines} at the most, got {count}"
            self.report(node, (), address, [("labels", message)])

    def metric(self, name: str, node: Node, address: str) -> None:
        known = METRIC_KINDS.names
        choice = choose(METRIC_KINDS, node, address, lambda _: known(), self.problems, self.modules)
        if choice is None or choice.declared is None:
            return
        self.observation.files.update(choice.files)
        definition, keys = choice.declared, choice.keys
        inputs = {key: self.role_probe(node, key, keys, address) for key in definition.inputs}
        for key in definition.optional:
            probe_name = self.role_probe(node, key, keys, address) if node.get(key) else None
            if probe_name is not None:
                inputs[key] = probe_name
        options: dict[str, Any] = {
            key: item.plain()
            for key, item in node.items()
            if key not in ("kind", "module", *definition.inputs, *definition.optional)
        }
        probes = {key: self.observation.probes[p] for key, p in inputs.items() if p is not None}
        infos = {
            key: ProbeInfo(p.shape, p.units, 0 if p.constant else p.every, p.first)
            for key, p in probes.items()
        }
        self.report(node, keys, address, definition.check(options, infos, self.has_world))
        metric = Metric(name, choice.name, inputs, options, choice.own)
        self.observation.metrics.append(metric)
        note = metric.beyond(self.network.until, self.network.time_unit)
        # A constant, of which the only row is at the start, has its value however long the run is.
        if note and any(p.rows(self.network.ticks) != 1 for p in probes.values()):
            self.observation.notes.append(Note(note, "not-reached"))

    def role_probe(self, node: Node, key: str, keys: tuple[str, ...], address: str) -> str | None:
        """The probe of one role of a metric."""
        address, item = f"{address}.{key}", node.get(key)
        if item is not None and item.is_list and len(item.value) > 1:
            message = f"expected one signal, got {item.describe()}; a probe may hold several"
            self.problems.add(item.where, address, message)
            return None
        names = self.probe_names(node, key, keys, address)
        return names[0] if names else None
