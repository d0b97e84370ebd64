"""Semantic pointers: words as vectors of a vocabulary, their bindings and their similarity.

A word's vector depends on the word, the dimensions and the vocabulary's number only, so that all
blocks with the same two numbers mean the same by it. In: texts such as ``RED*CIRCLE + BLUE``. Out:
vectors of length about 1, or how similar a vector is to each::

    pointer_of("RED*CIRCLE", 64, 0)      # (64,): the circular convolution of two random vectors
"""

from __future__ import annotations

import ast
import operator
from abc import ABC
from collections.abc import Callable
from functools import lru_cache
from typing import Any, final

import numpy as np

from blocks.core import (
    Block,
    BlockState,
    FloatArray,
    Input,
    Output,
    ParameterError,
    Vector,
    param,
    product,
    small_times,
)

LONGEST = 1_000  # characters of a text
FORMS = "words with + and -, * to bind, ~ for the inverse, numbers as factors"
Pair = Callable[[Any, Any], Any]
SUMS: dict[type[ast.AST], Pair] = {ast.Add: operator.add, ast.Sub: operator.sub}


@lru_cache(4096)
def word(name: str, dimensions: int, vocabulary: int) -> FloatArray:
    """A random vector of length 1, the same wherever it is asked for."""
    rng = np.random.default_rng([vocabulary, dimensions, *name.encode()])
    drawn = rng.standard_normal(dimensions)
    drawn /= np.sqrt(np.square(drawn).sum())
    drawn.setflags(write=False)
    return drawn


def bound(a: FloatArray, b: FloatArray) -> FloatArray:
    """The circular convolution: c_i = sum_j a_j b_(i-j) (Plate, 1995)."""
    n = len(a)
    shifted = b[(np.arange(n)[:, None] - np.arange(n)) % n]
    return np.asarray(product(shifted, a[:, None])[:, 0])


def inverse(a: FloatArray) -> FloatArray:
    """The involution, a_0, a_n-1, ..., a_1, which undoes a binding to a, nearly."""
    return np.concatenate([a[:1], a[:0:-1]])


def pointer_of(text: str, dimensions: int, vocabulary: int) -> FloatArray:
    """The vector (dimensions,) that a text of words means.

    Raises
    ------
    ValueError : the text is none; the message says what is wrong with it.
    """
    try:
        tree = ast.parse(text.strip()[:LONGEST], mode="eval").body
        value = _meaning(tree, dimensions, vocabulary)
    except (SyntaxError, RecursionError, MemoryError):
        raise ValueError(f"expected {FORMS}, got '{text[:60]}'") from None
    if isinstance(value, float):
        if value != 0.0:
            raise ValueError(f"expected a word in '{text[:60]}', which is a number")
        return np.zeros(dimensions)
    return np.asarray(value, dtype=float)


def _meaning(node: ast.AST, d: int, vocabulary: int) -> Any:
    """A vector, or a number."""
    if isinstance(node, ast.Name):
        return word(node.id, d, vocabulary)
    if isinstance(node, ast.Constant) and isinstance(node.value, (int, float)):
        return float(node.value)
    if isinstance(node, ast.UnaryOp):
        value = _meaning(node.operand, d, vocabulary)
        if isinstance(node.op, ast.USub):
            return -value
        if isinstance(node.op, ast.Invert) and not isinstance(value, float):
            return inverse(value)
    if isinstance(node, ast.BinOp):
        a, b = (_meaning(side, d, vocabulary) for side in (node.left, node.right))
        vectors = [side for side in (a, b) if not isinstance(side, float)]
        if isinstance(node.op, ast.Mult):
            return bound(a, b) if len(vectors) == 2 else a * b
        if type(node.op) in SUMS and len(vectors) != 1:
            return SUMS[type(node.op)](a, b)
    written = ast.unparse(node)
    raise ValueError(f"expected {FORMS}, got '{written[:60]}'")


class _OfWords(Block, ABC):
    """What blocks with a vocabulary have in common."""

    words: tuple[str, ...] = param(doc="words, or expressions of words such as RED*CIRCLE + BLUE")
    dimensions: int = param(64, at_least=2, at_most=4096, doc="of the vectors")
    vocabulary: int = param(0, at_least=0, doc="number of the vocabulary")

    def sizes(self) -> dict[str, int]:
        if "words" not in self.__dict__:
            return {}
        return {"d": self.dimensions, "w": len(self.words)}

    def validate(self) -> None:
        try:
            self.table()
        except ValueError as error:
            raise ParameterError([("words", str(error))]) from None

    def table(self) -> FloatArray:
        """The vectors (w, d)."""
        rows = [pointer_of(text, self.dimensions, self.vocabulary) for text in self.words]
        return np.array(rows)

    def start(self, state: BlockState) -> None:
        state.table = self.table()


@final
class SemanticPointer(_OfWords):
    """The vector of a word or of an expression of words, one after the other over time.

        [ SemanticPointer ] ─▶ out

    RED*CIRCLE + BLUE is the vector of RED bound to that of CIRCLE by circular convolution, plus
    that of BLUE; ~CIRCLE is the approximate inverse, 0.5*RED a half of it, and 0 no word. With
    ``times``, each of the words is there from its time on (Eliasmith, How to Build a Brain, 2013).
    """

    out = Output(Vector("d"), doc="the vector")

    times: FloatArray | None = param(
        None, unit="s", shape=(None,), doc="when each of the words begins, ascending"
    )

    def validate(self) -> None:
        super().validate()
        times, count = self.times, len(self.words)
        if times is None and count > 1:
            message = f"expected the times from which on each of {count} words is there"
            raise ParameterError([("times", message)])
        if times is not None and (len(times) != count or (np.diff(times) <= 0.0).any()):
            message = f"expected {count} ascending times, one for each of the words"
            raise ParameterError([("times", f"{message}, got {times.tolist()}")])

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.times = np.zeros(1) if self.times is None else self.times.copy()

    def output(self, state: BlockState, t: float) -> FloatArray:
        row, out = 0, np.zeros(self.dimensions)
        for i in range(len(state.times)):
            # A millionth of a second for the rounding of k * dt.
            if t >= state.times[i] - 1e-6:
                row = i
        for i in range(len(out)):
            out[i] = state.table[row, i]
        return out


@final
class Similarity(_OfWords):
    """How similar a vector is to each of some words: the dot products.

        vector ─▶ [ Similarity ] ─▶ out

    out[i] = words[i] . vector, about 1 for the same word and about 0 for another.
    """

    vector = Input(Vector("d"), doc="what to compare")
    out = Output(Vector("w"), doc="a number for each word")

    def output(self, state: BlockState, t: float, vector: FloatArray) -> FloatArray:
        return small_times(state.table, vector)


@final
class Superposition(_OfWords):
    """The sum of words, each with a weight.

        weights ─▶ [ Superposition ] ─▶ out

    out = sum of weights[i] * words[i]: behind Similarity and thresholds, the clean words.
    """

    weights = Input(Vector("w"), doc="a number for each word")
    out = Output(Vector("d"), doc="the sum of their vectors")

    def start(self, state: BlockState) -> None:
        super().start(state)
        state.columns = np.ascontiguousarray(state.table.T)

    def output(self, state: BlockState, t: float, weights: FloatArray) -> FloatArray:
        return small_times(state.columns, weights)
