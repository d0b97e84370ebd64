"""Semantic pointers against Fourier transforms, and the parts that use them beside Nengo."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import nengo
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import blocks
import runtime
from blocks.neural.pointers import bound, inverse, pointer_of, word
from tests.blocks.neural.models import simulated

GRAPHS = Path(__file__).parents[3] / "graphs"


@given(st.integers(2, 40), st.integers(0, 5))
def test_binding_is_circular_convolution(d: int, seed: int) -> None:
    a, b, c = (np.random.default_rng([seed, i]).standard_normal(d) for i in range(3))
    expected = np.fft.irfft(np.fft.rfft(a) * np.fft.rfft(b), d)
    np.testing.assert_allclose(bound(a, b), expected, atol=1e-12)
    np.testing.assert_allclose(bound(a, b), bound(b, a), atol=1e-12)
    np.testing.assert_allclose(bound(bound(a, b), c), bound(a, bound(b, c)), atol=1e-11)
    np.testing.assert_array_equal(inverse(inverse(a)), a)


def test_words_are_the_same_everywhere_and_nearly_orthogonal() -> None:
    words = np.array([word(f"W{i}", 256, 0) for i in range(60)])
    np.testing.assert_allclose(np.square(words).sum(axis=1), 1.0, rtol=1e-12)
    alike = words @ words.T - np.eye(60)
    # Of two random directions, the similarity has a deviation of 1 / sqrt(d).
    assert np.abs(alike).max() < 5.0 / np.sqrt(256)
    assert alike[np.triu_indices(60, 1)].std() == pytest.approx(1.0 / 16.0, rel=0.1)
    assert not np.array_equal(word("A", 64, 0), word("A", 64, 1))
    assert not np.array_equal(word("A", 64, 0), word("B", 64, 0))


def test_texts_mean_what_they_say() -> None:
    a, b, c = (word(name, 32, 3) for name in "ABC")
    found = pointer_of("2*A*B - (~C + 0.5*A)", 32, 3)
    np.testing.assert_allclose(found, 2.0 * bound(a, b) - (inverse(c) + 0.5 * a), atol=1e-14)
    np.testing.assert_array_equal(pointer_of("0", 32, 3), 0.0)
    unbound = pointer_of("(A*B + C*D) * ~B", 512, 0)
    assert unbound @ pointer_of("A", 512, 0) > 0.7
    assert abs(unbound @ pointer_of("C", 512, 0)) < 0.25


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("A +", "expected words"),
        ("A/B", "got 'A / B'"),
        ("__import__('os')", "got \"__import__|got '__import__"),
        ("A + 1", "got 'A \\+ 1'"),
        ("3", "expected a word"),
        ("~2", "expected words"),
        ("(" * 3000 + "A" + ")" * 3000, "expected words"),
    ],
)
def test_other_texts_are_refused(text: str, message: str) -> None:
    with pytest.raises(blocks.ParameterError, match=message):
        blocks.SemanticPointer(words=text)


def test_times_belong_to_words() -> None:
    for more in ({}, {"times": [0.0]}, {"times": [1.0, 0.5]}):
        with pytest.raises(blocks.ParameterError, match="times"):
            blocks.SemanticPointer(words=["A", "B"], **more)


@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_words_come_one_after_the_other_and_are_found_again(engine: str) -> None:
    made = runtime.Graph(dt=0.1, until=1.0)
    times = [0.0, 0.3, 0.7]
    made = made.add("a", blocks.SemanticPointer(words=["A", "A + 0.5*B", "0"], times=times))
    made = made.add("like", blocks.Similarity(words=["A", "B"]))
    made = made.add("sum", blocks.Superposition(words=["A", "B"]))
    made = made.connect("a.out", "like.vector").connect("like.out", "sum.weights")
    found = made.probe("like.out").probe("sum.out").probe("a.out").run(engine=engine)
    assert found.manifest["engine_notes"] == []
    table = np.array([word("A", 64, 0), word("B", 64, 0)])
    rows = np.array([table[0], table[0] + 0.5 * table[1], 0.0 * table[0]])
    np.testing.assert_allclose(found["a.out"], np.repeat(rows, (3, 4, 3), axis=0))
    np.testing.assert_allclose(found["like.out"], found["a.out"] @ table.T, atol=1e-14)
    np.testing.assert_allclose(found["sum.out"], found["like.out"] @ table, atol=1e-14)


def part(name: str, wires: dict[str, str], sources: dict[str, Any], **entry: Any) -> runtime.Graph:
    plain = {
        "run": {"dt": 0.001, "until": 0.3},
        "blocks": {"it": {"graph": str(GRAPHS / "parts" / f"{name}.yaml"), **entry}, **sources},
        "wires": {"it": wires},
        "probes": {"y": {"of": "it.value", "synapse": 0.01}},
    }
    return runtime.load(plain)


@pytest.mark.slow
def test_the_gated_memory_is_nengos() -> None:
    """Means over seeds while it loads, and while it holds what it has."""

    def theirs(seed: int) -> np.ndarray:
        with nengo.Network(seed=seed) as model:
            memory = nengo.networks.InputGatedMemory(100, 1)
            x = nengo.Node(lambda t: 0.6 if t < 0.7 else -0.4)
            gate = nengo.Node(lambda t: 0 if t < 0.5 else 1)
            nengo.Connection(x, memory.input, synapse=None)
            nengo.Connection(gate, memory.gate, synapse=None)
            out = nengo.Node(size_in=1)
            nengo.Connection(memory.output, out, synapse=0.005)
            probe = nengo.Probe(out, synapse=0.01)
        return np.asarray(simulated(model, 1.0).data[probe])[:, 0]

    sources = {
        "x": {"type": "Function", "expression": ["0.6 if t < 0.7 else -0.4"]},
        "g": {"type": "Function", "expression": "0 if t < 0.5 else 1"},
    }
    made = part("input_gated_memory", {"x": "x.out", "gate": "g.out"}, sources)
    made = made.set("run.until", 1.0)
    mine = np.array([made.run(seed=seed)["y"][:, 0] for seed in range(8)])
    other = np.array([theirs(seed) for seed in range(8)])
    scatter = np.sqrt((mine.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / 8)
    difference = np.abs(mine.mean(axis=0) - other.mean(axis=0))
    assert (difference < 0.02 + 3.5 * scatter).all()
    assert mine.mean(axis=0)[-1] == pytest.approx(0.6, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("level", [0.2, 0.6, 1.0])
def test_the_cleanup_decides_as_nengos_associative_memory(level: float) -> None:
    table = np.array([word(name, 64, 0) for name in "ABC"])

    def theirs(seed: int) -> np.ndarray:
        with nengo.Network(seed=seed) as model:
            memory = nengo.networks.AssociativeMemory(table, threshold=0.3)
            nengo.Connection(nengo.Node(level * table[0]), memory.input, synapse=None)
            probe = nengo.Probe(memory.output, synapse=0.03)
        return np.asarray(simulated(model, 0.3).data[probe])[200:].mean(axis=0)

    sources = {"x": {"type": "SemanticPointer", "words": f"{level}*A"}}
    made = part("cleanup", {"x": "x.out"}, sources, params={"words": ["A", "B", "C"]})
    mine = np.mean([made.run(seed=seed)["y"][200:].mean(axis=0) for seed in range(3)], axis=0)
    other = np.mean([theirs(seed) for seed in range(3)], axis=0)
    np.testing.assert_allclose(mine @ table.T, other @ table.T, atol=0.05)
    assert mine @ table[0] == pytest.approx(1.0 if level > 0.3 else 0.0, abs=0.1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_the_questions_are_answered(seed: int) -> None:
    found = runtime.load(GRAPHS / "gallery" / "spa_question.yaml").run(seed=seed)
    words = ["RED", "BLUE", "CIRCLE", "SQUARE"]
    for start, expected in zip((1000, 1500, 2000, 2500), words, strict=True):
        answer = found["answer"][start + 200 : start + 500].mean(axis=0)
        similar = found["similar"][start + 200 : start + 500].mean(axis=0)
        assert words[int(np.argmax(similar))] == expected
        assert answer[words.index(expected)] > 0.8
        assert np.sort(answer)[-2] < 0.2
    assert np.abs(found["answer"][:900]).max() < 0.2
