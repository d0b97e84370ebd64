"""A block with memory, and a loop around it: a car that brakes.

    python examples/stateful_block.py

``State`` declares what changes; ``start`` sets it, ``update`` changes it once per tick, and
``output`` only reads it. The output does not name an input, so the block closes a loop.
"""

from __future__ import annotations

from blocks import Block, BlockState, Gain, Input, Output, Scalar, State, Sum, param
from runtime import Graph, check_block


class Car(Block):
    """A car on a road that drags: m v' = force - drag v, by Euler's method."""

    force = Input(Scalar, unit="N")
    speed = Output(Scalar, unit="m/s")

    mass: float = param(1000.0, unit="kg", above=0.0, doc="of the car")
    drag: float = param(50.0, unit="N s/m", at_least=0.0, doc="resistance per speed")
    v0: float = param(20.0, unit="m/s", doc="speed at the start")

    v = State(unit="m/s", doc="speed")
    travelled = State(unit="m", doc="way, which a probe may record")

    def start(self, state: BlockState) -> None:
        state.v = self.v0

    def output(self, state: BlockState, t: float) -> float:
        return float(state.v)

    def update(self, state: BlockState, t: float, force: float) -> None:
        state.travelled += state.dt * state.v
        state.v += state.dt * (force - self.drag * state.v) / self.mass


if __name__ == "__main__":
    check_block(Car())
    graph = Graph("braking", dt=0.01, until=60.0)
    graph = graph.add("car", Car()).add("brake", Gain(gain=-200.0)).add("force", Sum())
    graph = graph.connect("car.speed", "brake.input").connect("brake.out", "force.terms")
    graph = graph.connect("force.out", "car.force").probe("car.speed").probe("car.travelled")
    result = graph.run()
    print(f"{result['car.speed'][-1]:.3g} m/s after {result['car.travelled'][-1]:.1f} m")
