"""The class that users work with: a graph that is loaded or built, changed and run."""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

from blocks.core import Block, SignalType
from blocks.library.registry import BUILTIN, Modules, block_texts
from runtime.document import (
    Node,
    Override,
    Source,
    Value,
    add_block,
    add_entry,
    add_names,
    add_wire,
    from_python,
    in_order,
    merge,
    names_in,
    read_graph,
    set_entry,
    set_wire,
)
from runtime.errors import GraphError, MissingExtraError, Where
from runtime.graph.checked import BlockInfo, WireInfo, blocks_of, types_of, wires_of
from runtime.graph.content import CheckedGraph, Content, check_content
from runtime.graph.running import Runnable
from runtime.network import Network, discretize, is_variadic, replace_block
from runtime.observation import Observation

if TYPE_CHECKING:
    from runtime.engine import Program


class Graph(Runnable):
    """A block diagram. A graph never changes: every change returns a changed copy.

    Parameters
    ----------
    dt : base step (s).
    until : length of a run (s).
    seed : of all noise and neurons.
    title : shown in plots and reports.
    """

    _content: Content
    _with_other_seed: Graph | None

    def __init__(
        self, title: str = "graph", *, dt: float = 0.001, until: float = 10.0, seed: int = 0
    ) -> None:
        run = {"dt": dt, "until": until, "seed": seed}
        self._fill(Content(from_python({"graph": title, "run": run, "blocks": {}})))

    def _fill(self, content: Content, with_other_seed: Graph | None = None) -> None:
        object.__setattr__(self, "_content", content)
        object.__setattr__(self, "_with_other_seed", with_other_seed)

    def __setattr__(self, name: str, value: object) -> NoReturn:
        raise AttributeError(f"a graph never changes, so '{name}' cannot be set; use a copy")

    @classmethod
    def _of(cls, content: Content, with_other_seed: Graph | None = None) -> Graph:
        graph = cls.__new__(cls)
        graph._fill(content, with_other_seed)
        return graph

    def _changed(self, document: Node, *overrides: Override, **changes: Any) -> Graph:
        return Graph._of(self._content.changed(document, overrides, **changes))

    @classmethod
    def of_document(cls, document: Node, source: Path, modules: Modules) -> Graph:
        """A graph of a document that is read already, as an editor holds it."""
        return cls._of(Content(document, source=source, modules=modules))

    @property
    def source(self) -> Path | None:
        """The file that the graph was loaded from."""
        return self._content.source

    @property
    def overrides(self) -> tuple[Override, ...]:
        """The changes made since it was loaded or built."""
        return self._content.overrides

    @property
    def notes(self) -> tuple[str, ...]:
        """What :meth:`replace` dropped, and which params a change has made unused."""
        return self._content.notes

    @property
    def document(self) -> Node:
        """The graph as a tree in which every value knows its position in the text."""
        return self._content.document

    @property
    def title(self) -> str:
        return self.network.title

    @cached_property
    def _checked(self) -> CheckedGraph:
        if self._with_other_seed is not None:
            try:
                shared = self._with_other_seed._checked
            except GraphError:
                pass  # the other seed may be what is wrong, and so are the positions of problems
            else:
                seed = (self.document.get("run") or Node({})).plain()["seed"]
                return shared.with_seed(seed)
        return check_content(self._content)

    @property
    def network(self) -> Network:
        """The checked network.

        Raises
        ------
        GraphError : listing all that is wrong.
        MissingExtraError : nothing is wrong, but a block needs a package that is not installed.
        """
        return self._checked.network

    @property
    def observation(self) -> Observation:
        """What a run records, plots and measures; raises as :attr:`network` does."""
        return self._checked.observation

    def program(
        self,
        plots: Container[str] | None = None,
        profiled: bool = False,
        growing: bool = False,
    ) -> Program:
        """What is executed; runs that differ in their seeds alone share it.

        ``plots`` limits what is recorded to the metrics' probes and those of plots of these kinds.
        ``growing`` is for a run whose length is not known.
        """
        return self._checked.program(plots, profiled, growing)

    def check(self) -> Graph:
        """Check everything that can be checked without running; returns the graph.

        Raises
        ------
        GraphError : listing all that is wrong with blocks, wires, loops, probes and metrics.
        """
        self.program()
        return self

    @cached_property
    def blocks(self) -> Mapping[str, BlockInfo]:
        """The blocks of the checked graph by name, with parts expanded; raises as :meth:`check`."""
        return blocks_of(self.network)

    @cached_property
    def wires(self) -> tuple[WireInfo, ...]:
        """The wires into blocks of the checked graph; raises as :meth:`check`."""
        return wires_of(self.network)

    @cached_property
    def types(self) -> Mapping[str, SignalType]:
        """The signal type of each port, by ``block.port``; raises as :meth:`check`."""
        return types_of(self.network)

    @property
    def names(self) -> list[str]:
        """Names of the blocks and parts."""
        return names_in(self.document)

    def add(self, name: str, block: Block, *, dt: float | None = None) -> Graph:
        """A copy with a block added under a name, at its own step ``dt`` (s) if given."""
        cls = type(block)
        classes, signal_types = dict(self._content.classes), dict(self._content.signal_types)
        if BUILTIN.get(cls.__name__) is not cls:
            classes[cls.__name__] = cls
        entry: dict[str, Any] = {"type": cls.__name__, **({} if dt is None else {"dt": dt})}
        for key, value in block.parameters().items():
            if isinstance(value, SignalType):
                signal_types[value.name] = value.sized(None)
            entry[key] = str(value) if isinstance(value, SignalType) else value
        document = add_block(self.document, name, entry)
        return self._changed(document, classes=classes, signal_types=signal_types)

    def connect(self, source: str, target: str) -> Graph:
        """A copy with a wire from ``producer.output`` to ``consumer.input``.

        An input that takes several wires gains one; any other must be open.

        Raises
        ------
        UsageError : there is no such consumer yet, or its input is connected already.
        """
        several = is_variadic(self.document, target, self._content.classes)
        return self._changed(add_wire(self.document, source, target, several))

    def probe(self, name: str, *of: str, **options: Value) -> Graph:
        """A copy that records addresses (its name by default); options as in a graph file."""
        signals: Value = list(of) if len(of) > 1 else of[0] if of else name
        entry: Value = {"of": signals, **options} if options else signals
        key = name if of else name.replace(".", "_")
        return self._changed(add_entry(self.document, "probes", key, entry))

    def plot(self, name: str, kind: str, *of: str, **options: Value) -> Graph:
        """A copy that draws probes or addresses in a plot."""
        entry = {"kind": kind, "of": list(of), **options}
        return self._changed(add_entry(self.document, "plots", name, entry))

    def metric(self, name: str, kind: str, of: str | None = None, **options: Value) -> Graph:
        """A copy that measures a probe or address."""
        entry = {"kind": kind, **({} if of is None else {"of": of}), **options}
        return self._changed(add_entry(self.document, "metrics", name, entry))

    def _with_known_names(self, origin: str, place: str) -> Graph:
        """This graph, once the names in a change made at ``place`` are known to exist.

        Changes on a command line have an ``origin``; they are checked together at the end, so
        that all problems are reported.

        Raises
        ------
        GraphError : a name in the change does not exist.
        """
        if not origin:
            try:
                _ = self.network
            except GraphError as error:
                wrong = [p for p in error.problems if p.is_name and p.where.file == place]
                if wrong:
                    raise GraphError(wrong) from None
            except MissingExtraError:
                pass  # a package that only a run needs
        return self

    def set(self, path: str, value: Value, *, origin: str = "") -> Graph:
        """A copy with one entry changed, as in ``set("blocks.lqr.q", [1, 1, 1])``.

        Raises
        ------
        GraphError : the path, or a parameter that it names, does not exist.
        """
        return self._set(path, value, origin)._with_known_names(origin, f"set {path}")

    def _set(self, path: str, value: Value, origin: str = "") -> Graph:
        """The copy of :meth:`set`, its names not checked yet."""
        node: Any = value
        read: dict[str, bytes] = {}
        if path.strip() == "world" and isinstance(value, str):
            # The world's nodes keep their positions in its file.
            document, read = read_graph({"world": value})
            node = document.get("world")
        changed = set_entry(self.document, path, node, origin)
        override = Override("set", path, repr(value))
        return self._changed(changed, override, files={**self._content.files, **read})

    def wire(self, consumer: str, source: str | Sequence[str] | None, *, origin: str = "") -> Graph:
        """A copy with one input connected to another source: ``wire("lqr.error", "error.state")``.

        Raises
        ------
        GraphError, UsageError : an end of the wire does not exist.
        """
        place = f"wire {consumer}"
        changed = set_wire(self.document, consumer, source, origin or place)
        override = Override("wire", consumer, str(source))
        return self._changed(changed, override)._with_known_names(origin, place)

    def overlay(self, source: Source, unsaved: Mapping[Path, str] | None = None) -> Graph:
        """A copy with another graph merged over it; ``unsaved`` texts take the place of files."""
        document, read = read_graph(source, unsaved)
        override = Override("with", "mapping" if isinstance(source, Mapping) else str(source))
        # The file that this graph was loaded from stays as it was read then.
        files = {**read, **self._content.files}
        return self._changed(merge(self.document, document), override, files=files)

    def without(self, *names: str, origin: str = "") -> Graph:
        """A copy without these blocks or parts and their wires.

        Raises
        ------
        GraphError : there is no such block.
        """
        return self._with_names("without", names, origin)

    def bypass(self, *names: str, origin: str = "") -> Graph:
        """A copy with these blocks bypassed: what they take in passes straight through.

        Raises
        ------
        GraphError : there is no such block.
        """
        return self._with_names("bypass", names, origin)

    def _with_names(self, kind: str, names: tuple[str, ...], origin: str) -> Graph:
        changed = add_names(self.document, kind, names, origin)
        graph = self._changed(changed, *(Override(kind, name) for name in names))
        return graph._with_known_names(origin, kind)

    def begin_from(self, run: str | Path, *addresses: str, origin: str = "") -> Graph:
        """A copy that begins with the states that a run ended with.

        Parameters
        ----------
        run : the folder of a run, or a link to it.
        addresses : blocks (``snn``) or states (``snn.weights``); without them, every block of the
            same name whose states have the same shapes.
        """
        folder = str(Path(run).absolute())
        if not addresses:
            changed = self.document.with_item("from", Node(folder, Where(origin), Where(origin)))
        else:
            named = self.document.get("initial")
            entries = dict(named.items()) if named is not None and named.is_map else {}
            new = Node(folder, Where(origin), Where(origin))
            entries |= dict.fromkeys(addresses, new)
            changed = self.document.with_item("initial", Node(entries, Where(origin)))
        target = f"{run}: {', '.join(addresses)}" if addresses else str(run)
        return self._changed(changed, Override("from", target))

    def replace(self, name: str, kind: str, *, origin: str = "") -> Graph:
        """A copy with a block of another type in a block's place: ``replace("lqr", "PathPID")``.

        Parameters and wires that the new type has as well stay; ``notes`` lists what is dropped.
        """
        changed, notes = replace_block(
            self.document, name, kind, self._content.classes, origin, self._content.modules
        )
        override = Override("replace", name, kind)
        return self._changed(changed, override, notes=notes)

    def discretized(
        self, method: str, dt: float | None = None, *names: str, origin: str = ""
    ) -> Graph:
        """A copy with continuous blocks, or those named, in discrete time with a step ``dt`` (s).

        ``method`` is "tustin", "zoh" (exact for inputs that hold) or "matched"; ``notes`` list
        what was replaced: PID, TransferFunction and its like, StateSpace, Integrator.

        Raises
        ------
        GraphError : the graph is wrong. UsageError : a name or the method is.
        """
        step = self.network.dt if dt is None else dt
        changed, notes = discretize(self.network, self.document, method, step, names, origin)
        target = ", ".join(names) or "all"
        return self._changed(changed, Override("discretize", target, method), notes=tuple(notes))

    def with_seed(self, seed: int) -> Graph:
        """A copy with another seed, which shares what is checked and planned."""
        changed = self._set("run.seed", seed)
        if type(seed) is not int or seed < 0:
            return changed
        return Graph._of(changed._content, self._with_other_seed or self)

    def to_dict(self, *, modules: bool = False) -> dict[str, Value]:
        """The graph as plain values; ``modules`` adds the files of classes that Python gave."""
        plain = in_order(self.document.plain())
        if not modules:
            return plain
        from runtime.graph.saving import with_modules

        return with_modules(plain, self._content.classes)

    @property
    def texts(self) -> dict[str, bytes]:
        """The content, as it was read, of the graph's files and of those that its blocks name.

        The keys are the files' resolved paths.
        """
        own: dict[str, bytes] = {}
        for entry in (*self.network.entries.values(), *self.network.removed_entries.values()):
            own |= block_texts(entry.cls, entry.block_or_none)
        return {**self._content.files, **self.observation.files, **own}

    def to_yaml(self) -> str:
        """The graph as YAML from which :func:`runtime.load` reads an equal graph."""
        from runtime.graph.saving import as_text

        return as_text(self.to_dict(modules=True))

    def save(self, path: str | Path) -> None:
        """Write the graph to ``my.yaml``, and arrays that were given in Python to ``my.npz``."""
        from runtime.graph.saving import save

        save(self.to_dict(modules=True), Path(path))

    def __eq__(self, other: object) -> bool:
        from runtime.graph.saving import without_modules

        return isinstance(other, Graph) and (
            without_modules(self.to_dict()) == without_modules(other.to_dict())
        )

    __hash__ = None  # type: ignore[assignment]

    def __repr__(self) -> str:
        return f"<Graph '{self.document.plain().get('graph')}': {', '.join(self.names)}>"

    def diagram(
        self,
        format: str = "svg",
        paper: float | None = None,
        detail: Iterable[str] | None = None,
    ) -> str | bytes:
        """The block diagram as svg, png, pdf, tikz, dot or mermaid.

        ``paper`` is the width of a column (points), for a diagram in rows; ``detail`` is what it
        shows beside names and wires, of "blocks", "types" (of signals), "rates", "ports", "values"
        and "probes". Both are for svg, png, pdf and tikz.
        """
        from runtime.diagrams import diagram

        return diagram(self.network, format, paper, self.observation.probes.values(), detail)

    def _repr_svg_(self) -> str | None:
        """The diagram for a notebook; None, for which it shows the text, if there is none."""
        try:
            return str(self.diagram("svg")._repr_svg_())  # type: ignore[union-attr]
        except Exception:  # noqa: BLE001 -- a display hook must not raise
            return None
