"""A graph in Python: load it, build it, change it, run it."""

from __future__ import annotations

from collections.abc import Callable, Container, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.core import Block, SignalType
from blocks.registry import BUILTIN, module_text
from runtime.document import (
    Node,
    add_names,
    dump_yaml,
    from_python,
    merge,
    read_graph,
    set_entry,
    set_wire,
)
from runtime.errors import GraphError, MissingExtraError, Problems, UsageError
from runtime.network import Network, build, replace_block, source_file
from runtime.observation import Observation, observe

if TYPE_CHECKING:
    from runtime.engine import Program
    from runtime.runs import PreparedRun, Result

SECTION_ORDER = (
    *("graph", "run", "params", "blocks", "wires", "without", "bypass"),
    *("probes", "plots", "metrics"),
)


class Graph:
    """A block diagram. ``set``, ``wire``, ``without``, ``bypass`` and ``replace`` return
    changed copies; ``add``, ``connect``, ``probe``, ``plot`` and ``metric`` build one up in place.

    Parameters
    ----------
    dt : base step (s).
    until : length of a run (s).
    seed : of all noise and neurons.
    title : what a plot's title says.
    """

    source: Path | None
    overrides: tuple[str, ...]
    notes: tuple[str, ...]
    modules: bool
    read: dict[str, bytes]
    _document: Node
    _classes: dict[str, type[Block]]
    _kinds: dict[str, SignalType]

    def __init__(
        self, title: str = "graph", *, dt: float = 0.001, until: float = 10.0, seed: int = 0
    ) -> None:
        run = {"dt": dt, "until": until, "seed": seed}
        empty = Graph._of(from_python({"graph": title, "run": run, "blocks": {}}))
        self.__dict__.update(empty.__dict__)

    @classmethod
    def _of(
        cls,
        document: Node,
        classes: Mapping[str, type[Block]] | None = None,
        source: Path | None = None,
        overrides: tuple[str, ...] = (),
        modules: bool = True,
        read: Mapping[str, bytes] | None = None,
    ) -> Graph:
        graph = cls.__new__(cls)
        graph._document = document
        graph._classes = dict(classes or {})
        graph._kinds = {}
        graph.source = source
        graph.overrides = overrides
        graph.read = dict(read or {})
        graph.notes = ()
        graph.modules = modules
        return graph

    def _changed(self, document: Node, *overrides: str) -> Graph:
        changes = (*self.overrides, *overrides)
        changed = Graph._of(document, self._classes, self.source, changes, self.modules, self.read)
        changed.notes = self.notes
        changed._kinds = dict(self._kinds)
        return changed

    @property
    def document(self) -> Node:
        """The graph as a tree that knows where its text stands."""
        return self._document

    @property
    def title(self) -> str:
        return self.network.title

    @cached_property
    def _checked(self) -> tuple[Network, Observation]:
        problems = Problems()
        network, missing = build(self._document, problems, self._classes, self._kinds, self.modules)
        observation = observe(network, problems)
        problems.raise_any()
        if missing is not None:
            raise missing
        return network, observation

    @property
    def network(self) -> Network:
        """The checked network.

        Raises
        ------
        GraphError : listing all that is wrong.
        MissingExtraError : all is well but for a package that a block needs.
        """
        return self._checked[0]

    @property
    def observation(self) -> Observation:
        """What a run records, draws and measures; raises as :attr:`network` does."""
        return self._checked[1]

    def program(self, plots: Container[str] | None = None, profiled: bool = False) -> Program:
        """What runs of this graph share, whatever their seeds.

        ``plots`` limits what is recorded to the metrics' probes and those of plots of these kinds.
        """
        from runtime.engine import Program

        programs = self.__dict__.setdefault("_programs", {})
        key = (None if plots is None else repr(plots), profiled)
        if key not in programs:
            seen = self.observation
            reduced = seen if plots is None else seen.reduced(plots)
            programs[key] = Program(self.network, reduced, profiled)
        made: Program = programs[key]
        return made

    def check(self) -> Graph:
        """Check everything that can be checked without running; returns the graph.

        Raises
        ------
        GraphError : listing all that is wrong with blocks, wires, loops, probes and metrics.
        """
        self.program()
        return self

    def _edit(self, document: Node) -> Graph:
        self._document = document
        self.__dict__.pop("_checked", None)
        self.__dict__.pop("_programs", None)
        return self

    def add(self, name: str, block: Block, *, dt: float | None = None) -> Graph:
        """Add a block under a name, at its own step ``dt`` (s) if given."""
        kind = type(block)
        if name in self.names:
            raise UsageError(f"there is a block '{name}' already; blocks have names of their own")
        entry: dict[str, Any] = {"type": kind.__name__}
        if BUILTIN.get(kind.__name__) is not kind:
            self._classes[kind.__name__] = kind
        if dt is not None:
            entry["dt"] = dt
        for key, value in block.parameters().items():
            if isinstance(value, SignalType):
                self._kinds[value.name] = value.sized(None)
            entry[key] = str(value) if isinstance(value, SignalType) else value
        blocks = self._document.get("blocks") or Node({})
        return self._edit(
            self._document.with_item("blocks", blocks.with_item(name, from_python(entry)))
        )

    @property
    def names(self) -> list[str]:
        """Names of the blocks and parts."""
        blocks = self._document.get("blocks")
        return [name for name, _ in blocks.items()] if blocks is not None else []

    def connect(self, source: str, target: str) -> Graph:
        """Wire ``producer.output`` to ``consumer.input``; an input that takes many gains a term."""
        block, _, port = target.partition(".")
        entry = (self._document.get("blocks") or Node({})).get(block)
        kind = entry.get("type") if entry is not None else None
        cls = {**BUILTIN, **self._classes}.get(str(kind.value)) if kind is not None else None
        declared = cls.spec.inputs.get(port) if cls is not None else None
        value: Any = source
        wires = self._document.get("wires") or Node({})
        old = (wires.get(block) or Node({})).get(port)
        if declared is not None and declared.variadic:
            value = [*(old.plain() if old is not None else []), source]
        elif old is not None:
            raise UsageError(
                f"'{target}' is wired to '{old.plain()}' already; use wire() to move it"
            )
        return self._edit(set_wire(self._document, target, value))

    def _observe(self, section: str, name: str, entry: Any) -> Graph:
        found = self._document.get(section) or Node({})
        added = found.with_item(name, from_python(entry))
        return self._edit(self._document.with_item(section, added))

    def probe(self, name: str, *of: str, every: int | None = None) -> Graph:
        """Record addresses under a name; without addresses, the name is the address."""
        addresses = list(of) or [name]
        key = name if of else name.replace(".", "_")
        entry: dict[str, Any] = {"of": addresses if len(addresses) > 1 else addresses[0]}
        if every is not None:
            entry["every"] = every
        return self._observe("probes", key, entry if every is not None else entry["of"])

    def plot(self, name: str, kind: str, *of: str, **options: Any) -> Graph:
        """Draw probes or addresses in a picture."""
        return self._observe("plots", name, {"kind": kind, "of": list(of), **options})

    def metric(self, name: str, kind: str, of: str | None = None, **options: Any) -> Graph:
        """Measure a probe or address."""
        entry = {"kind": kind, **({} if of is None else {"of": of}), **options}
        return self._observe("metrics", name, entry)

    def _named(self, origin: str, place: str) -> Graph:
        """This graph, once the names that a change gave are known to stand for something.

        Changes of a command line are checked together at the end, so that all are reported.

        Raises
        ------
        GraphError : a name at this place stands for nothing.
        """
        if not origin:
            try:
                _ = self.network
            except GraphError as error:
                wrong = [p for p in error.problems if p.is_name and p.where.file == place]
                if wrong:
                    raise GraphError(wrong) from None
            except MissingExtraError:
                pass  # what a run needs is no matter of names
        return self

    def set(self, path: str, value: Any, *, origin: str = "") -> Graph:
        """A copy with one entry changed, as in ``set("blocks.lqr.q", [1, 1, 1])``.

        Raises
        ------
        GraphError : the path, or a parameter that it names, does not exist.
        """
        return self._set(path, value, origin)._named(origin, f"set {path}")

    def _set(self, path: str, value: Any, origin: str = "") -> Graph:
        """The copy of :meth:`set`, not looked at yet."""
        node: Any = value
        read: dict[str, bytes] = {}
        if path.strip() == "world" and isinstance(value, str):
            # The world's nodes keep the places where they stand in its file.
            document, read = read_graph({"world": value})
            node = document.get("world")
        changed = set_entry(self._document, path, node, origin)
        graph = self._changed(changed, f"set {path}={value!r}")
        graph.read |= read
        return graph

    def wire(self, consumer: str, source: Any, *, origin: str = "") -> Graph:
        """A copy with one input wired anew, as in ``wire("lqr.error", "error.state")``.

        Raises
        ------
        GraphError, UsageError : an end of the wire does not exist.
        """
        place = f"wire {consumer}"
        changed = set_wire(self._document, consumer, source, origin or place)
        return self._changed(changed, f"wire {consumer}={source}")._named(origin, place)

    def overlay(self, source: str | Path | Mapping[str, Any]) -> Graph:
        """A copy with another graph, or part of one, laid on top as ``extends`` would."""
        document, read = read_graph(source)
        name = "mapping" if isinstance(source, Mapping) else source
        changed = self._changed(merge(self._document, document), f"with {name}")
        # The file that this graph came from stays as it was read then.
        changed.read = read | changed.read
        return changed

    def without(self, *names: str, origin: str = "") -> Graph:
        """A copy without these blocks or parts and their wires.

        Raises
        ------
        GraphError : there is no such block.
        """
        changed = add_names(self._document, "without", names, origin)
        graph = self._changed(changed, *(f"without {name}" for name in names))
        return graph._named(origin, "without")

    def bypass(self, *names: str, origin: str = "") -> Graph:
        """A copy with the through-pair of these blocks wired straight.

        Raises
        ------
        GraphError : there is no such block.
        """
        changed = add_names(self._document, "bypass", names, origin)
        graph = self._changed(changed, *(f"bypass {name}" for name in names))
        return graph._named(origin, "bypass")

    def replace(self, name: str, kind: str, *, origin: str = "") -> Graph:
        """A copy with a block of another type in a block's place, as in ``replace("lqr", "PID")``.

        Parameters and wires that the new type has as well stay; ``notes`` says what fell away.
        """
        changed, notes = replace_block(
            self._document, name, kind, self._classes, origin, self.modules
        )
        graph = self._changed(changed, f"replace {name}={kind}")
        graph.notes = (*self.notes, *notes)
        return graph

    def with_seed(self, seed: int) -> Graph:
        """A copy with another seed, which shares the checked network if that is built already."""
        changed = self._set("run.seed", seed)
        checked = self.__dict__.get("_checked")
        if checked is not None and type(seed) is int and seed >= 0:
            network, observation = checked
            changed.__dict__["_checked"] = (replace(network, seed=seed), observation)
            changed.__dict__["_programs"] = self.__dict__.setdefault("_programs", {})
        return changed

    def run(
        self,
        *,
        seed: int | None = None,
        until: float | None = None,
        engine: str | None = None,
        progress: Callable[[int, int], None] | None = None,
    ) -> Result:
        """Simulate; see :class:`runtime.runs.result.Result`.

        ``engine`` is "python", "compiled" or "auto", which compiles where that repays itself.

        Raises
        ------
        GraphError : the graph cannot run.
        SimulationError : it failed on the way; ``error.result`` holds what was recorded.
        """
        from runtime.runs import simulate

        graph = self
        if seed is not None:
            graph = graph.with_seed(seed)
        if until is not None:
            graph = graph._set("run.until", until)
        if engine is not None:
            graph = graph._set("run.engine", engine)
        return simulate(graph.prepared(), progress)

    def prepared(self, plots: Container[str] | None = None, profiled: bool = False) -> PreparedRun:
        """All that a run needs of the graph; ``plots`` and ``profiled`` as for :meth:`program`."""
        from runtime.runs import PreparedRun

        return PreparedRun(
            self.program(plots, profiled),
            self.network,
            self.to_dict,
            self.source,
            self.texts,
            self.overrides,
            self.notes,
        )

    def to_dict(self) -> dict[str, Any]:
        """The graph as plain values, sections in their usual order."""
        plain = self._document.plain()
        ordered = {key: plain[key] for key in SECTION_ORDER if key in plain}
        return {**ordered, **{key: value for key, value in plain.items() if key not in ordered}}

    @property
    def texts(self) -> dict[str, bytes]:
        """The content, as it was read, of the graph's files and of those of its own blocks.

        The keys are the files' resolved paths.
        """
        own: dict[str, bytes] = {}
        for entry in (*self.network.entries.values(), *self.network.ghosts.values()):
            own |= module_text(entry.cls)
        return self.read | own

    def to_yaml(self) -> str:
        """The graph as a text that :func:`runtime.load` reads back equal."""
        plain = self.to_dict()
        for entry in plain.get("blocks", {}).values():
            cls = self._classes.get(entry.get("type", ""))
            if cls is not None and "module" not in entry:
                entry["module"] = source_file(cls)
        return dump_yaml(plain)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Graph) and self._comparable() == other._comparable()

    def _comparable(self) -> dict[str, Any]:
        plain = self.to_dict()
        for entry in plain.get("blocks", {}).values():
            entry.pop("module", None)
        return plain

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Graph '{self._document.plain().get('graph')}': {', '.join(self.names)}>"

    def diagram(self, format: str = "svg") -> str | bytes:
        """The block diagram as svg, png, dot or mermaid."""
        from runtime.diagrams import diagram

        return diagram(self.network, format)

    def _repr_svg_(self) -> str | None:
        """The diagram for a notebook; None, which shows the text in its place, if there is none."""
        try:
            return str(self.diagram("svg"))
        except Exception:  # noqa: BLE001 -- what shows a graph must not hide where it went wrong
            return None


def load(source: str | Path | Mapping[str, Any], *, modules: bool = True) -> Graph:
    """Load a graph from a file, the name of a shipped graph, or a mapping.

    Loading reads text alone. Python files that the text names as ``module`` are imported when the
    graph is checked, and never with ``modules=False``: their blocks are then errors.

    Raises
    ------
    GraphError : the text cannot be read. Use :meth:`Graph.check` for the graph itself.
    """
    document, read = read_graph(source)
    path = None if isinstance(source, Mapping) else Path(document.where.file)
    return Graph._of(document, source=path, modules=modules, read=read)
