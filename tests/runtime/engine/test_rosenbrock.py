"""The linear algebra of the implicit solver: against NumPy's, and both forms against each other."""

from __future__ import annotations

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import runtime
from runtime.engine.rosenbrock import (
    STRUCTURE,
    factor,
    factor_loops,
    implicit,
    implicit_loops,
    solve,
    solve_loops,
)
from runtime.plan import make_plan
from runtime.plan.coupling import Coupling
from runtime.solvers import method_of


def banded(n: int, band: int, seed: int) -> np.ndarray:
    """A random matrix without entries further than ``band`` from the diagonal."""
    matrix = np.random.default_rng(seed).normal(size=(n, n))
    r, c = np.indices((n, n))
    return np.where(abs(r - c) <= band, matrix, 0.0)


def shuffled(matrix: np.ndarray, seed: int) -> np.ndarray:
    """The same matrix for states in another order."""
    order = np.random.default_rng(seed).permutation(len(matrix))
    return matrix[np.ix_(order, order)]


def grid(rows: int, columns: int) -> np.ndarray:
    """Which points of a grid are neighbours or the same."""
    r, c = np.divmod(np.arange(rows * columns), columns)
    return abs(r - r[:, None]) + abs(c - c[:, None]) <= 1


def stored(matrix: np.ndarray) -> tuple[np.ndarray, int]:
    """The slopes of a step with this matrix M, and the row at which its columns begin."""
    n, method = len(matrix), method_of("rodas4", len(matrix))
    slopes = np.zeros((method.slope_rows(n), n))
    slopes[method.stages : method.stages + n] = matrix.T
    r, c = np.nonzero(matrix)
    slopes[-1, 0] = abs(r - c).max(initial=0)
    return slopes, method.stages


def coupling(matrix: np.ndarray) -> Coupling:
    """Each rate depends on the states whose entries are not zero."""
    return Coupling.of([sum(1 << int(c) for c in np.flatnonzero(row)) for row in matrix])


@given(st.integers(1, 40), st.integers(0, 40), st.integers(0, 2**32))
def test_both_forms_solve_what_numpy_solves(n: int, band: int, seed: int) -> None:
    matrix, right = banded(n, band, seed), np.random.default_rng(seed + 1).normal(size=n)
    forms = []
    for factored, solved in ((factor, solve), (factor_loops, solve_loops)):
        (slopes, rows), x = stored(matrix), right.copy()
        factored(slopes, rows)
        solved(slopes, rows, x)
        forms.append(x)
    assert np.array_equal(*forms)
    condition = np.linalg.cond(matrix)
    if condition < 1e8:
        expected = np.linalg.solve(matrix, right)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(forms[0], expected, rtol=0.0, atol=1e-13 * condition * scale)


@given(st.integers(1, 30), st.integers(0, 30), st.integers(0, 2**32), st.booleans())
def test_both_forms_take_the_same_step(n: int, band: int, seed: int, is_shuffled: bool) -> None:
    # x' = A x + sin(9 t); every stage of one step in each form.
    system = banded(n, band, seed)
    if is_shuffled:
        system = shuffled(system, seed)
    structure = coupling(system)
    structured = [getattr(structure, name) for name in STRUCTURE]
    method = method_of("rodas4", structure.count)
    ends = []
    for form in (implicit, implicit_loops):
        start = np.linspace(1.0, 2.0, n)
        states, slopes = start.copy(), np.zeros((method.slope_rows(n), n))
        for stage in range(method.stages):
            slopes[stage] = system @ states + np.sin(9.0 * 0.1 * method.nodes[stage])
            arrays = states, start, slopes, method.table
            form(*arrays, stage, 0.1, *structured)
        ends.append((states, slopes[method.stages - 1], slopes[method.stages :]))
    for python, loops in zip(*ends, strict=True):
        assert np.array_equal(python, loops)


@given(st.integers(1, 60), st.floats(0.0, 1.0), st.integers(0, 2**32))
def test_no_row_contains_two_columns_of_one_colour(n: int, share: float, seed: int) -> None:
    matrix = np.random.default_rng(seed).random((n, n)) < share
    structure = coupling(matrix)
    assert np.array_equal(structure.pattern, np.argwhere(matrix))
    for colour in range(structure.count):
        assert matrix[:, structure.colours == colour].sum(axis=1).max() <= 1


@pytest.mark.parametrize("n", [1, 2, 3, 4, 100])
def test_a_diffusion_of_any_length_has_three_colours(n: int) -> None:
    assert coupling(banded(n, 1, 0)).count == min(n, 3)


@given(st.integers(1, 40), st.floats(0.0, 0.2), st.integers(0, 2**32))
def test_a_state_has_a_place_of_its_own(n: int, share: float, seed: int) -> None:
    matrix = np.random.default_rng(seed).random((n, n)) < share
    structure = coupling(matrix)
    assert sorted(structure.places) == list(range(n))
    r, c = np.nonzero(matrix)
    own = abs(r - c).max(initial=0)
    assert structure.band == own or 2 * structure.band < own


@pytest.mark.parametrize(
    ("matrix", "most"), [(banded(100, 1, 0), 1), (grid(5, 40), 9), (grid(2, 30), 3)]
)
def test_states_in_any_order_have_a_narrow_band(matrix: np.ndarray, most: int) -> None:
    # From a corner of a grid on, two neighbours are in the same or in adjacent diagonals.
    assert coupling(shuffled(matrix, 1)).band <= most


@pytest.mark.parametrize("matrix", [banded(50, 1, 0), np.ones((30, 30)), np.zeros((3, 3))])
def test_states_keep_their_order_where_another_gains_little(matrix: np.ndarray) -> None:
    assert np.array_equal(coupling(matrix).places, np.arange(len(matrix)))


def test_a_step_with_a_singular_matrix_is_rejected_and_not_an_error() -> None:
    (slopes, rows), right = stored(np.zeros((2, 2))), np.ones(2)
    factor(slopes, rows)
    solve(slopes, rows, right)
    assert np.all(np.abs(right) > 1e20)


GRAPH = """
graph: coupled
run: {dt: 0.01, until: 0.05, solver: rodas4, rtol: 1.0e-9, atol: 1.0e-12}
blocks:
  chain:
    type: DynamicSystem
    states: [a, b, c]
    derivative: [b - a, "-2*b + a*c", "u[0]"]
    initial: [1.0, 0.5, 0.2]
  sum: {type: Sum, signs: [1, -1]}
  out: {type: Integrator, initial: 0.3}
  alone: {type: TransferFunction, numerator: [1.0], denominator: [1.0, 3.0, 2.0]}
  wave: {type: Sine}
wires:
  sum: {terms: [chain.out.1, out.out]}
  out: {input: sum.out}
  chain: {u: [out.out]}
  alone: {input: wave.out}
probes: {chain: chain.out, out: out.out, alone: alone.out}
"""


def test_what_depends_on_what_is_read_from_wires_and_blocks() -> None:
    graph = runtime.load(yaml.safe_load(GRAPH))
    part = make_plan(graph.network, graph.observation).integration
    assert part is not None
    states = [f"{slot.block}[{i}]" for slot in part.row.slots for i in range(slot.size)]
    read = {(states[int(r)], states[int(c)]) for r, c in part.coupling.pattern}
    a, b, c, out = "chain[0]", "chain[1]", "chain[2]", "out[0]"
    assert {pair for pair in read if "alone" not in pair[0]} == {
        *((a, a), (a, b), (b, a), (b, b), (b, c)),
        # Inputs and outputs are whole signals: each component may depend on all.
        *((a, out), (b, out), (c, out)),
        *((out, a), (out, b), (out, c), (out, out)),
    }
    assert all("alone" in column for row, column in read if "alone" in row)


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.slow
def test_coloured_differences_solve_what_scipy_solves(engine: str) -> None:
    result = runtime.load(yaml.safe_load(GRAPH)).run(engine=engine)

    def rates(t: float, x: np.ndarray) -> list[float]:
        a, b, c, out = x
        return [b - a, -2.0 * b + a * c, out, b - out]

    start, times = [1.0, 0.5, 0.2, 0.3], np.linspace(0.0, 0.05, 6)
    exact = solve_ivp(rates, (0.0, 0.05), start, "Radau", times, rtol=1e-11, atol=1e-13).y.T
    rows = len(result["out"])
    np.testing.assert_allclose(result["chain"], exact[:rows, :3], rtol=1e-8)
    np.testing.assert_allclose(result["out"], exact[:rows, 3], rtol=1e-8)


POINTS = 30
RUN = {"dt": 0.5, "until": 1.5, "solver": "rodas4", "rtol": 1e-7, "atol": 1e-9}
# Of two species that diffuse and react (the Brusselator), the first and then the second.
APART = {
    "states": [f"a({POINTS})", f"b({POINTS})"],
    "let": {
        **{"al": "concat(1, a[0:-1])", "ar": "concat(a[1:], 1)"},
        **{"bl": "concat(3, b[0:-1])", "br": "concat(b[1:], 3)"},
    },
    "derivative": [
        "1 + a*a*b - 4*a + 20*(al - 2*a + ar)",
        "3*a - a*a*b + 20*(bl - 2*b + br)",
    ],
}


def brusselator(is_interleaved: bool) -> runtime.Graph:
    """From a = 1 + sin, b = 3; or as a_0, b_0, a_1, b_1, ..."""
    block = APART
    waves = np.sin(2.0 * np.pi * np.arange(1, POINTS + 1) / (POINTS + 1))
    initial = np.array([1.0 + waves, np.full(POINTS, 3.0)])
    if is_interleaved:
        rates = []
        for i in range(POINTS):
            al, bl = (f"a{i - 1}", f"b{i - 1}") if i else ("1", "3")
            ar, br = (f"a{i + 1}", f"b{i + 1}") if i < POINTS - 1 else ("1", "3")
            rates += [
                f"1 + a{i}*a{i}*b{i} - 4*a{i} + 20*({al} - 2*a{i} + {ar})",
                f"3*a{i} - a{i}*a{i}*b{i} + 20*({bl} - 2*b{i} + {br})",
            ]
        states = [f"{species}{i}" for i in range(POINTS) for species in "ab"]
        block, initial = {"states": states, "derivative": rates}, initial.T
    block = {"type": "DynamicSystem", **block, "initial": initial.ravel().tolist()}
    content = {"graph": "brusselator", "run": RUN, "blocks": {"s": block}}
    return runtime.load({**content, "probes": {"x": "s.out"}})


@pytest.mark.parametrize("is_interleaved", [False, True])
def test_two_species_have_a_narrow_band_in_any_order(is_interleaved: bool) -> None:
    graph = brusselator(is_interleaved)
    part = make_plan(graph.network, graph.observation).integration
    assert part is not None
    assert part.coupling.band == 2
    assert np.array_equal(part.coupling.places, np.arange(2 * POINTS)) == is_interleaved


@pytest.mark.slow
def test_two_species_in_any_order_are_what_scipy_solves() -> None:
    def rates(_: float, x: np.ndarray) -> np.ndarray:
        a, b = x.reshape(2, POINTS)
        change = [np.diff(np.pad(s, 1, constant_values=e), 2) for s, e in ((a, 1.0), (b, 3.0))]
        react = a * a * b
        return np.concatenate(
            [1.0 + react - 4.0 * a + 20.0 * change[0], 3.0 * a - react + 20.0 * change[1]]
        )

    found = brusselator(False).run(engine="python")["x"]
    assert np.array_equal(brusselator(False).run(engine="compiled")["x"], found)
    times = RUN["dt"] * np.arange(len(found))
    exact = solve_ivp(rates, (0.0, times[-1]), found[0], "Radau", times, rtol=1e-10, atol=1e-12).y.T
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    interleaved = brusselator(True).run(engine="python")["x"]
    np.testing.assert_allclose(found[:, :POINTS], interleaved[:, ::2], rtol=1e-6)
    np.testing.assert_allclose(found[:, POINTS:], interleaved[:, 1::2], rtol=1e-6)
