"""What random blocks have in common; each module of them begins with this text."""

import math  # noqa: F401  (for the methods)

import numpy as np

from blocks import Block, FloatArray, Input, Output, Scalar, State, Vector, param

# What they receive, by tick: of quarters, so that sums of a few products are exact in any order.
X = (1.5, 0.5, -0.75, 2.25, 0.0, -3.0, 1.0)
V = (
    *((1.0, 2.0, -0.5, 0.25), (1.5, -1.0, 0.0, 3.0), (0.5, 2.5, -0.75, -2.0)),
    *((-0.0, 1.0, 1.0, 4.0), (3.0, -1.5, 0.25, 0.0), (-2.0, -0.25, -4.0, -1.0)),
    (0.75, 0.0, 2.0, -3.5),
)
DT = 0.01
SCALE = 0.75
COUNT = 5
# For each block, when it begins (s), and what its state h begins with.
SETUP = {}


def cube(y):
    return y * y * y


def shifted(y, by=0.5):
    return y - by


def factorial(k):
    return 1 if k <= 1 else k * factorial(k - 1)


def fibonacci(k):
    a, b = 0, 1
    for _ in range(k):
        a, b = b, a + b
    return a


def gained(y, g=SCALE, at=(1, 0.5)):
    return y * g + at[0] - at[1]


# Memory that all runs share, by block, since a graph has many.
NUMBERS = {}
LAST = 0.0


def bumped(name, y):
    global LAST
    LAST = y
    NUMBERS[name] += LAST
    return NUMBERS[name]


def summed(name, y, sums={}):  # noqa: B006  (memory of its kind)
    sums[name] = sums.get(name, 0.0) * 0.5 + y
    return sums[name]


def adder():
    total, times = 0.0, [0]

    def add(y):
        nonlocal total
        total = total * 0.5 + y
        times[0] += 1
        return total + times[0]

    return add


class Helper:
    """Writes into an array that belongs to a state."""

    def __init__(self, array):
        self.array, self.last = array, 0.0

    def add(self, y):
        self.array[0] += y
        self.last, before = y, self.last
        return before


def first_of(a, b):
    return a if a[0] > b[0] else b


class Feed(Block):
    """Other numbers on every tick."""

    x = Output(Scalar)
    v = Output(Vector(4))

    def output(self, state, t):
        k = round(t / DT)
        return X[k], np.array(V[k])


class Base(Block):
    """What random blocks have in common."""

    x = Input(Scalar)
    v = Input(Vector(4))

    a: float = param(0.75, doc="a number")
    n: int = param(3, doc="an integer")
    flag: bool = param(True, doc="a flag")
    mode: str = param("fast", choices=("fast", "slow"), doc="a text")
    p: FloatArray = param([2.0, -1.0, 0.5], shape=(3,), doc="an array")

    count = 0.0
    begin = State()
    h = State(4)
    g = State(2, 3)
    s = State()

    def start(self, state):
        state.begin, first = SETUP[type(self).__name__]
        state.h = first
        state.g = [[1.0, -0.5, 2.0], [3.0, 0.25, -1.0]]
        state.s = 0.5
        state.parts = [state.h[:2], state.h[:1:-1]]
        state.named = {"g": (state.g[0], state.g[:, 1])}
        state.helper, state.add = Helper(state.h[1:3]), adder()
        state.kept = [0.5]
        state.draws = {"rng": state.rng}
        apart = np.arange(4.0)
        state.loose = [apart, apart[1:3]]
        name = type(self).__name__
        NUMBERS[name] = summed.__defaults__[0][name] = 0.0
        type(self).count = 0.0

    def mixed(self, first, second=2.0):
        return first * 2.0 - second * self.a

    def fed(self, y):
        z = y * 0.5
        return z + self.n

    def counted(self, y):
        type(self).count += y
        return self.count

    def drawn(self, state):
        return state.rng.random()

    def changed(self, state):
        state.h[0] += 1.0
        return state.h[0]

    def swapped(self, state):
        state.h[0], state.h[1] = state.h[1], state.h[0]
        return state.h[1]

    def changed_all(self, state):
        state.h += 1.0
        return state.h * 0.5

    def doubled(self, values):
        return values * 2.0


class Updating(Base):
    """Records into its state r."""

    out = Output(Scalar)

    r = State(16)

    def output(self, state, t):
        return 0.0


class Returning(Base):
    """Returns what it records."""

    out = Output(Vector(16))

    def output(self, state, t):
        return np.zeros(16)
