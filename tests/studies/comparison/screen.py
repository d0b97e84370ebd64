"""The first screen of docs/comparison.md: one figure, and what it says in four sentences."""

from __future__ import annotations

import math

import numpy as np
from matplotlib.figure import Figure

from tests.studies.comparison import costs, judge, plan
from tests.studies.comparison.judge import Answer, Contrast

PICTURE = "comparison.png"
LEARNERS = ("MRAC", "features", "rate neurons")
ONE, NOTHING = "one setting", "one setting, nothing tuned"
# The rows of the figure: task, group, measure and what it is called. The tasks are in the order in
# which they were run, and the last three were drawn and tuned anew.
PLACES = (
    ("path", "heals", "in_fault", "vehicle, while its fault lasts"),
    ("path", "heals", "error", "vehicle, fault that heals"),
    ("path", "noise", "error", "the same with a noisy pose"),
    ("path", "switching", "error", "vehicle, fault that comes and goes"),
    ("retuned", "heals", "error", "tuned anew: fault that heals"),
    ("retuned", "switching", "error", "tuned anew: comes and goes"),
    ("arm_retuned", "states", "error", "arm, torque of its state"),
    ("joints", "load", "error", "six joints, unknown load"),
)
SHOWN = (("spikes", "o", "#2b5c9e"), (ONE, "D", "#c26a1b"))


def ratio(one: Contrast) -> str:
    """A ratio with its interval."""
    return f"{math.exp(one.mean):.2f} [{math.exp(one.low):.2f}, {math.exp(one.high):.2f}]"


class Answers:
    """The lines of all questions, found by what they are about."""

    def __init__(self, lines: list[Answer]) -> None:
        self.lines = {(x.task, x.group, x.metric, x.one, x.other): x for x in lines}

    def __call__(self, task: str, group: str, metric: str, one: str, other: str = "LQR") -> Answer:
        return self.lines[task, group, metric, one, other]

    def shown(self, task: str, group: str, metric: str, one: str) -> Answer | None:
        """The line of a row; tuned anew, there is only the setting of which nothing is tuned."""
        names = (one, NOTHING) if one == ONE else (one,)
        found = [self.lines.get((task, group, metric, name, "LQR")) for name in names]
        return next((line for line in found if line is not None), None)

    def words(self, of: str, others: tuple[str, ...]) -> list[str]:
        """The verdicts of one contestant beside some others, wherever they meet."""
        return [x.contrast.word for x in self.lines.values() if x.one == of and x.other in others]


def figure(found: Answers) -> Figure:
    """Errors as shares of the tuned LQR's, a row for each condition."""
    picture = Figure(figsize=(7.2, 3.6), layout="constrained")
    axes = picture.subplots()
    margin = plan.read()["margin"]
    axes.axvspan(1 / margin, margin, color="0.92", lw=0)
    axes.axvline(1.0, color="0.4", lw=0.8)
    for i, (one, marker, colour) in enumerate(SHOWN):
        for row, (task, group, metric, _) in enumerate(PLACES):
            line = found.shown(task, group, metric, one)
            if line is not None:
                at, (low, high) = row + 0.22 * (2 * i - 1), _ends(line.contrast)
                axes.plot([low, high], [at, at], color=colour, lw=1.6)
                face = "white" if line.one == NOTHING else colour
                style = {"color": colour, "markerfacecolor": face, "ms": 5}
                axes.plot(math.exp(line.contrast.mean), at, marker, **style)
        axes.plot([], [], marker, color=colour, ms=5, label=one)
    axes.plot([], [], "D", color=SHOWN[1][2], markerfacecolor="white", ms=5, label=NOTHING)
    axes.set_yticks(range(len(PLACES)), [label for *_, label in PLACES], fontsize=8)
    axes.set_ylim(len(PLACES) - 0.4, -0.6)
    axes.set_xscale("log")
    ticks = (0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5)
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks], fontsize=8)
    axes.minorticks_off()
    axes.set_xlabel("error as a share of the tuned LQR's (less is better)", fontsize=8)
    picture.legend(ncols=3, loc="outside upper right", fontsize=8, frameon=False)
    return picture


def _ends(one: Contrast) -> tuple[float, float]:
    return math.exp(one.low), math.exp(one.high)


CAPTION = (
    "Ratios of geometric mean errors with 95 % intervals over tunings, conditions and seeds; grey "
    "is the range within the margin. Hollow: with the LQR beside it not tuned either. *Spikes* and "
    "*one setting* are this project's rule, tuned in each task or as it is shipped."
)


def sentences(found: Answers, given: Answers) -> list[str]:
    """What helps, where it does not, what the means hide, and what it costs."""
    return [_helps(found, given), _fails(found, given), _tails(), _costs()]


def _helps(found: Answers, given: Answers) -> str:
    window = ratio(found("path", "heals", "in_fault", "spikes").contrast)
    anew = [ratio(found("retuned", g, "error", "spikes").contrast) for g in ("heals", "switching")]
    low, high = _pairs("again", "heals", ("spikes", "MRAC"), ("spikes", "rate neurons"))
    return (
        f"**What helps is to adapt.** While the vehicle's turn rate is partly lost, spikes have "
        f"{window} of the tuned LQR's error, and {' and '.join(anew)} over the run where both "
        f"were tuned anew on other paths. Learners without spikes ({', '.join(LEARNERS)}) do the "
        f"same: beside them, spikes are {_counted(found)}. The very tunings that were judged "
        f"again on new runs are {_counted(given)} on average, while single pairs of tunings "
        f"range from {low:.2f} to {high:.2f}."
    )


def _counted(found: Answers) -> str:
    words = found.words("spikes", LEARNERS)
    kinds = ("better", "worse", "equivalent", "undecided")
    said = [f"{word} in {words.count(word)}" for word in kinds if word in words]
    return f"{', '.join(said)} of {len(words)} comparisons"


def _fails(found: Answers, given: Answers) -> str:
    arm = found("arm_retuned", "states", "error", "spikes")
    setting = found("arm_retuned", "states", "error", ONE)
    joints = found("joints", "load", "error", "spikes")
    cells = judge.cells("joints", "error", "load")
    share = sum(x.failed for x in cells.values()) / sum(x.values.size for x in cells.values())
    first = [given("again", g, "error", NOTHING) for g in ("heals", "switching")]
    anew = [found("retuned", g, "error", NOTHING) for g in ("heals", "switching")]

    def of(lines: list[Answer]) -> str:
        return " and ".join(f"{math.exp(x.contrast.mean):.2f}" for x in lines)

    efforts = [f"{1.0 / x.effort:.1f}" for x in anew]
    return (
        f"**Where it does not.** On an arm whose torque depends on its state spikes are "
        f"{arm.contrast.word}, {ratio(arm.contrast)} ({arm.contrast.failed[0]} of their runs "
        f"failed, {arm.contrast.failed[1]} of the LQR's), and one setting is "
        f"{setting.contrast.word}, {ratio(setting.contrast)}; on six joints nothing is decided, "
        f"{ratio(joints.contrast)}, since {100 * share:.0f} % of all runs fail. One setting with "
        f"nothing tuned had {of(first)} of the LQR's error on the first tunings' new runs and has "
        f"{of(anew)} beside an LQR that was tuned anew and spends {' and '.join(efforts)} times "
        "its effort: that claim did not repeat."
    )


def _tails() -> str:
    (spikes, at), (setting, _) = (_worst("retuned", "heals", x) for x in ("spikes", NOTHING))
    plain, typical = _means("retuned", "heals", "spikes")
    arm = judge.cells("arm_retuned", "error", "states")
    most = math.exp(arm["spikes"].values.max() - arm["LQR"].values.max())
    return (
        f"**What the means hide.** In one condition of {at}, tuned anew, spikes have "
        f"{spikes:.1f} times and one setting {setting:.1f} times the LQR's error, so that the "
        f"ratio of arithmetic means is {plain:.2f} beside the geometric {typical:.2f}; on the arm "
        f"the largest error of spikes is {most:.0f} times the LQR's largest."
    )


def _worst(task: str, group: str, one: str) -> tuple[float, int]:
    """The largest ratio to the LQR of any condition, and how many conditions there are."""
    cells = judge.cells(task, "error", group)
    apart = (cells[one].values.mean(axis=0) - cells["LQR"].values.mean(axis=0)).mean(axis=-1)
    return float(np.exp(apart.max())), len(apart)


def _means(task: str, group: str, one: str) -> tuple[float, float]:
    """The ratio to the LQR of arithmetic means, and of geometric ones."""
    a, b = (judge.cells(task, "error", group)[name].values for name in (one, "LQR"))
    return float(np.exp(a).mean() / np.exp(b).mean()), float(np.exp(a.mean() - b.mean()))


def _pairs(task: str, group: str, *pairs: tuple[str, str]) -> tuple[float, float]:
    """The smallest and the largest ratio of any two tunings of some pairs, over all runs."""
    cells = judge.cells(task, "error", group)
    means = {name: one.values.mean(axis=(1, 2)) for name, one in cells.items()}
    apart = np.concatenate([np.subtract.outer(means[a], means[b]).ravel() for a, b in pairs])
    return float(np.exp(apart.min())), float(np.exp(apart.max()))


def _costs() -> str:
    by_name = {row["contestant"]: row for row in costs.read()}
    mrac, spikes = by_name["MRAC"], by_name["spikes"]

    def said(row: dict[str, str]) -> str:
        return f"{int(row['arithmetic']):,} operations a step and {int(row['memory']):,} bytes"

    return (
        f"**What it costs.** As C, MRAC takes {said(mrac)} of state, spikes {said(spikes)}, for "
        "the same error on the vehicle."
    )
