"""Fits against linear regression, closed forms, and simulated coverage."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import solve_ivp
from scipy.linalg import block_diag

import runtime
from blocks.core import FloatArray
from runtime.fitting.noise import noise_of, variances
from tests.conftest import Run

LINE = {
    "graph": "line",
    "run": {"dt": 0.01, "until": 1.0},
    "blocks": {
        "slope": {"type": "Constant", "value": 1.0},
        "level": {"type": "Integrator", "initial": 0.0},
    },
    "wires": {"level": {"input": "slope.value"}},
}
ARM = """
graph: arm
run: {dt: 0.01, until: 4.0, engine: python}
blocks:
  push: {type: Step, time: 0.0}
  arm:
    type: DynamicSystem
    states: [angle, rate]
    derivative: [rate, "(u[0] - b*rate - k*angle)/J"]
    constants: {J: 1.0, b: 0.5, k: 2.0}
    initial: [0, 0]
wires:
  arm: {u: [push.out]}
"""
TRUE = {"J": 0.7, "b": 0.35, "k": 3.2}


@pytest.fixture
def arm(tmp_path: Path) -> Path:
    """The graph, and data of a solver of SciPy."""
    (tmp_path / "arm.yaml").write_text(ARM)
    t = np.arange(0.0, 4.0, 0.04)

    def rates(t: float, x: FloatArray) -> list[float]:
        return [x[1], (1.0 - TRUE["b"] * x[1] - TRUE["k"] * x[0]) / TRUE["J"]]

    y = solve_ivp(rates, (0.0, 4.0), [0.0, 0.0], t_eval=t, rtol=1e-11, atol=1e-13).y
    table = np.column_stack([t, *y])
    np.savetxt(tmp_path / "push.csv", table, delimiter=",", header="t,angle,rate", comments="")
    return tmp_path


def line_fit(t: FloatArray, y: FloatArray, **options: int) -> runtime.Fit:
    vary = {"slope.value": "-5..5", "level.initial": "-3..3"}
    return runtime.fit(runtime.load(LINE), vary, {"level.out": (t, y)}, **options)


def test_a_line_has_the_estimates_and_intervals_of_linear_regression() -> None:
    t = np.linspace(0.0, 1.0, 51)
    rng = np.random.default_rng(2)
    y = 0.3 - 1.2 * t + 0.05 * rng.standard_normal(len(t))
    fit = line_fit(t, y, starts=2)
    known = stats.linregress(t, y)
    np.testing.assert_allclose(fit.values["slope.value"], known.slope, rtol=1e-6)
    np.testing.assert_allclose(fit.values["level.initial"], known.intercept, rtol=1e-6)
    # White noise: what it happens to be correlated with itself widens the intervals a little.
    r = (len(t) - fit.effective) / (len(t) + fit.effective)
    share = stats.t.ppf(0.975, fit.effective - 2) * math.sqrt((1.0 + r) / (1.0 - r))
    for each, error in zip(fit.parameters, (known.stderr, known.intercept_stderr), strict=True):
        assert each.high - each.low == pytest.approx(2.0 * share * error, rel=1e-4)


@pytest.mark.slow
def test_intervals_contain_the_true_number_as_often_as_they_say() -> None:
    t, hits = np.linspace(0.0, 1.0, 26), 0
    for seed in range(200):
        noise = 0.1 * np.random.default_rng(seed).standard_normal(len(t))
        slope = line_fit(t, 0.3 - 1.2 * t + noise, starts=1).parameters[0]
        hits += slope.low <= -1.2 <= slope.high
    # 95 % of 200 are 190; six standard deviations of a binomial count are 18.
    assert hits >= 172


def test_the_sandwich_is_that_of_dense_matrices() -> None:
    """J and V written out, with the noise that was estimated of each signal."""
    rng = np.random.default_rng(3)
    t = np.linspace(0.0, 1.0, 40)
    slopes = [np.column_stack([np.ones(40), t]), np.column_stack([np.ones(40), t**2])]
    residuals = [0.1 * rng.standard_normal(40), np.cumsum(rng.standard_normal(40))]
    noises = [noise_of(*each) for each in zip(residuals, slopes, strict=True)]
    assert noises[1].variance > 50.0 * noises[0].variance and noises[1].correlation > 0.5
    inverse = np.linalg.pinv(np.vstack(slopes))
    dense = [
        one.variance * one.correlation ** np.abs(np.subtract.outer(range(40), range(40)))
        for one in noises
    ]
    expected = np.diag(inverse @ block_diag(*dense) @ inverse.T)
    found, free = variances(noises, np.split(inverse.T, 2))
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    # Nearly all of it is of the second signal, and so are the degrees of freedom.
    np.testing.assert_allclose(free, noises[1].free, rtol=0.05)


def test_one_signal_of_white_noise_has_the_variance_of_linear_regression() -> None:
    t = np.linspace(0.0, 1.0, 60)
    y = np.random.default_rng(11).standard_normal(60)
    y = np.where(np.arange(60) % 2, y, -np.abs(y))  # each unlike the one before: r = 0
    known, slopes = stats.linregress(t, y), np.column_stack([np.ones(60), t])
    residuals = y - known.intercept - known.slope * t
    noise = noise_of(residuals, slopes)
    assert noise.correlation == 0.0 and noise.free == 58.0
    found, _ = variances([noise], [np.linalg.pinv(slopes).T])
    expected = [known.intercept_stderr**2, known.stderr**2]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_it_finds_what_made_the_data(arm: Path) -> None:
    vary = {"arm.constants.b": "0..2", "arm.constants.J": "log(0.1..10)"}
    data = {str(arm / "push.csv"): {"angle": "arm.out[0]", "rate": "arm.out[1]"}}
    vary["arm.constants.k"] = "0.1..10"
    fit = runtime.fit(arm / "arm.yaml", vary, data, starts=1)
    for name, value in TRUE.items():
        assert fit.values[f"arm.constants.{name}"] == pytest.approx(value, rel=1e-6)
    assert max(fit.rms) < 1e-7
    assert not fit.notes


def test_what_the_data_do_not_tell_has_no_interval(arm: Path) -> None:
    vary = {f"arm.constants.{name}": "0.1..5" for name in "Jbk"} | {"push.after": "0.5..2"}
    data = {str(arm / "push.csv"): {"angle": "arm.out[0]"}}
    fit = runtime.fit(arm / "arm.yaml", vary, data, starts=1)
    assert all(math.isinf(each.high) for each in fit.parameters)
    assert "do not tell arm.constants.J, arm.constants.b" in fit.notes[0]
    # Only quotients count: of each, the data give the true one.
    ratio = fit.values["arm.constants.k"] / fit.values["push.after"]
    assert ratio == pytest.approx(TRUE["k"], rel=1e-4)


def test_a_number_without_effect_is_named(arm: Path) -> None:
    vary = {"arm.constants.b": "0..2", "push.before": "-1..1"}
    data = {str(arm / "push.csv"): {"rate": "arm.out[1]"}}
    fit = runtime.fit(arm / "arm.yaml", vary, data, starts=1)
    assert "the data do not depend on push.before" in fit.notes
    assert math.isfinite(fit.parameters[0].high)


def test_a_misfit_is_said(arm: Path) -> None:
    data = {str(arm / "push.csv"): {"angle": "arm.out[0]"}}
    fit = runtime.fit(arm / "arm.yaml", {"arm.constants.b": "0..0.2"}, data, starts=2)
    assert any("like the one before it" in note for note in fit.notes)
    assert any("is at the end of its range" in note for note in fit.notes)
    assert fit.effective < 0.2 * 100


FILE = """
experiment: two
graph: arm.yaml
vary: {arm.constants.b: 0..2, arm.constants.k: 0.1..10, arm.constants.J: "log(0.1..10)"}
data:
  first: {file: push.csv, signals: {angle: "arm.out[0]"}}
  second:
    file: twice.csv
    signals: {angle: "arm.out[0]", rate: "arm.out[1]"}
    weights: {rate: 2}
    set: {push.after: 2.0}
"""


@pytest.mark.slow
def test_several_runs_and_the_numbers_written_into_the_file(arm: Path, cli: Run) -> None:
    table = np.loadtxt(arm / "push.csv", delimiter=",", skiprows=1)
    table[:, 1:] *= 2.0  # the system is linear
    np.savetxt(arm / "twice.csv", table, delimiter=",", header="t,angle,rate", comments="")
    (arm / "two.yaml").write_text(FILE)
    done = cli("fit", "two.yaml", "--json", "--starts", "1", "--write", cwd=arm)
    assert done.returncode == 0, done.stderr
    stored = json.loads(done.stdout)
    assert [each["run"] for each in stored["signals"]] == ["first", "second", "second"]
    assert Path(arm, stored["plots"][0]).exists()
    values = {each["path"].rpartition(".")[2]: each["value"] for each in stored["parameters"]}
    assert values == pytest.approx(TRUE, rel=1e-6)
    written = runtime.load(arm / "arm.yaml").to_dict()["blocks"]["arm"]["constants"]
    assert written == {"J": 1.0, "b": 0.5, "k": 2.0}
    assert f"arm.constants.b: {values['b']}" in (arm / "two.yaml").read_text()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--to", "push.csv:angle=arm.out[0]"], "there is nothing to fit; add --vary"),
        (["--vary", "arm.constants.b=0..2"], "there are no data to fit to; add --to"),
        (
            ["--vary", "arm.constants.b=[1, 2]", "--to", "push.csv:angle=arm.out[0]"],
            "a fit needs a range of numbers",
        ),
        (["--vary", "arm.constants.b=0..2", "--to", "push.csv"], "expected FILE:COLUMN=SIGNAL"),
        (
            ["--vary", "arm.constants.b=0..2", "--to", "push.csv:angl=arm.out[0]"],
            "push.csv: there is no column 'angl', did you mean 'angle'?",
        ),
        (
            ["--vary", "arm.constants.b=0..2", "--to", "push.csv:angle=arm.outt"],
            "'arm' has no output or state 'outt', did you mean 'out'?",
        ),
        (
            ["--vary", "arm.constants.b=0..2", "--to", "push.csv:angle=arm.out"],
            "'arm.out' has 2 components; name one",
        ),
        (
            ["--vary", "arm.constants.b=0..2", "--to", "push.csv:angle=arm.out[0]", "--weight=a=2"],
            "--weight a: there is no --to with this signal",
        ),
    ],
)
def test_mistakes(arm: Path, cli: Run, arguments: list[str], message: str) -> None:
    done = cli("fit", "arm.yaml", *arguments, cwd=arm)
    assert done.returncode == 2
    assert message in done.stderr
    assert not (arm / "fits").exists()


def test_a_graph_that_fails_at_some_numbers_is_fitted_at_others(tmp_path: Path) -> None:
    graph = runtime.load(
        {
            "graph": "decay",
            "run": {"dt": 0.1, "until": 2.0, "solver": "rk4"},
            "blocks": {
                "decay": {
                    "type": "DynamicSystem",
                    "states": ["x"],
                    "derivative": ["-sqrt(a)*x"],
                    "constants": {"a": 0.5},
                    "initial": [1.0],
                }
            },
        }
    )
    t = np.linspace(0.0, 1.9, 20)
    fit = runtime.fit(
        graph, {"decay.constants.a": "-1..4"}, {"decay.out": (t, np.exp(-1.5 * t))}, starts=3
    )
    assert fit.values["decay.constants.a"] == pytest.approx(2.25, rel=1e-4)
