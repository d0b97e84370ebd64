"""Edits of a text: with the blocks of earlier texts used again, the same is found as without."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from runtime.language import Model, Surroundings, diagnose
from tests.runtime.language.test_fuzz import edits
from tests.runtime.language.texts import chain

PATH = Path("/nowhere/g.yaml")
# Types of blocks with what may be written behind them, and their inputs and outputs.
MENU: dict[str, tuple[list[str], list[str], list[str]]] = {
    "Constant": (["value: 1.0", "value: [1, 2]", "value: $k", "value: x"], [], ["value"]),
    "Sine": (["", "frequency: 2.0", "amplitude: 3", "amplitude: $k", "amp: 3"], [], ["out"]),
    "Gain": (["gain: 2", "gain: $k", "gain: [1, 2]", "gain: 2, dt: 0.02"], ["input"], ["out"]),
    "Sum": (["", "signs: [1, -1]"], ["terms"], ["out"]),
    "Function": (["expression: u[0]", "expression: u[1] + t", "expression: u["], ["u"], ["out"]),
    "Concatenate": ([""], ["inputs"], ["out"]),
    "Switch": ([""], ["select", "on", "off"], ["out"]),
    "UnitDelay": (["", "signal: Scalar", "signal: Twist"], ["input"], ["out"]),
    "Integrator": (["", "initial: 1.0"], ["input"], ["out"]),
    "Derivative": ([""], ["input"], ["out"]),
    "Saturator": (["omega_max: 1.5", "omega_max: -1"], ["command"], ["limited"]),
    "DifferentialDrive": ([""], ["command"], ["pose", "wheels"]),
    "Ensemble": (["neurons: 10", "neurons: 12, dimensions: 2"], ["input"], ["spikes"]),
    "Decoder": (["", "function: x[0]"], ["spikes"], ["value"]),
    "LinePath": ([""], [], ["path"]),
    "Gian": ([""], ["input"], ["out"]),
}
VARIADIC = {"Sum", "Function", "Concatenate"}
COMPONENTS = ["", "", "", "", ".x", ".v", "[0]", "[0:1]"]


class Writer:
    """A random graph as lines, which edits change."""

    def __init__(self, rng: random.Random, count: int) -> None:
        self.rng = rng
        self.kinds = {f"b{i}": self.kind() for i in range(count)}
        self.blocks = {name: self.block(name) for name in self.kinds}
        self.wires = {name: self.wire(name) for name in self.kinds if MENU[self.kinds[name]][1]}
        self.probes = {"p": self.source()}
        self.top = "graph: g\nrun: {dt: 0.01, until: 1.0}\nparams: {k: 2.0}\n"

    def kind(self) -> str:
        # Mostly blocks that pass a type on: what an edit changes has far to go.
        usual = ["Constant", "Sine", "Gain", "Gain", "Gain", "Sum", "UnitDelay", "Integrator"]
        return self.rng.choice(usual if self.rng.random() < 0.8 else [*MENU])

    def block(self, name: str) -> str:
        written = self.rng.choice(MENU[self.kinds[name]][0])
        return f"{{type: {self.kinds[name]}{', ' if written else ''}{written}}}"

    def source(self) -> str:
        name = self.rng.choice([*self.kinds])
        component = self.rng.choice(COMPONENTS) if self.rng.random() < 0.2 else ""
        return f"{name}.{self.rng.choice(MENU[self.kinds[name]][2])}{component}"

    def wire(self, name: str) -> str:
        ports = []
        for port in MENU[self.kinds[name]][1]:
            many = self.kinds[name] in VARIADIC
            source = self.source()
            if many:
                source = f"[{', '.join(self.source() for _ in range(self.rng.choice((1, 2, 3))))}]"
            ports.append(f"{port}: {source}")
        return f"{{{', '.join(ports)}}}"

    @property
    def text(self) -> str:
        sections = {"blocks": self.blocks, "wires": self.wires, "probes": self.probes}
        lines = [
            line
            for section, entries in sections.items()
            for line in (f"{section}:", *(f"  {name}: {text}" for name, text in entries.items()))
        ]
        return self.top + "\n".join([*lines, ""])

    def edit(self) -> None:
        """Change one value, one wire, one block."""
        rng = self.rng
        name = rng.choice([*self.kinds])
        kind = rng.random()
        if kind < 0.3:
            self.blocks[name] = self.block(name)
        elif kind < 0.6 and name in self.wires:
            self.wires[name] = self.wire(name)
        elif kind < 0.7:
            self.wires.pop(name, None)
        elif kind < 0.8:
            self.kinds[name] = self.kind()
            self.blocks[name] = self.block(name)
        elif kind < 0.87:
            new = f"n{rng.randrange(5)}"
            self.kinds[new] = self.kind()
            self.blocks[new] = self.block(new)
            if MENU[self.kinds[new]][1] and rng.random() < 0.7:
                self.wires[new] = self.wire(new)
        elif kind < 0.93 and len(self.kinds) > 2:
            del self.kinds[name]
            self.blocks.pop(name)
        else:
            self.probes["p"] = self.source()


def compare(text: str, surroundings: Surroundings) -> None:
    """Compare an edited text with the same text checked without anything of earlier texts."""
    model, fresh = Model(text, PATH, surroundings), Model(text, PATH, Surroundings())
    found, wanted = diagnose(model), diagnose(fresh)
    assert found == wanted, f"{found}\n{wanted}"
    if model.syntax or model.network is None or fresh.network is None:
        return
    types, wanted_types = model.network.types, fresh.network.types
    assert types.items() ^ wanted_types.items() == set()
    ends = [[(str(w.source), w.target) for w in m.network.wires] for m in (model, fresh)]
    assert ends[0] == ends[1]
    assert [*model.network.entries] == [*fresh.network.entries]
    assert model.network.notes == fresh.network.notes


def edit_at_random(seed: int, graphs: int, edits_of_each: int, length: int) -> int:
    """Compare random edits of random graphs; returns how many graphs were right at some time."""
    rng = random.Random(seed)
    right = 0
    for _ in range(graphs):
        surroundings = Surroundings()
        writer = Writer(rng, rng.randrange(2, length))
        for _ in range(60):  # until it is right: edits start there
            if not diagnose(Model(writer.text, PATH, surroundings)):
                right += 1
                break
            writer = Writer(rng, rng.randrange(2, length))
        for _ in range(edits_of_each):
            before = (
                dict(writer.kinds),
                dict(writer.blocks),
                dict(writer.wires),
                dict(writer.probes),
            )
            writer.edit()
            try:
                compare(writer.text, surroundings)
            except Exception as error:
                error.add_note(f"seed {seed}\n{writer.text}")
                raise
            if rng.random() < 0.6:
                writer.kinds, writer.blocks, writer.wires, writer.probes = before
    return right


@given(st.integers(0, 2**32 - 1))
@pytest.mark.slow
def test_an_edit_is_checked_as_a_new_text_is(seed: int) -> None:
    edit_at_random(seed, graphs=1, edits_of_each=8, length=7)


def test_edits_of_two_random_graphs() -> None:
    assert edit_at_random(7, graphs=2, edits_of_each=15, length=9) > 0


@pytest.mark.slow
def test_edits_of_many_random_graphs() -> None:
    assert edit_at_random(11, graphs=300, edits_of_each=17, length=16) > 150


def test_random_characters_in_a_plain_graph() -> None:
    """Texts that are no YAML, half entries, keys that are typed: each in a text that was right."""
    rng = random.Random(3)
    for _ in range(2):
        surroundings = Surroundings()
        right = chain(8)
        assert diagnose(Model(right, PATH, surroundings)) == []
        for text, _ in edits(right, rng, 15):
            compare(text, surroundings)
            compare(right, surroundings)
            for changed, _ in edits(right, rng, 1):
                compare(changed, surroundings)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("gain: 0.5, dt: 0.01}   # 3", "gain: 0.6, dt: 0.01}   # 3", ""),
        ("b3: {input: b2.out}", "b3: {input: b1.out}", ""),
        ("b3: {input: b2.out}", "b3: {input: b2.ou}", "has no output 'ou', did you mean 'out'?"),
        ("b3: {input: b2.out}", "b3: {input: b3.out}", "the signal type of 'b3.input' is open"),
        ("b3: {input: b2.out}", "b3: {input: b5.out}", "the signal type of 'b5.input' is open"),
        ("  b3: {input: b2.out}\n", "", "input 'b3.input' is not connected"),
        ("b3: {input: b2.out}", "b3: {input: b2.out", "this '{' is not closed"),
        ("  b3: {type: Gain", "  x: {type: Constant, value: 1}\n  b3: {type: Gain", ""),
        ("  b3: {type", "  x3: {type", "there is no block 'b3'"),
        ("blocks:\n", "blocks:\n\n  # a note\n", ""),
        ("blocks:\n", "blocks:\n  'q': {type: Gian}\n", "no block type 'Gian'"),
        ("last: b7.out", "last: b7.oud", "has no output or state 'oud'"),
        ("until: 1.0", "until: x", "run.until: expected"),
    ],
)
def test_one_edit(old: str, new: str, message: str) -> None:
    surroundings, text = Surroundings(), chain(8)
    assert diagnose(Model(text, PATH, surroundings)) == []
    assert text.count(old) == 1
    changed = text.replace(old, new)
    compare(changed, surroundings)
    found = [
        f"{each.address}: {each.message}" for each in diagnose(Model(changed, PATH, surroundings))
    ]
    assert any(message in each for each in found) if message else found == []
    compare(text, surroundings)  # and back again


LOOP = """graph: g
blocks:
  a: {type: Constant, value: 1.0}
  s: {type: Sum}
  g: {type: Gain, gain: 2.0}
  d: {type: UnitDelay}
wires:
  s: {terms: [a.value, d.out]}
  g: {input: s.out}
  d: {input: g.out}
"""


def test_an_edit_that_closes_a_loop() -> None:
    surroundings = Surroundings()
    assert diagnose(Model(LOOP, PATH, surroundings)) == []
    compare(LOOP.replace("d.out]", "g.out]"), surroundings)
    model = Model(LOOP.replace("d.out]", "g.out]"), PATH, surroundings)
    assert "algebraic loop: " in diagnose(model)[0].message
    compare(LOOP.replace("d: {input: g.out}", "d: {input: a.value}"), surroundings)


def test_an_edit_constructs_only_the_blocks_that_differ() -> None:
    surroundings, text = Surroundings(), chain(60)
    assert diagnose(Model(text, PATH, surroundings)) == []
    earlier = dict(surroundings.block_cache)
    changed = text.replace("gain: 0.5, dt: 0.01}   # 30", "gain: 0.7, dt: 0.01}   # 30")
    assert diagnose(Model(changed, PATH, surroundings)) == []
    assert len(surroundings.block_cache) == len(earlier) + 1
    assert all(surroundings.block_cache[key] is block for key, block in earlier.items())
