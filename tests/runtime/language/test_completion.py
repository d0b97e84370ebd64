"""Completion on shipped graphs with edits, and in texts that do not parse."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from blocks.library.registry import BUILTIN
from blocks.neural.decoder_solvers import DecoderSolver
from blocks.neural.neurons import NeuronModel
from runtime.document import RUN_KEYS, SECTIONS, parse_yaml
from runtime.language import complete, hover
from runtime.language.settings import forms_of
from runtime.observation import METRIC_KINDS, PLOT_KINDS
from tests.runtime.language.texts import CASE_C, GRAPHS, edited, labels, marked, offered


@pytest.mark.parametrize(
    "new", ["lqr: {error: ¦}", "lqr: {error: ¦", "lqr: {error:¦", "lqr: {error: e¦"]
)
def test_an_input_is_offered_outputs_of_its_type_first(new: str) -> None:
    model, offset = edited("lqr: {error: error.state, reference: match.reference}", new)
    found = offered(model, offset)
    assert found[0].label == "error.state"
    assert found[0].detail == "TrackingState"
    assert found[0].text == (" error.state" if new.endswith("error:¦") else "error.state")
    assert len(found) > 10


def test_a_generic_input_is_offered_what_its_other_terms_are() -> None:
    model, offset = edited("baseline: {terms: [lqr.command,", "baseline: {terms: [lqr.command, ¦,")
    kinds = [offer.detail for offer in offered(model, offset)]
    assert kinds[0] == "Twist"
    assert kinds[: kinds.count("Twist")] == ["Twist"] * kinds.count("Twist")


def test_a_scalar_input_is_offered_components_of_records() -> None:
    model, offset = edited("turn_error: error.heading", "turn_error: ¦")
    found = labels(model, offset)
    assert found.index("error.heading") < found.index("plant.pose.theta")
    assert found.index("plant.pose.theta") < found.index("plant.pose")


def test_block_types_and_their_parameters() -> None:
    model, offset = edited("limit: {type: Saturator, omega_max: 1.5", "limit: {type: ¦")
    assert set(BUILTIN) <= set(labels(model, offset))
    model, offset = edited("type: Saturator, omega_max: 1.5", "type: Saturator, ¦")
    found = offered(model, offset)
    assert found[0].label == "omega_max"
    assert found[0].text == "omega_max: "
    assert "a number above 0 rad/s, required" in found[0].detail
    assert "dt" not in [offer.label for offer in found]  # written already


def test_required_parameters_come_as_a_snippet() -> None:
    model, offset = edited("limit: {type: Saturator, omega_max: 1.5, dt: 0.01}", "limit: {type: ¦}")
    snippets = {offer.label: offer.text for offer in offered(model, offset) if offer.is_snippet}
    assert snippets["Saturator with omega_max"] == (
        "Saturator, omega_max: ${1:a number above 0 rad/s}"
    )


def test_all_open_inputs_come_as_a_snippet() -> None:
    model, offset = edited("lqr: {error: error.state, reference: match.reference}", "lqr: {¦}")
    [snippet] = [offer for offer in offered(model, offset) if offer.is_snippet]
    assert snippet.text == "error: ${1:error.state}, reference: ${2|match.reference,plant.pose|}"


@pytest.mark.parametrize(
    ("new", "expected"),
    [
        ("¦run: {", {"without", "bypass", "extends"}),
        ("run: {¦, ", set(RUN_KEYS) - {"dt", "until", "seed"}),
        ("without: [¦]\nrun: {", {"lidar", "adaptive", "plant"}),
        ("bypass: [¦]\nrun: {", {"limit", "fault", "search"}),
        ("extends: ¦\nrun: {", {"wall_following_robust.yaml", "line_actuator_failure"}),
    ],
)
def test_sections_and_names(new: str, expected: set[str]) -> None:
    model, offset = edited("run: {", new)
    found = set(labels(model, offset))
    assert expected <= found
    assert "plant" not in found or "fitter" in found


def test_bypass_offers_only_what_has_a_way_through() -> None:
    model, offset = edited("probes:", "bypass: [¦]\nprobes:")
    assert "plant" not in labels(model, offset)


def test_kinds_and_options() -> None:
    model, offset = edited("kind: map", "kind: ¦")
    assert labels(model, offset) == list(PLOT_KINDS)
    model, offset = edited("kind: distance_floor, of", "kind: ¦, of")
    assert set(labels(model, offset)) == set(METRIC_KINDS)
    model, offset = edited("    engaged: explore.engaged\n", "    ¦\n")
    assert {"engaged", "body_radius", "xlim", "legend"} <= set(labels(model, offset))
    model, offset = edited("of: [pose, reference]", "of: [¦, reference]")
    assert labels(model, offset)[:4] == ["pose", "reference", "errors", "adaptive"]


def test_probes_offer_outputs_components_states_and_events() -> None:
    model, offset = edited("pose: {of: plant.pose", "pose: {of: ¦")
    found = {offer.label: offer.detail for offer in offered(model, offset)}
    assert found["plant.pose"] == "Pose"
    assert found["plant.pose.theta"] == "Scalar"
    assert found["adaptive.snn_v.spikes"] == "event"
    assert found["adaptive.snn_v.weights"] == "state"


def test_params_parts_and_worlds() -> None:
    model, offset = edited("omega_max: 1.5", "omega_max: $¦")
    assert labels(model, offset) == ["$v_r", "$d"]
    model, offset = edited("graph: parts/adaptive_snn.yaml", "graph: ¦")
    assert labels(model, offset)[0] == "parts/adaptive_snn.yaml"
    model, offset = edited("params: {rate_v: 1.0e-8, ", "params: {¦, ")
    assert {"neurons", "leak", "limit", "rate_v"} <= set(labels(model, offset))
    model, offset = edited("world: worlds/paper_room.yaml", "world: ¦")
    assert labels(model, offset)[0] == "worlds/cluttered_room.yaml"
    model, offset = edited("speed_input: error.position\n", "speed_input: ¦\n")
    assert model.network is not None
    assert "error.position" in labels(model, offset)[:20]


def test_inside_a_part_its_own_names_are_offered() -> None:
    part = GRAPHS / "parts" / "adaptive_snn.yaml"
    model, offset = edited("learn: inputs.learn}", "learn: ¦}", part)
    found = offered(model, offset)
    assert {"inputs.speed_input", "inputs.learn"} <= {o.label for o in found if o.rank == 0}
    model, offset = edited("command: join.out", "command: ¦", part)
    assert {"join.out", "snn_v.output"} <= set(labels(model, offset))
    model, offset = edited("speed_input: Scalar", "speed_input: ¦", part)
    assert {"Scalar", "Pose", "Vector(n)"} <= set(labels(model, offset))


NEURAL = """graph: g
run: {dt: 0.001, until: 1, stop: {¦1}}
blocks:
  a: {type: Constant, value: 1.0}
  e: {type: Ensemble, neurons: 10, radius: 1, ¦2, dt: 0.001}
  d: {type: Decoder, ¦3}
wires:
  e: {input: a.value}
  d: {spikes: e.spikes}
"""


@pytest.mark.parametrize(
    ("place", "new", "first"),
    [
        ("¦2", "neuron: ¦", ["LIF", "LIFRate"]),
        ("¦2", "neuron: {¦}", ["type", *NeuronModel.members["LIF"].declared]),
        ("¦2", "neuron: {type: ¦}", ["LIF", "LIFRate"]),
        ("¦2", "neuron: {type: Izhikevich, ¦", [*NeuronModel.members["Izhikevich"].declared]),
        ("¦2", "max_rates: ¦", ["uniform(low, high)", "normal(mean, deviation)"]),
        ("¦2", "learning: {rule: ¦}", ["voja"]),
        ("¦3", "learning: {¦}", ["rule"]),
        ("¦3", "learning: {rule: pes, ¦}", ["learning_rate", "tau"]),
        ("¦3", "synapse: ¦", ["lowpass(tau)", "none", "alpha(tau)"]),
        ("¦3", "solver: {type: l2, ¦}", [*DecoderSolver.members["l2"].declared]),
        ("¦1", "¦", ["when", "above", "below", "crosses"]),
        ("¦1", "when: ¦", ["a.value"]),
    ],
)
def test_inside_structured_parameters(place: str, new: str, first: list[str]) -> None:
    text = NEURAL.replace(place, new).replace(", ¦2", "").replace(", ¦3", "")
    text = text.replace(", stop: {¦1}", "")
    found = labels(*marked(text))
    assert found[: len(first)] == first


def test_a_number_is_offered_where_it_goes_into_all_neurons() -> None:
    text = NEURAL.replace(", stop: {¦1}", "").replace(", ¦2", "").replace(", ¦3", "")
    text = text.replace("  a: ", "  two: {type: Constant, value: [1.0, 2.0]}\n  a: ")
    for port, fitting in (("current", {"a.value"}), ("learn", {"a.value"}), ("input", {"a.value"})):
        found = offered(*marked(text.replace("input: a.value", f"input: a.value, {port}: ¦")))
        assert fitting <= {offer.label for offer in found if offer.rank == 0}, port
        assert "two.value" in {offer.label for offer in found if offer.rank == 3}, port


def test_what_a_setting_offers_can_be_read() -> None:
    """Each snippet, its places filled with numbers, is a value of its parameter."""
    for cls in BUILTIN.values():
        for name, declared in cls.spec.params.items():
            if declared.setting is None or name == "function":
                continue
            offers = list(forms_of(declared, in_flow=True))
            assert offers, name
            for offer in offers:
                text = re.sub(r"\$\{(\d+):[^}]*\}", r"1\1", offer.text).replace(", $1", "")
                declared.convert(parse_yaml(text, "").plain())


def test_choices_and_truth_values() -> None:
    model, offset = edited("fit: control_points", "fit: ¦")
    cls = BUILTIN["WallFitter"].spec.params["fit"]
    assert set(cls.choices) <= set(labels(model, offset))


def test_experiments() -> None:
    path = GRAPHS / "experiments" / "walls.yaml"
    model, offset = edited("{without: adaptive}", "{without: ¦}", path)
    assert {"adaptive", "lqr"} <= set(labels(model, offset))
    model, offset = edited("seeds: 20..39", "¦", path)
    assert {"seeds", "vary", "minimize"} <= set(labels(model, offset))
    model, offset = edited("replace: {lqr: PathPID}", "replace: {lqr: ¦}", path)
    assert "PurePursuit" in labels(model, offset)


REPEATED = """
blocks:
  in: {type: Constant, value: [1, 2]}
  p:
    repeat: 2
    inputs: {x: Scalar}
    outputs: {y: g.out}
    blocks: {g: {type: Gain, gain: 2}}
    wires: {g: {input: inputs.x}}
wires: {p: {x: in.value}}
"""


def test_what_all_copies_have_can_be_left_out() -> None:
    model, offset = marked(f"without: [¦]\n{REPEATED}")
    found = labels(model, offset)
    assert {"in", "p", "p.g"} <= set(found) and not any("copy_" in label for label in found)
    model, offset = marked(f"bypass: [¦]\n{REPEATED}")
    assert set(labels(model, offset)) == {"p.g"}
    model, offset = marked(f"without: [p¦.g]\n{REPEATED}")
    card = hover(model, offset)
    assert card is not None and "Gain" in card.markdown


@pytest.mark.parametrize("text", ["¦", "gr¦", "blocks:\n  a: {type: ¦", "wires: {¦", "x: ¦\n  - {"])
def test_texts_that_hardly_exist_yet(text: str) -> None:
    model, offset = marked(text)
    complete(model, offset)
    if text == "¦":
        assert set(SECTIONS) <= set(labels(model, offset))


def test_a_new_block_is_named_as_the_wires_name_it(tmp_path: Path) -> None:
    text = "blocks:\n  ¦\nwires:\n  sum: {terms: [a.out]}\n"
    model, offset = marked(text, tmp_path / "x.yaml")
    assert labels(model, offset)[:2] == ["a", "sum"]


def test_nothing_in_comments() -> None:
    model, offset = edited("graph: wall_following\n", "# graph: ¦\ngraph: wall_following\n", CASE_C)
    assert labels(model, offset) == []
