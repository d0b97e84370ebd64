"""Designs against itertools and scipy; trials are generated one by one."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.stats import qmc

from runtime.document.node import parse_yaml
from runtime.errors import Problems
from runtime.experiments.design.factors import Factor, parse_factor
from runtime.experiments.design.sampling import Design, Method
from runtime.experiments.design.seeds import Seeds
from runtime.experiments.execution.trials import GraphBundle, configurations_of, trials_of


def factors(*texts: str) -> tuple[Factor, ...]:
    problems = Problems()
    found = [parse_factor(f"k{i}", parse_yaml(t, "x"), "", problems) for i, t in enumerate(texts)]
    assert not problems.items
    return tuple(factor for factor in found if factor is not None)


def test_a_grid_is_the_product_and_its_last_factor_varies_fastest() -> None:
    design = Design(factors("0..1:3", "[x, y]", "int(1..9):2"))
    expected = list(itertools.product([0.0, 0.5, 1.0], ["x", "y"], [1, 9]))
    assert list(design) == expected
    assert len(design) == len(expected)


def test_a_sobol_design_is_scipys_sequence() -> None:
    design = Design(factors("0..1", "-1..3"), "sobol", 64, seed=5)
    expected = qmc.Sobol(2, seed=np.random.default_rng(5)).random(64) * [1.0, 4.0] + [0.0, -1.0]
    assert np.allclose(list(design), expected, rtol=0.0, atol=1e-11)
    # What the sequence is for: each quarter of each axis gets its share.
    counts, _, _ = np.histogram2d(*np.array(list(design)).T, bins=4, range=[[0, 1], [-1, 3]])
    assert (counts == 4).all()


@pytest.mark.parametrize("method", ["random", "sobol"])
def test_samples_hang_on_their_seed_alone(method: Method) -> None:
    axes = factors("0..1", "log(1..10)")
    first, again = Design(axes, method, 100, 1), Design(axes, method, 100, 1)
    assert list(first) == list(again)
    assert list(first) != list(Design(axes, method, 100, 2))
    assert list(first)[:10] == list(Design(axes, method, 10, 1))
    assert len(set(first)) == 100


def test_trials_are_generated_one_by_one() -> None:
    design = Design(factors("0..1:1000000", "0..1:1000000"))
    seeds = Seeds(((0, 10**12),))
    trials = trials_of(configurations_of(GraphBundle("g"), ("a", "b"), design), seeds)
    first = next(trials)
    assert (first.number, first.seed, first.configuration.cells) == (0, 0, ("0.0", "0.0"))
    assert len(design) * len(seeds) == 10**12 * (10**12 + 1)


def test_trials_are_numbered_configuration_by_configuration() -> None:
    design = Design(factors("[x, y]"))
    trials = list(trials_of(configurations_of(GraphBundle("g"), ("a",), design), Seeds(((4, 5),))))
    assert [(p.number, p.configuration.cells, p.seed) for p in trials] == [
        (0, ("x",), 4),
        (1, ("x",), 5),
        (2, ("y",), 4),
        (3, ("y",), 5),
    ]
