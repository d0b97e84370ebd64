"""Neuron models, solvers, synapses, distributions and rules: searched, shown, and in the docs."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from blocks.library.registry import BUILTIN
from runtime.descriptions import forms, settings, variants
from tests.conftest import Run


@pytest.mark.parametrize(
    "word", ["nnls", "lasso", "l2_noise", "alpha", "izhikevich", "voja", "sphere"]
)
def test_every_setting_is_found_by_its_name(cli: Run, word: str) -> None:
    done = cli("blocks", "--search", word)
    assert done.returncode == 0, done.stderr
    assert any(line.strip().lower().startswith(word) for line in done.stdout.split("\n"))
    assert "for " in done.stdout


@pytest.mark.parametrize("name", ["Direct", "LIF", "alpha", "pes", "Delay", "Gain"])
def test_what_is_called_as_the_word_is_listed_first(cli: Run, name: str) -> None:
    first = cli("blocks", "--search", name).stdout.split("\n")[1]
    assert first.split()[0].partition("(")[0] == name


def test_a_setting_is_found_by_its_parameters(cli: Run) -> None:
    """Poisson spikes are a choice of the rate models, and found there."""
    found = cli("blocks", "--search", "poisson").stdout
    assert "LIFRate" in found
    assert "Izhikevich" not in found
    assert "AdaptiveLIF " in cli("blocks", "--search", "inc_n").stdout


def test_a_block_shows_what_its_parameters_choose_from(cli: Run) -> None:
    shown = cli("blocks", "Ensemble").stdout
    for name in ("Izhikevich", "tau_ref: 0.002", "uniform(low, high)", "voja", "alpha(tau)"):
        assert name in shown
    assert "min |A D - Y|^2" in cli("blocks", "Decoder").stdout


def test_a_setting_is_shown_alone(cli: Run) -> None:
    shown = cli("blocks", "AdaptiveLIF").stdout
    assert "adaptation per spike" in shown
    assert "for Ensemble.neuron, " in shown
    assert ", as in neuron: {type: AdaptiveLIF, amplitude: ...}" in shown
    found = json.loads(cli("blocks", "pes", "--json").stdout)["pes"]
    assert found["for"] == ["Decoder.learning"]
    assert found["parameters"]["learning_rate"]["default"] == 1e-4
    assert "did you mean 'lasso'" in cli("blocks", "laso").stderr


def test_the_docs_have_every_setting() -> None:
    page = (Path(__file__).parents[3] / "docs" / "blocks" / "neural.md").read_text(encoding="utf-8")
    own = {name: cls for name, cls in BUILTIN.items() if "neural" in cls.__module__}
    rows = [form for setting in settings(own) for form, *_ in forms(setting)]
    assert len(rows) > 30
    assert all(f"| `{row}` |" in page for row in rows)
    assert {"LIF", "nnls_l2", "alpha", "pes", "bcm"} <= variants(BUILTIN).keys()
