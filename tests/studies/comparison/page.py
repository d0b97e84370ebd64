"""docs/comparison.md and its figures, from the rows and nothing else."""

from __future__ import annotations

import csv
import math
from collections import Counter, defaultdict
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from runtime.document import from_python
from runtime.errors import Problems
from runtime.experiments.design import Range, parse_factor
from tests.studies.comparison import budgets, costs, judge, plan, register, rows, screen
from tests.studies.comparison.judge import Answer, Contrast
from tests.studies.comparison.screen import ratio

PAGE = plan.FOLDER.parent / "comparison.md"
IMAGES = plan.FOLDER.parent / "images"
WHOLE = "over the run"
MANY = 0.1  # of all runs of a group that fail


def write() -> None:
    """Write the page and a figure for each question that has an answer."""
    asked = [*plan.read()["questions"], *plan.read().get("attempts", ())]
    judged = [(n, q["ask"], judge.answers(q)) for n, q in enumerate(asked, 1)]
    answered = [(n, ask, [_named(x) for x in found]) for n, ask, found in judged if found]
    given = {n for n, q in enumerate(asked, 1) if q.get("of_these")}
    sampled, these = (
        screen.Answers([x for n, _, found in judged if (n in given) == is_given for x in found])
        for is_given in (False, True)
    )
    _save(screen.figure(sampled), screen.PICTURE)
    parts = [_head(screen.sentences(sampled, these)), _asked(answered)]
    for number, ask, found in answered:
        name = f"comparison_{number}.png"
        _save(_figure(found), name)
        parts.append(_section(number, ask, found, name, number in given))
    parts += [_contestants(task) for task in rows.tasks()]
    parts += [_costs()] if costs.read() else []
    parts += [_foot(), REFEREE, _registered()]
    PAGE.write_text("\n\n".join(parts) + "\n", encoding="utf-8")


def _save(picture: Figure, name: str) -> None:
    picture.savefig(IMAGES / name, dpi=150, metadata={"Software": None})


# What the plan calls an oracle is no bound: it is called what it is.
NAMES = {"oracle": "compensated LQR"}


def _called(name: str) -> str:
    return NAMES.get(name, name)


def _named(line: Answer) -> Answer:
    return replace(line, one=_called(line.one), other=_called(line.other))


Answered = tuple[int, str, list[Answer]]


def _head(said: list[str]) -> str:
    """The first screen: one figure, and what it says."""
    title = "# Does spiking adaptation help, and where?"
    picture = f"![{screen.CAPTION.split(';')[0]}](images/{screen.PICTURE})"
    return "\n\n".join([title, said[0], picture, screen.CAPTION, *said[1:]])


def _asked(answered: list[Answered]) -> str:
    """What was asked, the verdicts in short, and what has been run for them."""
    entries = plan.read()["tasks"]
    done = rows.tasks()
    lines = ["## The questions and their answers in short", "", CONTESTANTS, ""]
    for number, ask, found in answered:
        lines += [f"{number}. {ask}", *(f"   * {line}" for line in _in_short(found))]
    lines += [
        "",
        "Ratios of errors, below 1 if the first named is better; a verdict needs a corrected p "
        f"below {judge.LEVEL:g} and no more failed runs than the other has. Written by `python -m "
        "tests.studies.comparison page` from the rows in `docs/study/rows`. [The "
        "plan](study/plan.md) was committed before the first run; [what was changed "
        "later](#what-was-registered-and-when) limits what the verdicts are worth.",
        "",
        "**What has been run.** " + " ".join(_run_of(task) for task in done),
    ]
    missing = [str(entry["title"]) for task, entry in entries.items() if task not in done]
    if missing:
        lines += ["", f"**Registered and not run yet**: {'; '.join(missing)}."]
    return "\n".join(lines)


CONTESTANTS = """*LQR*, *LQI* and *PID* do not learn; all that follow learn beside the LQR.
*Spikes*: neurons that learn by this project's rule, with all of its constants tuned. *One
setting*: the same with the constants that the graphs are shipped with, and only the LQR tuned, or
nothing. *Printed rule*: neurons that learn as the paper prints it. *Rate neurons*, *features*
(radial basis functions) and *MRAC* (a bias and a weight for each input): the same rule without
spikes. *Compensated LQR* (the plan's oracle): a tuned LQR from whose command the fault, which it
knows, is taken out; it is no bound."""

REFEREE = """## What a referee asks

* **Several training sets.** Open: all tunings of a task see the same training conditions. Task
  `retuned` has another set than `path`, and its ratios of spikes to the LQR are larger by a third.
* **Matched effort.** Open: each is tuned below the same limit of effort, and spends what it likes
  of it; the ratio of efforts stands beside each ratio of errors.
* **A disturbance observer, L1 adaptive control and model predictive control as rivals at equal
  budget.** Open: the library has them as blocks, and none of them was registered or tuned here.
* **More trials.** Each task has a table of what the last quarter of the trials gained. Where that
  is a tenth and more, on the arms, tunings with six factors had not converged, and those with two
  had."""


def _in_short(found: list[Answer]) -> Iterator[str]:
    """How often which verdict, and from which ratio to which, for each pair."""
    for one, other in dict.fromkeys((line.one, line.other) for line in found):
        own = [line for line in found if (line.one, line.other) == (one, other)]
        words = [each.contrast.word for each in own]
        said = [
            f"**{word}** in {words.count(word)} of {len(own)}" for word in COLOURS if word in words
        ]
        ratios = _ends([math.exp(each.contrast.mean) for each in own])
        yield (
            f"{one} against {other}: {', '.join(said)}; ratio {ratios}, at "
            f"{_ends([each.effort for each in own])} times the effort."
        )


def _ends(values: list[float]) -> str:
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"


def _registered() -> str:
    lines = ["## What was registered, and when", ""]
    return "\n".join([*lines, *(f"* {line}" for line in register.told())])


def _run_of(task: str) -> str:
    entry = plan.read()["tasks"][task]
    data = rows.read(task)
    tunings = {(row["contestant"], row["tuning"]) for row in data}
    names = {name for name, _ in tunings}
    held_out = sum(row["part"] == plan.HELD_OUT for row in data)
    text = f"{entry['title']}: {len(names)} of {len(entry['contestants'])} contestants, "
    text += f"{len(tunings)} tunings, {len(data) - held_out:,} training runs "
    text += f"and {held_out:,} held-out runs."
    absent = [name for name in entry["contestants"] if name not in names]
    fewer = [
        f"{name} {n}"
        for name in entry["contestants"]
        if 0 < (n := sum(one == name for one, _ in tunings)) < plan.tunings(task, name)
    ]
    text += f" Not run yet: {', '.join(absent)}." if absent else ""
    return text + (f" With fewer tunings than planned: {', '.join(fewer)}." if fewer else "")


def _measure(line: Answer) -> str:
    names = plan.read()["tasks"][line.task].get("measures", {})
    return str(names.get(line.metric, WHOLE))


def _group(line: Answer) -> str:
    return str(plan.read()["tasks"][line.task]["groups"][line.group]["title"])


def _section(number: int, ask: str, found: list[Answer], picture: str, given: bool) -> str:
    words = _words(found)
    lines = [f"## {number}. {ask}", "", *words, "", f"![{ask}](images/{picture})", ""]
    within = "conditions and seeds, and are about these tunings" if given else ""
    within = within or "tunings, conditions and seeds"
    lines += [f"Ratios of errors with 95 % intervals that contain {within}."]
    lines[-1] += " Grey is the range within the margin."
    lines += ["", "<details><summary>The table</summary>", ""]
    lines += [
        "| where | measure | contestant | against | ratio | effort | verdict | failed runs |",
        "|" + "---|" * 8,
    ]
    for line in found:
        failed = (
            "–" if line.contrast.failed == (0, 0) else "{} and {}".format(*line.contrast.failed)
        )
        cells = [_group(line), _measure(line), line.one, line.other, ratio(line.contrast)]
        cells += [f"{line.effort:.2f}", _verdict(line.contrast), failed]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", "</details>"])


def _verdict(one: Contrast) -> str:
    """The verdict; of an undecided one, what keeps it from another."""
    if one.word in ("better", "worse") and abs(one.mean) < plan.margin():
        return f"{one.word}, by less than the margin"
    if one.word == "equivalent" and one.p < judge.LEVEL:
        return f"equivalent: {'better' if one.mean < 0.0 else 'worse'}, by less than the margin"
    if one.word != "undecided":
        return one.word
    if one.p < judge.LEVEL:
        return "undecided: more runs of the better one failed"
    return "undecided" + ": by the corrected p" * (one.low > 0.0 or one.high < 0.0)


def _words(found: list[Answer]) -> Iterator[str]:
    """A sentence for each contestant and rival: how often which verdict, and where."""
    for one, other in dict.fromkeys((line.one, line.other) for line in found):
        own = [line for line in found if (line.one, line.other) == (one, other)]
        said = []
        for word in COLOURS:
            places = [line for line in own if line.contrast.word == word]
            named = "; ".join(f"{_place(x)}, {ratio(x.contrast)}" for x in places)
            if len(places) == len(own) > 1:
                ends = _ends([math.exp(x.contrast.mean) for x in own])
                named = f"all {len(own)} comparisons, {ends}"
            said += [f"**{word}** ({named})"] if places else []
        yield f"* {one} against {other}: {', '.join(said)}."


def _place(line: Answer) -> str:
    """Where a line is about, and which part of the run if it is not all of it."""
    measure = _measure(line)
    return _group(line) if measure == WHOLE else f"{_group(line)}, {measure}"


COLOURS = {"better": "#2a7f3f", "worse": "#b2332a", "equivalent": "#2b5c9e", "undecided": "#777777"}


def _figure(found: list[Answer]) -> Figure:
    """The ratios of one question, a line for each."""
    figure = Figure(figsize=(7.2, 0.9 + 0.24 * len(found)), layout="constrained")
    axes = figure.subplots()
    margin = plan.read()["margin"]
    axes.axvspan(1 / margin, margin, color="0.92")
    axes.axvline(1.0, color="0.4", lw=0.8)
    for place, line in enumerate(found):
        one = line.contrast
        ends = [math.exp(one.low), math.exp(one.high)]
        axes.plot(ends, [place, place], color=COLOURS[one.word], lw=2)
        axes.plot(math.exp(one.mean), place, "o", color=COLOURS[one.word], ms=5)
    labels = [f"{x.one} / {x.other}: {_place(x)}" for x in found]
    axes.set_yticks(range(len(found)), labels, fontsize=7)
    axes.set_ylim(len(found) - 0.4, -0.6)
    axes.set_xscale("log")
    ticks = [
        t for t in (0.1, 0.2, 0.3, 0.5, 0.7, 1, 1.5, 2, 3, 5, 10, 20, 50, 100) if _within(t, found)
    ]
    axes.set_xticks(ticks, [f"{t:g}" for t in ticks], fontsize=8)
    axes.minorticks_off()
    axes.set_xlabel("ratio of errors", fontsize=8)
    for word, colour in COLOURS.items():
        axes.plot([], [], "o-", color=colour, label=word, ms=4)
    figure.legend(ncols=4, loc="outside upper right", fontsize=7, frameon=False)
    return figure


def _within(tick: float, found: list[Answer]) -> bool:
    low = min([line.contrast.low for line in found] + [-0.3])
    high = max([line.contrast.high for line in found] + [0.3])
    return math.exp(low) * 0.9 <= tick <= math.exp(high) * 1.1


def _contestants(task: str) -> str:
    """The table of a task: errors, how far tunings agree, the effort, the worst condition."""
    entry = plan.read()["tasks"][task]
    lines = [f"## {entry['title']}: all contestants", "", *_spread_words(task), ""]
    lines += [*_effort_words(task), "", *_failure_words(task), *_edge_words(task), ""]
    if "tuned" not in entry:
        lines += ["<details><summary>What more trials would have bought</summary>", ""]
        lines += [*budgets.table(task, _called), "", "</details>", ""]
    for group, about in entry["groups"].items():
        lines += [f"<details><summary>{about['title']}</summary>", ""]
        lines += [
            "| contestant | error, " + entry["unit"] + " | tunings from | to | worst condition | "
        ]
        lines[-1] += "effort | failed runs |"
        lines += ["|" + "---|" * 7]
        lines += _lines(task, group, entry)
        lines += ["", "</details>", ""]
    return "\n".join(lines).rstrip()


def _lines(task: str, group: str, entry: dict[str, Any]) -> Iterator[str]:
    errors, effort = judge.cells(task, "error", group), judge.raw(task, "effort", group)
    scale = entry["scale"]
    order = sorted(errors, key=lambda name: float(np.exp(errors[name].values).mean()))
    for name in order:
        values = scale * np.exp(errors[name].values)
        by_tuning = values.mean(axis=(1, 2))
        worst = values.mean(axis=(0, 2)).max()
        numbers = [values.mean(), by_tuning.min(), by_tuning.max(), worst]
        shown = " | ".join(f"{number:.1f}" for number in numbers)
        tried = f"{effort[name]:.3f} | {errors[name].failed or '–'}"
        yield f"| {_called(name)} | {shown} | {tried} |"


def _spread_words(task: str) -> Iterator[str]:
    """Who needs tuning: the ratio of the worst to the best of the tunings, over all conditions."""
    groups = plan.read()["tasks"][task]["groups"]
    found: dict[str, np.ndarray[Any, Any]] = {}
    for group in groups:
        for name, one in judge.cells(task, "error", group).items():
            sums = one.values.sum(axis=(1, 2)), one.values[0].size
            old = found.get(name, np.zeros((2, len(one.values))))
            found[name] = old + np.stack([sums[0], np.full(len(one.values), sums[1])])
    spread = {name: float(np.ptp(total / n)) for name, (total, n) in found.items()}
    order = sorted(spread, key=lambda name: spread[name])
    said = ", ".join(f"{_called(name)} {math.exp(spread[name]):.2f}" for name in order)
    yield (
        "How far the tunings of each agree, the largest typical error over the smallest: "
        + said
        + "."
    )


def _effort_words(task: str) -> Iterator[str]:
    """Whose effort is above the limit that held in training."""
    entry = plan.read()["tasks"][task]
    limit, most = entry["effort"], []
    for group, about in entry["groups"].items():
        effort = judge.raw(task, "effort", group)
        above = {name: x for name, x in effort.items() if x > limit}
        if above:
            who = "all" if len(above) == len(effort) else ", ".join(sorted(map(_called, above)))
            most.append(f"{about['title']}: {who}, up to {max(above.values()):.3f}")
    if most:
        yield (
            f"**Efforts are not equal.** Held out, the mean effort is above the limit of training, "
            f"{limit:g}, in {'; '.join(most)}."
        )
    else:
        yield f"Held out, every mean effort is below the limit of training, {limit:g}; they differ."


def _failure_words(task: str) -> Iterator[str]:
    """Whether so many runs fail that ratios of errors say little."""
    for group, about in plan.read()["tasks"][task]["groups"].items():
        found = judge.cells(task, "error", group)
        share = sum(x.failed for x in found.values()) / sum(x.values.size for x in found.values())
        if share > MANY:
            yield (
                f"* **{100 * share:.0f} % of all held-out runs fail ({about['title']})**: what is "
                "stable on the few training conditions is not on others. A ratio of errors mostly "
                "says there how often each fails."
            )


def _edge_words(task: str) -> Iterator[str]:
    """Whose best values lie at an end of the range that was searched, and may be beyond."""
    ends: dict[tuple[str, str], Counter[str]] = defaultdict(Counter)
    for name, tuning in rows.began(task):
        ranges = _ranges(task, name)
        for path, value in rows.entered(task, name, tuning).items():
            if end := ranges[path].end_near(value):
                ends[path, end][name] += 1
    for (path, end), counts in ends.items():
        who = ", ".join(
            f"{_called(name)} {n} of {plan.tunings(task, name)}" for name, n in counts.items()
        )
        yield f"* Tunings that ended at the {end} end of the range of `{path}`: {who}."


def _ranges(task: str, contestant: str) -> dict[str, Range]:
    """What a contestant's tuning searches, by path."""
    problems = Problems()
    nodes = from_python(plan.factors(task, contestant)).items()
    parsed = {path: parse_factor(path, node, path, problems) for path, node in nodes}
    return {path: factor for path, factor in parsed.items() if isinstance(factor, Range)}


def _costs() -> str:
    """What each contestant needs as C."""
    lines = [
        "## What it costs",
        "",
        "As `runtime export` writes it in C, in double, of the vehicle's ",
    ]
    lines[-1] += (
        "contestants: state in bytes, code on a Cortex-M4 in bytes, operations of a step on "
    )
    lines[-1] += "which everything is due. Loops over spikes depend on data; one pass is counted."
    lines += ["", "<details><summary>The table</summary>", ""]
    lines += [
        "| contestant | state | code | arithmetic | divisions | functions |",
        "|" + "---|" * 6,
    ]
    lines += [f"| {' | '.join(map(_called, row.values()))} |" for row in costs.read()]
    return "\n".join([*lines, "", "</details>"])


COVERED = """* Of 1,000 simulated studies of {tunings} tunings, {conditions} conditions and {seeds}
  seeds, {interval} of the 95 % intervals hold the truth; of 250 by a bootstrap, {bootstrap}."""
FOOT = """## How to read this

* **Better**, **worse**: the ratio differs from 1. **Equivalent**: it is within 1/{margin} and
  {margin}. **Undecided**: neither. p values of differences and of equivalence are corrected alike
  (Benjamini and Hochberg), over the places where a question compares the same two. The plan had
  registered to correct over all lines of a question: with that, four equivalences of task `retuned`
  would be undecided, since the same question has comparisons whose difference nobody doubts. How
  large a ratio such a study finds is in [the plan](study/plan.md#power).
* Intervals reach as far as that of Student's t and that of a studentized bootstrap of tunings,
  conditions and seeds do. Where one bad condition decides, as of *one setting, nothing tuned* with
  a fault that heals, tuned anew, no interval from sixteen conditions covers well: drawn again from
  these very runs, two of three do.
* A contestant is judged from {fewest} tunings on. Each tuning ends by the plan's patience, which
  is short, so that tunings of one contestant differ; the intervals allow for that. They do not
  allow for the training conditions, which are the same for all tunings of a task.
* **Error**: geometric mean in ratios, arithmetic mean in tables; a failed run counts as the
  task's limit.
* **Effort**: root mean square of the command's change from one tick to the next, at the rate at
  which it changes, in rad/s (of the arms: in units of torque). The mean over the training runs
  must stay below the task's limit; held out it is only reported, as a ratio beside each ratio of
  errors. *Equal limits are not equal efforts*: tunings of task `path` train with a noisy pose as
  well, which uses up the limit; those of `retuned` do not, and spend more on quiet runs, from
  which an LQR gains most.
* The *compensated LQR* knows neither noise nor what the LQR itself leaves, so that a ratio below 1
  against it is possible.
* *One setting* is what the graphs ship: it was found in an earlier study, on three other graphs
  (`tests/studies/settings`), and is not changed here."""


def _foot() -> str:
    lines = []
    if judge.COVERAGE.exists():
        with judge.COVERAGE.open(encoding="utf-8") as stream:
            lines = [COVERED.format(**_percent(row)) for row in csv.DictReader(stream)]
    return "\n".join([_reading(), *lines])


def _percent(row: dict[str, str]) -> dict[str, str]:
    shares = {key: f"{100 * float(row[key]):.1f} %" for key in ("interval", "bootstrap")}
    return row | shares


def _reading() -> str:
    return FOOT.format(margin=plan.read()["margin"], fewest=plan.FEWEST)
