"""A graph in two exports, by ``blocks`` and by ``others``: both do what the whole does."""

from __future__ import annotations

from pathlib import Path

import pytest

import runtime
from runtime import toolchain
from runtime.errors import GraphError, UsageError
from runtime.export import export
from tests.runtime.export.test_whole_graphs import shipped

QUICK = ("gallery/pid_loop", "gallery/published/two_clocks")
# What a split cannot separate, with what the message says then.
REASONS = (
    "in the same tick",
    "integrated together with what",
    "that only the whole of it solves",
    "computes no output that changes in a run",
    "no block is left",
    "belongs to a part that is enabled",
)


@pytest.mark.skipif(not toolchain.available(), reason="needs a C compiler")
@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=() if n in QUICK else pytest.mark.slow) for n in shipped()]
)
def test_two_parts_replay_or_say_why_not(name: str, tmp_path: Path) -> None:
    graph = runtime.load(name)
    done = 0
    names = sorted(graph.network.entries)
    for i, block in enumerate(names if len(names) < 5 else names[:: len(names) // 4]):
        for kind in ("blocks", "others"):
            try:
                # The replay of each is compared while it is written; a difference is an error.
                made = export(graph, tmp_path / f"{i}{kind}", ticks=60, **{kind: [block]})
            except (UsageError, GraphError) as error:
                assert any(reason in str(error) for reason in REASONS), f"{block}: {error}"
                continue
            assert "WRONG" not in made.report and "largest difference" in made.report
            done += 1
    assert done or name not in QUICK
