"""The paper's claims about cases A and B, each measured, and judged by a rule in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import runtime
from blocks import LQR
from tests.studies.cases import Runs, after, case

LINE, SINE = "line_actuator_failure", "sine_estimation_error"
LEVEL = -0.07  # rad/s, of the adaptive turn rate at the end of case A in the paper
NEAR = 0.02  # rad/s
BAND = 0.1  # m, and rad: within it a run has converged, and what is less does not count
OVERSHOOT = 0.05  # m
KINDS = {
    "lqr": "LQR",
    "forward": "LQR + feedforward",
    "adaptive": "as printed",
    "robust": "robust",
}


@dataclass(frozen=True)
class Claim:
    """One row of the table; ``share`` is the part of the runs in which the claim's rule holds."""

    id: str
    paper: str
    rule: str
    ours: str
    share: float
    why: str = ""

    @property
    def verdict(self) -> str:
        if self.share >= 0.9:
            return "holds"
        return "does not hold" if self.share <= 0.1 else f"holds in {self.share:.0%} of the runs"


def spread(values: np.ndarray, unit: str = "", digits: int = 2) -> str:
    """Mean and standard deviation, of the runs that have a value."""
    good = values[np.isfinite(values)]
    if not len(good):
        return "none"
    deviation = f" ± {good.std(ddof=1):.{digits}f}" if len(good) > 1 else ""
    return f"{good.mean():.{digits}f}{deviation}{' ' if unit else ''}{unit}"


def holds_in_a(adaptive: Runs, lqr: Runs) -> dict[str, np.ndarray]:
    """Whether A1 to A5 hold, for each run of the adaptive controller."""
    settled = np.isfinite(adaptive["converged_at"])
    gain = adaptive["distance"] - lqr["distance"][0]
    past, _ = _past_and_rest(adaptive)
    first, last = _turn_rates(adaptive)
    return {
        "A1": settled,
        "A2": np.full(len(settled), np.isnan(lqr["converged_at"][0])),
        "A3": gain > BAND,
        "A4": (past > OVERSHOOT) & settled,
        "A5": (np.abs(first) > 0.1) & (np.abs(last - LEVEL) <= NEAR),
    }


def _past_and_rest(adaptive: Runs) -> tuple[np.ndarray, np.ndarray]:
    """How far each run crosses the line, and how far off it ends (m)."""
    signals = adaptive.signals["lateral"]
    past = np.array([-lateral.min() for lateral in signals])
    return past, np.array([abs(lateral[-1]) for lateral in signals])


def _turn_rates(adaptive: Runs) -> tuple[np.ndarray, np.ndarray]:
    """Each run's largest adaptive turn rate of the first 5 s, and its mean of the last 2 s."""
    omega = [signal[:, 1] for signal in adaptive.signals["adaptive"]]
    first = np.array([signal[np.abs(signal[:500]).argmax()] for signal in omega])
    last = np.array([signal[-1] for signal in _columns(after(adaptive, "adaptive", 18.0), 1)])
    return first, last


def case_a(seeds: int) -> list[Claim]:
    """A1 to A5."""
    adaptive, lqr = case(LINE, "adaptive", seeds), case(LINE, "lqr", 1)
    share = {name: float(held.mean()) for name, held in holds_in_a(adaptive, lqr).items()}
    settled = np.isfinite(adaptive["converged_at"])
    (past, rest), (first, last) = _past_and_rest(adaptive), _turn_rates(adaptive)
    left = lqr.signals["lateral"][0][-1]
    return [
        Claim(
            "A1",
            "adaptive: e_p and e_theta reach zero at about 17 s",
            "both within 0.1 m and 0.1 rad for good before 20 s",
            f"{settled.sum()} of {seeds} networks, at {spread(adaptive['converged_at'], 's', 1)}",
            share["A1"],
            "The rule as printed integrates heading, which acts as lateral stiffness with an "
            "offset: where a network's neurons happen to carry more of what they learnt at large "
            "angles over to small ones, the robot stays beside the line.",
        ),
        Claim(
            "A2",
            "the benchmark LQR has not converged at 20 s",
            "not within the band at 20 s",
            f"{abs(left):.2f} m off at 20 s",
            share["A2"],
            "With the soft gains of the graph. Stiff gains converge in spite of the fault, "
            "see the second table.",
        ),
        Claim(
            "A3",
            "adaptive covers more distance along the line",
            f"at least {BAND:g} m, the band of A1, more progress than the LQR in 20 s",
            f"{spread(adaptive['distance'], 'm')} against {lqr['distance'][0]:.2f} m",
            share["A3"],
        ),
        Claim(
            "A4",
            "adaptive overshoots, then converges",
            f"crosses the line by more than {OVERSHOOT:g} m and converges as in A1",
            f"{spread(past, 'm')} past the line, {spread(rest, 'm')} off at 20 s",
            share["A4"],
        ),
        Claim(
            "A5",
            "the adaptive turn rate rises first, then settles near -0.07 rad/s",
            "its largest size in the first 5 s is above 0.1, its mean over the last 2 s within "
            f"{NEAR:g} of the paper's",
            f"{spread(first, 'rad/s')} first, {spread(last, 'rad/s', 3)} at the end",
            share["A5"],
            "It rises against the heading error, so it is negative at first. The level at the end "
            "depends on the network. The paper's cannot be that of a robot on the line with gains "
            "this soft: the LQR balances the adaptive turn rate, which takes a lateral offset of "
            f"{-LEVEL / _stiffness():.2f} m.",
        ),
    ]


def _stiffness() -> float:
    """The turn rate by which the LQR of case A answers a lateral error, in rad/s per metre."""
    lqr = runtime.load(LINE).network.entries["lqr"].block
    assert isinstance(lqr, LQR)
    _, gain = lqr.solve(0.01, 0.0)
    return abs(float(gain[1, 1]))


def _columns(signals: list[np.ndarray], column: int) -> list[np.ndarray]:
    """The mean of one column, as a one-element array per run."""
    return [np.atleast_1d(signal[:, column].mean()) for signal in signals]


def holds_in_b(adaptive: Runs, lqr: Runs) -> dict[str, np.ndarray]:
    """Whether B1 to B4 hold, for each run of the adaptive controller and the LQR's of its seed."""
    early, late = (_mean_error(adaptive, *span) for span in ((10.0, 22.5), (22.5, 35.0)))
    return {
        "B1": (np.abs(early - late) < 0.1) & (early < 0.2) & (late < 0.2),
        "B2": _swing(lqr) > _swing(adaptive),
        "B3": lqr["distance"] < 0.8 * adaptive["distance"],
        "B4": lqr["position_mae"] > adaptive["position_mae"],
    }


def case_b(seeds: int) -> list[Claim]:
    """B1 to B4."""
    adaptive, lqr = case(SINE, "adaptive", seeds), case(SINE, "lqr", seeds)
    forward = case(SINE, "forward", seeds)
    stiff = case(SINE, "lqr/100/0.01", seeds)
    tuned, tuned_lqr = case(SINE, "adaptive/1", seeds), case(SINE, "lqr/1", seeds)
    early, late = (_mean_error(adaptive, *span) for span in ((10.0, 22.5), (22.5, 35.0)))
    swing, swing_lqr = _swing(adaptive), _swing(lqr)
    ratio = lqr["position_mae"] / adaptive["position_mae"]
    share = {name: float(held.mean()) for name, held in holds_in_b(adaptive, lqr).items()}
    return [
        Claim(
            "B1",
            "adaptive: errors settle at low constant values within 10 s",
            "mean position error over 10-22.5 s and 22.5-35 s within 0.1 m, both below 0.2 m",
            f"{spread(early, 'm')}, then {spread(late, 'm')}",
            share["B1"],
            "True errors, where the paper does not say which it plots. With a turn rate of "
            "1 rad/s at most and alpha = 0.06 the soft controller cuts the bends, noise or not.",
        ),
        Claim(
            "B2",
            "the LQR's position error keeps oscillating",
            "its standard deviation after 10 s is larger than the adaptive controller's",
            f"{spread(swing_lqr, 'm')} against {spread(swing, 'm')}",
            share["B2"],
        ),
        Claim(
            "B3",
            "the LQR moves considerably slower",
            "less than 80 % of the adaptive controller's progress in 35 s",
            f"{spread(lqr['distance'], 'm', 1)} against {spread(adaptive['distance'], 'm', 1)}",
            share["B3"],
            "The gains are not in the paper. With the gains of the graph the LQR cuts corners and "
            "is faster. It is slow only with very high gains, where noise saturates the turn rate: "
            f"Q = 100 and R = 0.01 cover {spread(stiff['distance'], 'm', 1)}.",
        ),
        Claim(
            "B4",
            "adaptive tracks more accurately",
            "smaller mean position error after 10 s than the LQR on the same noise",
            f"{spread(adaptive['position_mae'], 'm', 3)} against "
            f"{spread(lqr['position_mae'], 'm', 3)}, a factor of {spread(ratio)}",
            share["B4"],
            "With the feedforward, alpha = 0.06, and without the network the LQR is at "
            f"{spread(forward['position_mae'], 'm', 3)}. Holds for the soft gains. With Q = 1 the "
            "two are at "
            f"{spread(tuned['position_mae'], 'm', 3)} (adaptive) and "
            f"{spread(tuned_lqr['position_mae'], 'm', 3)} (LQR). Over drawn starts and paths the "
            "printed rule is the worse of the two: see 'Cases A and B beyond the paper's one "
            "setting'.",
        ),
    ]


def _mean_error(runs: Runs, start: float, stop: float) -> np.ndarray:
    return np.array([errors[:, 0].mean() for errors in after(runs, "errors", start, stop)])


def _swing(runs: Runs) -> np.ndarray:
    return np.array([errors[:, 0].std() for errors in after(runs, "errors", 10.0)])


def beyond(seeds: int) -> list[tuple[str, ...]]:
    """LQR, the printed rule and ours, with soft and well-tuned gains."""
    rows = []
    for name, label in ((LINE, "A"), (SINE, "B")):
        for gains, text in (("", "of the graph"), ("/1", "Q = R = 1")):
            for kind, called in KINDS.items():
                lonely = kind in ("lqr", "forward") and name == LINE
                runs = case(name, kind + gains, 1 if lonely else seeds)
                settled = np.isfinite(runs["converged_at"])
                rows.append(
                    (
                        *(label, text, called),
                        f"{settled.sum()} of {len(settled)}",
                        spread(runs["converged_at"], "s", 1),
                        spread(runs["position_mae"], "m", 3),
                        spread(runs["distance"], "m", 1),
                    )
                )
    return rows
