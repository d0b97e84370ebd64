"""What a graph consists of, and what checking it yields."""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from blocks.core import Block, SignalType
from blocks.library.registry import Modules, is_built_in
from runtime.document import Node, Override, without_unused
from runtime.errors import GraphError, MissingExtraError, Problem, Problems
from runtime.network import BlockCache, Network, build
from runtime.observation import Observation, observe

if TYPE_CHECKING:
    from runtime.engine import Program


Programs = dict[tuple[str | None, bool, bool], "Program"]


@dataclass
class Reuse:
    """What a graph and its changed copies share, of the one that was checked last.

    Everything is checked again; what a change does not touch is only not made again: a block with
    the same parameters, and the texts and the compiled code of a program with the same plan. So a
    sweep over a number constructs one block anew.
    """

    blocks: dict[tuple[type[Block], str], Block] = field(default_factory=dict)
    programs: Programs = field(default_factory=dict)

    def keep(self, blocks: Mapping[tuple[type[Block], str], Block], network: Network) -> None:
        """Keep the blocks of a network; not those that may depend on more than their parameters.

        They are blocks of users, and blocks that have read a file.
        """
        used = {id(entry.block_or_none) for entry in network.entries.values()}
        self.blocks = {
            key: block
            for key, block in blocks.items()
            if id(block) in used and is_built_in(key[0]) and not block.files
        }


@dataclass(frozen=True)
class Content:
    """All that a graph consists of.

    classes, signal_types : of blocks that were added in Python, by name.
    source : the file that the graph was loaded from. files : content of all files read.
    modules : whether Python files that the graph names may be imported, or how they are read.
    block_cache : blocks that were constructed before, of other graphs, too.
    is_part : whether it is the file of a part, whose inputs come from outside.
    reuse : what the copies of a graph share.
    """

    document: Node
    classes: Mapping[str, type[Block]] = field(default_factory=dict)
    signal_types: Mapping[str, SignalType] = field(default_factory=dict)
    source: Path | None = None
    overrides: tuple[Override, ...] = ()
    notes: tuple[str, ...] = ()
    modules: Modules = True
    files: Mapping[str, bytes] = field(default_factory=dict)
    block_cache: BlockCache | None = None
    is_part: bool = False
    reuse: Reuse = field(default_factory=Reuse, compare=False)

    def changed(
        self,
        document: Node,
        overrides: Sequence[Override],
        notes: Sequence[str] = (),
        **changes: Any,
    ) -> Content:
        """With another document; a param that the change makes unused is left out, with a note."""
        document, unused = without_unused(self.document, document)
        all_overrides, all_notes = (*self.overrides, *overrides), (*self.notes, *notes, *unused)
        return replace(self, document=document, overrides=all_overrides, notes=all_notes, **changes)


@dataclass(frozen=True)
class CheckedGraph:
    """What checking a graph yields; copies with another seed share the programs."""

    network: Network
    observation: Observation
    programs: Programs = field(default_factory=dict)
    earlier: Programs = field(default_factory=dict)

    def program(
        self, plots: Container[str] | None, profiled: bool, growing: bool = False
    ) -> Program:
        from runtime.engine import Program

        # Rows in memory that are dropped, instead of arrays as long as the run.
        growing = growing or self.network.keep is not None
        key = (None if plots is None else repr(plots), profiled, growing)
        if key not in self.programs:
            observation = self.observation if plots is None else self.observation.only_for(plots)
            earlier = self.earlier.get(key)
            program = Program(self.network, observation, profiled, earlier, growing)
            self.programs[key] = self.earlier[key] = program
        return self.programs[key]

    def with_seed(self, seed: int) -> CheckedGraph:
        """The same with another seed; the programs are shared."""
        return replace(self, network=replace(self.network, seed=seed))


@dataclass(frozen=True)
class Examination:
    """A graph as far as it could be read, and all that is wrong with it.

    ``network`` and ``observation`` are None where reading stopped at a limit; ``missing`` is the
    error of a block whose package is not installed.
    """

    problems: list[Problem]
    network: Network | None = None
    observation: Observation | None = None
    missing: MissingExtraError | None = None


def examine(content: Content, loops: bool = False) -> Examination:
    """Check a graph however much is wrong with it; ``loops`` looks for algebraic loops as well."""
    problems = Problems()
    network = observation = missing = None
    blocks = dict(content.reuse.blocks) if content.block_cache is None else content.block_cache
    try:
        network, missing = build(
            content.document,
            problems,
            content.classes,
            content.signal_types,
            content.modules,
            blocks,
            content.is_part,
        )
        content.reuse.keep(blocks, network)
        observation = observe(network, problems, content.modules)
    except GraphError as error:
        return Examination(error.problems, network)
    if loops and not problems.items:
        try:
            CheckedGraph(network, observation).program(None, False)
        except GraphError as error:
            problems.items += error.problems
    return Examination(problems.items, network, observation, missing)


def check_content(content: Content) -> CheckedGraph:
    """Check a graph.

    Raises
    ------
    GraphError : listing all that is wrong.
    MissingExtraError : nothing is wrong, but a block needs a package that is not installed.
    """
    examination = examine(content)
    if examination.problems or examination.network is None or examination.observation is None:
        raise GraphError(examination.problems)
    if examination.missing is not None:
        raise examination.missing
    network, observation = examination.network, examination.observation
    return CheckedGraph(network, observation, earlier=content.reuse.programs)
