"""What ``runtime linearize`` prints: a linear system, its margins, and an equilibrium.

In: a Linearization, a Trim, numbers. Out: text. A pole of a sampled loop is a line of z and s::

    0.9512 + 0j            -0.5 + 0j 1/s
"""

from __future__ import annotations

import cmath
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from runtime.tables import Table
from runtime.terminal import number

if TYPE_CHECKING:
    from runtime.runs import Linearization, Trim

MOST_NAMED = 5  # states that move, entries that do not settle


def as_text(title: str, found: Linearization) -> str:
    """The operating point, the matrices, the poles, and what is to be known about them."""
    unit = found.time_unit
    lines = [f"{title}: linearized at t = {found.t:g} {unit}"]
    if found.opened:
        is_loop = found.inputs == found.outputs
        what = f"L of 1 + L = 0, the loop cut at {found.opened}"
        lines[0] += f", {what}" if is_loop else f", with the loop cut at {found.opened}"
    lines += _notes(found)
    lines += ["", "Operating point"]
    point = zip(found.states, found.point.tolist(), strict=True)
    lines += [f"  {name} = {number(value)}" for name, value in point]
    after = f" (x after {found.period:g} {unit})" if found.period else ""
    for name, matrix, rows, columns in (
        (f"A{after}", found.a, found.states, found.states),
        ("B", found.b, found.states, found.inputs),
        ("C", found.c, found.outputs, found.states),
        ("D", found.d, found.outputs, found.inputs),
    ):
        if rows and columns:
            cells = [[row, *m.tolist()] for row, m in zip(rows, matrix, strict=True)]
            right = range(1, len(columns) + 1)
            lines += ["", name, Table.of(["", *columns], cells, numbers=right).text()]
    if found.period:
        head = ["z", "abs(z)", f"s = log(z) / {found.period:g} {unit}"]
        pairs = zip(found.poles, found.equivalent, strict=True)
        cells = [[_complex(z), f"{abs(z):.6g}", _complex(s)] for z, s in pairs]
        lines += ["", "Poles in the z plane", Table.of(head, cells).text()]
    else:
        lines += ["", f"Poles (1/{unit})", *(f"  {_complex(pole)}" for pole in found.poles)]
    verdict = "stable" if found.is_stable else "not stable"
    lines += [f"  {'the open loop' if found.opened else 'the system'} is {verdict}"]
    return "\n".join(lines)


def _notes(found: Linearization) -> list[str]:
    """What is part of it, what is not, and where it cannot be relied on."""
    unit, lines = found.time_unit, list[str]()
    if found.period:
        names = ", ".join(found.sampled)
        lines.append(f"  sampled, in steps of {found.period:g} {unit}: {names}")
    if found.held:
        lines.append(f"  held constant: {', '.join(found.held)}")
    if found.without:
        lines.append(f"  left out, without effect here: {', '.join(found.without)}")
    if found.moving:
        named = [f"{name} by {number(rate)}" for name, rate in found.moving[:MOST_NAMED]]
        per = f"in {found.period:g} {unit}" if found.period else f"per {unit}"
        more = len(found.moving) - len(named)
        rest = f" and {more} more" if more else ""
        lines.append(f"  no equilibrium: {per} it moves {', '.join(named)}{rest}; --trim finds one")
    for each in found.loose[:MOST_NAMED]:
        sides = f"{_slope(each.below)} from below, {_slope(each.above)} from above"
        lines.append(f"  not differentiable: {each.of} by {each.by} is {sides}")
    if len(found.loose) > MOST_NAMED:
        lines.append(f"  and {len(found.loose) - MOST_NAMED} more such entries")
    return lines


def _slope(value: float) -> str:
    return "without limit" if math.isnan(value) else number(value)


def _complex(value: complex) -> str:
    if not cmath.isfinite(value):
        return "-inf"
    return f"{value.real:.6g} {'+' if value.imag >= 0 else '-'} {abs(value.imag):.6g}j"


def margins_text(numbers: Mapping[str, float], unit: str) -> str:
    """Margins, or the numbers of a step response."""
    if "gain_at" not in numbers:
        return f"Step response\n{Table.of(['', ''], list(numbers.items())).text()}"
    rows = [
        ("gain margin", _gain(numbers["gain"]), _at(numbers["gain_at"], unit)),
        ("phase margin", f"{numbers['phase']:.4g} deg", _at(numbers["phase_at"], unit)),
        ("delay margin", f"{numbers['delay']:.4g} {unit}", ""),
    ]
    if numbers["is_stable"]:  # of an unstable loop, no sinusoid stays one
        modulus = numbers["modulus"]
        largest = _gain(1.0 / modulus) if modulus else "inf"
        rows.append(("largest sensitivity", largest, _at(numbers["modulus_at"], unit)))
    verdict = "stable" if numbers["is_stable"] else "not stable: the margins are those to stability"
    return f"Margins, closed loop {verdict}\n" + Table.of(["", "", ""], rows).text()


def _gain(value: float) -> str:
    if not math.isfinite(value) or value <= 0.0:
        return f"{value:.4g}"
    return f"{value:.4g} ({20.0 * math.log10(value):.4g} dB)"


def _at(frequency: float, unit: str) -> str:
    return f"at {frequency:.4g} rad/{unit}" if math.isfinite(frequency) else ""


def crossings(numbers: Mapping[str, float], unit: str) -> list[tuple[float, str]]:
    """The frequencies that a figure of margins marks, with the margins there."""
    found = [
        (numbers["gain_at"], f"gain margin {_gain(numbers['gain'])}"),
        (numbers["phase_at"], f"phase margin {numbers['phase']:.4g} deg"),
    ]
    return [
        (at, f"{text} at {at:.4g} rad/{unit}") for at, text in found if math.isfinite(at) and at > 0
    ]


def trim_text(found: Trim) -> str:
    """The values of an equilibrium, or what is missing."""
    if not found.is_equilibrium:
        named = [f"{name} = {number(value)}" for name, value in found.left[:MOST_NAMED]]
        return (
            f"no equilibrium found; the nearest point has {', '.join(named)}: free an input with "
            "--inputs, fix or bound less, or begin elsewhere with --state"
        )
    rows = [*found.inputs.items(), *found.states.items(), *found.outputs.items()]
    return f"Equilibrium\n{Table.of(['', ''], rows).text()}"


def overlay_text(title: str, found: Trim) -> str:
    """The overlay that begins a run at an equilibrium."""
    from runtime.document import dump_yaml

    safe = "".join(c for c in title if c.isprintable())
    return (
        f"# An equilibrium of {safe}. Lay it on with --with\n{dump_yaml(found.overlay).rstrip()}\n"
    )
