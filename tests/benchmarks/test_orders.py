"""Every solver keeps its order with edges off the ticks and with events."""

from __future__ import annotations

import numpy as np
import pytest

import runtime
from benchmarks import orders, peers
from benchmarks.problems import START, Solved, ticks


@pytest.mark.slow
@pytest.mark.parametrize("title", orders.EXACT)
@pytest.mark.parametrize("solver", orders.SOLVERS)
def test_a_solver_converges_at_its_order(solver: str, title: str) -> None:
    assert orders.order(title, solver) == pytest.approx(orders.SOLVERS[solver].order, abs=0.2)


@pytest.mark.parametrize("solver", ["euler", "rk4"])
def test_events_keep_the_order(solver: str) -> None:
    assert orders.order("events", solver) == pytest.approx(orders.SOLVERS[solver].order, abs=0.2)


def test_evaluations_are_counted() -> None:
    _, few = orders.solved("smooth", dt=0.5, solver="rk4")
    assert few == 4 * 12


def reference(title: str) -> np.ndarray:
    if title in orders.EXACT:
        return orders.EXACT[title](ticks(title))
    return orders.by_scipy(title, "Radau", 1e-12, ticks(title)).x


@pytest.mark.parametrize("title", START)
def test_the_graph_that_is_timed_is_the_problem_that_is_counted(title: str) -> None:
    dt = ticks(title)[1]
    solver = "rodas4" if title == "stiff" else "dopri5"
    run = {"dt": dt, "until": 5 * dt, "solver": solver, "rtol": 1e-6, "atol": 1e-9}
    counted, _ = orders.solved(title, **run)
    timed = np.ravel(runtime.load(orders.document(title, run)).run(engine="python")["x"])
    np.testing.assert_allclose(timed, counted, rtol=1e-12)
    np.testing.assert_allclose(counted, reference(title)[: len(counted)], atol=1e-6)


@pytest.mark.parametrize("title", START)
@pytest.mark.parametrize("package", ["pathsim", pytest.param("diffrax", marks=pytest.mark.slow)])
def test_a_peer_solves_the_problem(package: str, title: str) -> None:
    """Its error at a tight tolerance is small, and smaller than at a loose one."""
    pytest.importorskip(package)
    found, missing = peers.installed(p for p in peers.SOLVER_PEERS if p.package == package)
    assert not missing
    (module,) = found.values()
    if (package, title) == ("diffrax", "events"):
        with pytest.raises(NotImplementedError):
            module.solve(title, 1e-4)
        return
    loose, tight = (np.abs(module.solve(title, r).x - reference(title)).max() for r in (1e-4, 1e-7))
    assert tight < 1e-6
    assert tight < loose / 5


def test_what_a_peer_cannot_do_is_a_dash_and_one_that_is_not_there_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def cannot(rtol: float) -> Solved:
        raise NotImplementedError

    def solves(rtol: float) -> Solved:
        return Solved(ticks("smooth") * 0.0, None, 0.5)

    nobody = peers.Peer("Nobody", "no-such-package", "solve_in_nobody")
    monkeypatch.setattr(orders, "SOLVER_PEERS", [nobody])
    monkeypatch.setattr(orders, "START", {"smooth": START["smooth"]})
    assert list(orders.contestants("smooth")) == ["dopri5", "scipy, RK45"]
    monkeypatch.setattr(orders, "contestants", lambda title: {"one": solves, "other": cannot})
    text = orders.costs()
    assert text.count("| smooth | other | - | - | - |") == 2
    assert "| smooth | one | 1e+00 in - |" in text
    assert "500 ms, 1 |" in text
    assert text.endswith("* Nobody is left out: it is not installed.")
