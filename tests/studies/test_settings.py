"""What earlier tunings found is what graphs and experiments ship."""

from __future__ import annotations

from pathlib import Path

import pytest
import yaml

import runtime
from runtime.experiments.design import read_experiment
from tests.studies.causes import CASES

SETTINGS = Path(__file__).parent / "settings"
FOUND = yaml.safe_load((SETTINGS / "found.yaml").read_text(encoding="utf-8"))
CASE = ("v_r", "gain")  # the reference speed is the case's


def test_the_shipped_robust_graphs_differ_from_their_cases_by_one_rule() -> None:
    """The same blocks with the same parameters; v_r, a param of each case, is not the rule's."""

    def parameters(name: str) -> dict[str, tuple[str, dict[str, object]]]:
        return {
            key: (
                entry.cls.__name__,
                {p: str(v) for p, v in entry.block.parameters().items() if p not in CASE},
            )
            for key, entry in runtime.load(name).network.entries.items()
        }

    rules = []
    for case in CASES.values():
        plain, robust = parameters(case), parameters(f"{case}_robust")
        rules.append({key: robust[key] for key in robust if robust[key] != plain.get(key)})
    assert rules[0] == rules[1] == rules[2]
    assert "adaptive.snn_omega" in rules[0]


def test_the_shipped_setting_is_the_one_that_was_found() -> None:
    entries = runtime.load("wall_following_robust").network.entries
    for path, value in FOUND["one setting"].items():
        address = path.replace("adaptive.params", "adaptive.snn_omega")
        block, _, key = address.rpartition(".")
        assert entries[block].block.value(key) == value, path


@pytest.mark.slow
@pytest.mark.parametrize("path", sorted(SETTINGS.glob("**/*.yaml")), ids=lambda path: path.stem)
def test_the_tunings_can_be_run_again(path: Path) -> None:
    if "vary:" in path.read_text(encoding="utf-8"):
        names = [factor.path for factor in read_experiment(str(path)).entries.factors]
        task, name = path.parent.name, path.stem
        found = [*FOUND.get(task, {"": FOUND["one setting"]}).items()]
        assert any(
            set(values) == set(names)
            and key.lower().replace(",", "").replace(" ", "_") in ("", name)
            for key, values in found
        )
