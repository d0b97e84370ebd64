"""Every solver keeps its order with edges off the ticks and with events."""

from __future__ import annotations

import pytest

from benchmarks import orders


@pytest.mark.slow
@pytest.mark.parametrize("title", orders.PROBLEMS)
@pytest.mark.parametrize("solver", orders.SOLVERS)
def test_a_solver_converges_at_its_order(solver: str, title: str) -> None:
    assert orders.order(title, solver) == pytest.approx(orders.SOLVERS[solver], abs=0.2)


@pytest.mark.parametrize("solver", ["euler", "rk4"])
def test_events_keep_the_order(solver: str) -> None:
    assert orders.order("events", solver) == pytest.approx(orders.SOLVERS[solver], abs=0.2)


def test_evaluations_are_counted() -> None:
    _, few = orders.solved("smooth", dt=0.5, solver="rk4")
    assert few == 4 * 12
