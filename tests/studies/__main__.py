"""Measure the paper's claims and write docs/reproduction.md.

python -m tests.studies [seeds] [seeds of case C]
"""

from __future__ import annotations

import sys
from pathlib import Path

from runtime.simulate import versions
from tests.studies.claims import beyond, case_a, case_b
from tests.studies.walls import section

PAGE = Path(__file__).parent.parent.parent / "docs" / "reproduction.md"

HEAD = """# What of the paper is reproduced

"Adaptive Wall-Following Control for Unmanned Ground Vehicles Using Spiking Neural Networks",
Yang, Chen, Fan, Shao and Sun. Written by `python -m tests.studies`; every figure comes from a run
of the shipped graphs over {seeds} seeds (0 to {last}), as mean ± standard deviation. A seed draws
the neurons and, in case B, the noise; the LQR alone in case A has neither and is run once.
Errors are the true pose's. The gains Q, R, the learning rate, the time constants and the window
are not in the paper; the graphs give ours, which were chosen on seeds 0 to 9.

Versions: {versions}.

## Claims
"""

BEYOND = """
## Soft and well-tuned gains, the printed rule and ours

`robust` descends e_theta + lambda times the signed lateral error, with weights that leak
(`graphs/*_robust.yaml`). "Settled" means within 0.1 m and 0.1 rad for good before the end; the
position error is the mean distance to the path (from 10 s on in case B, lateral in case A).
"""


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(row) + " |" for row in (head, ("---",) * len(head), *rows)]
    return "\n".join(lines) + "\n"


def page(seeds: int, seeds_c: int) -> str:
    """docs/reproduction.md, measured now."""
    claims = [*case_a(seeds), *case_b(seeds)]
    installed = ", ".join(f"{name} {number}" for name, number in versions().items())
    rows = [(c.id, c.paper, c.rule, c.ours, c.verdict) for c in claims]
    return "\n".join(
        (
            HEAD.format(seeds=seeds, last=seeds - 1, versions=installed),
            table(("id", "the paper says", "our rule", "measured", "verdict"), rows),
            *(f"**{c.id}.** {c.why}\n" for c in claims if c.why),
            BEYOND,
            table(
                ("case", "gains", "controller", "settled", "at", "position error", "distance"),
                beyond(seeds),
            ),
            section(seeds_c),
        )
    )


if __name__ == "__main__":
    numbers = [int(number) for number in sys.argv[1:]] or [10]
    text = page(numbers[0], numbers[-1])
    PAGE.write_text(text, encoding="utf-8")
    print(text)
