"""What a block has during a run: its surroundings in the graph, and the data that change.

The engine makes one :class:`BlockState` for each block, with the arrays that it declares; its
``context`` says what is wired to it::

    state.context.types["input"]   # Vector(3)
    state.x[0] += state.dt         # a state declared as x = State(1)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from blocks.core.params import ParameterError
from blocks.core.signals import SignalType


def _alone(name: str) -> None:
    """The neighbour of a block that has none."""


@dataclass(frozen=True)
class BlockContext:
    """The surroundings of a block in a built graph.

    dt : the block's own step (s).
    types : the resolved signal type of each port.
    terms : for each variadic input, one flag per term as written: whether it is still connected
        (removing a block removes its wires).
    world : the :class:`blocks.World` of the graph's ``world:`` section; None without one.
    lengths : the lengths that are known, by symbol: of ports, and those that arrived with wires.
    published : the block behind each input whose wire comes from an output that publishes a
        description.
    until : the length of the run (s); None if it is not known.
    moving : those inputs that the block recalls and that may change between two ticks.
    located : whether the block's events are located between ticks (``run.events``).
    wired : its inputs that something is wired to.
    sampled : whether the graph gives the block a step of its own.
    neighbour : another block of the same part by name, with its context; None if there is none.
    """

    dt: float
    types: Mapping[str, SignalType]
    terms: Mapping[str, tuple[bool, ...]] = field(default_factory=dict)
    world: object = None
    lengths: Mapping[str, int] = field(default_factory=dict)
    published: Mapping[str, Any] = field(default_factory=dict)
    until: float | None = None
    moving: tuple[str, ...] = ()
    located: bool = False
    wired: frozenset[str] = frozenset()
    sampled: bool = False
    neighbour: Callable[[str], tuple[Any, BlockContext] | None] = field(
        default=_alone, compare=False, repr=False
    )

    def __getstate__(self) -> dict[str, Any]:
        """Without the neighbours, which another process does not have."""
        return {**vars(self), "neighbour": _alone}

    def count(self, port: str) -> int:
        """The number of terms of a variadic input whose terms are told apart by their places.

        Raises
        ------
        ParameterError : one is not connected, which would shift those after it.
        """
        flags = self.terms[port]
        if not all(flags):
            place = f"{port}[{flags.index(False)}]"
            message = f"the block that was wired to {place} is removed, which would shift the "
            message += (
                "components after it; wire another signal there, or remove this block as well"
            )
            raise ParameterError([(port, message)])
        return len(flags)


class BlockState:
    """The data of one block that change during a run; created by the engine.

    The arrays that the block declares are attributes; an assignment to one of them writes into
    it, so that probes and both engines see it. Further attributes: ``context``, its step ``dt``,
    and ``rng``, the block's own generator; ``published``, for each input that has one, the static
    description that its producer publishes. ``start`` may add what it derives from parameters.

    Every array is stored as a view: an output that is one of them, or a part of one, has a
    ``base``, from which the engine sees that it must be copied.
    """

    def __init__(
        self, context: BlockContext, seed: np.random.SeedSequence, arrays: Mapping[str, Any]
    ) -> None:
        # Past __setattr__, which asks for it.
        self.__dict__["_declared"] = frozenset(arrays)
        self.__dict__.update({name: array.view() for name, array in arrays.items()})
        self.context = context
        self.dt = context.dt
        self.reseed(seed)
        self.is_seed_read = False
        self.published: Mapping[str, Any] = {}

    def __setattr__(self, name: str, value: Any) -> None:
        held = self.__dict__
        if name in held["_declared"]:
            # After `state.x += 1` it is the array itself that is assigned.
            if value is not held[name]:
                held[name][...] = value
        elif isinstance(value, np.ndarray) and value.base is None:
            held[name] = value.view()
        else:
            held[name] = value

    @property
    def seed(self) -> np.random.SeedSequence:
        """The block's own seed. That it was read is kept: the state may depend on it from then on.

        ``is_seed_read`` says so; ``rng`` reads it, too.
        """
        self.is_seed_read = True
        held: np.random.SeedSequence | Callable[[], np.random.SeedSequence]
        held = self.__dict__["seed"]
        if not isinstance(held, np.random.SeedSequence):
            held = self.__dict__["seed"] = held()
        return held

    def reseed(self, seed: np.random.SeedSequence | Callable[[], np.random.SeedSequence]) -> None:
        """Give the block another seed; a generator that was made of the last one stays.

        A function makes it when it is first read: of few blocks it ever is.
        """
        self.__dict__["seed"] = seed

    @cached_property
    def rng(self) -> np.random.Generator:
        return np.random.Generator(np.random.PCG64(self.seed))

    if TYPE_CHECKING:

        def __getattr__(self, name: str) -> Any: ...
