"""Edits of a graph that was right: what is found after each equals what a fresh check finds."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime.language.model as model_module
from runtime.language import Model, Surroundings, complete, diagnose
from runtime.network import Network
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


def compared(text: str, surroundings: Surroundings) -> bool:
    """Compare an edited text with the same text checked afresh; whether only a part was checked."""
    model, fresh = Model(text, PATH, surroundings), Model(text, PATH, Surroundings())
    found, wanted = diagnose(model), diagnose(fresh)
    assert found == wanted, f"{found}\n{wanted}"
    if model.syntax or model.network is None or fresh.network is None:
        return model._edited is not None
    types, wanted_types = model.network.types, fresh.network.types
    assert types.items() ^ wanted_types.items() == set()
    ends = [[(str(w.source), w.target) for w in m.network.wires] for m in (model, fresh)]
    assert ends[0] == ends[1]
    assert [*model.network.entries] == [*fresh.network.entries]
    assert not model.problems or model.network.scope.names() == fresh.network.scope.names()
    return model._edited is not None


def ask(seed: int, graphs: int, edits_of_each: int, length: int) -> tuple[int, int]:
    """Compare random edits of random graphs; returns how many texts, and of how many a part."""
    rng = random.Random(seed)
    done = parts = 0
    for _ in range(graphs):
        surroundings = Surroundings()
        writer = Writer(rng, rng.randrange(2, length))
        for _ in range(60):  # until it is right: edits start there
            if not diagnose(Model(writer.text, PATH, surroundings)) and surroundings.versions:
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
            text, version = writer.text, surroundings.versions.get(PATH)
            try:
                parts += compared(text, surroundings)
            except Exception as error:
                after = version.cut.source if version is not None else ""
                error.add_note(f"seed {seed}\n{text}\nafter\n{after}")
                raise
            done += 1
            if rng.random() < 0.6:
                writer.kinds, writer.blocks, writer.wires, writer.probes = before
    return done, parts


@given(st.integers(0, 2**32 - 1))
@pytest.mark.slow
def test_an_edit_is_judged_as_a_fresh_check_would(seed: int) -> None:
    done, _ = ask(seed, graphs=1, edits_of_each=8, length=7)
    assert done == 8


def test_most_edits_are_judged_in_part() -> None:
    done, parts = ask(7, graphs=2, edits_of_each=15, length=9)
    assert parts > 0.3 * done  # the rest are edits of a text with a problem, or of everything


@pytest.mark.slow
def test_five_thousand_edits_of_random_graphs() -> None:
    done, parts = ask(11, graphs=300, edits_of_each=17, length=16)
    assert done > 5000
    assert parts > 0.3 * done  # the rest are edits of a text with a problem, or of everything


def test_random_characters_in_a_plain_graph() -> None:
    """Texts that are no YAML, half entries, keys that are typed: each in a text that was right."""
    rng = random.Random(3)
    for _ in range(2):
        surroundings = Surroundings()
        right = chain(8)
        assert diagnose(Model(right, PATH, surroundings)) == []
        for text, _ in edits(right, rng, 15):
            compared(text, surroundings)
            compared(right, surroundings)
            for changed, _ in edits(right, rng, 1):
                compared(changed, surroundings)


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
    compared(changed, surroundings)
    found = [
        f"{each.address}: {each.message}" for each in diagnose(Model(changed, PATH, surroundings))
    ]
    assert any(message in each for each in found) if message else found == []
    compared(text, surroundings)  # and back again


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
    compared(LOOP.replace("d.out]", "g.out]"), surroundings)
    model = Model(LOOP.replace("d.out]", "g.out]"), PATH, surroundings)
    assert "algebraic loop: " in diagnose(model)[0].message
    compared(LOOP.replace("d: {input: g.out}", "d: {input: a.value}"), surroundings)


def counting(monkeypatch: pytest.MonkeyPatch, owner: Any, name: str) -> list[int]:
    """How often a function is called, from now on."""
    calls, original = [0], getattr(owner, name)

    def counted(*arguments: Any, **named: Any) -> Any:
        calls[0] += 1
        return original(*arguments, **named)

    monkeypatch.setattr(owner, name, counted)
    return calls


@pytest.mark.parametrize("count", [60, 240])
def test_an_edit_checks_what_it_touches(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """One value, one wire, one block: as much work for 60 blocks as for 240."""
    surroundings, text = Surroundings(), chain(count)
    assert diagnose(Model(text, PATH, surroundings)) == []
    wire, block = "b30: {input: b29.out}", "  b30: {type: Gain"
    changes: list[Callable[[str], str]] = [
        lambda text: text.replace("gain: 0.5, dt: 0.01}   # 30", "gain: 0.7, dt: 0.01}   # 30"),
        lambda text: text.replace(wire, "b30: {input: b20.out}"),
        lambda text: text.replace(block, f"  x: {{type: Constant, value: 1}}\n{block}"),
        lambda text: text.replace(wire, "b30: {input: b29.o}"),
    ]
    constructed = counting(monkeypatch, sys.modules["runtime.network.build"], "_construct")
    checked = counting(monkeypatch, Network, "context")
    scanned = counting(monkeypatch, model_module, "scan")
    parsed = counting(monkeypatch, model_module, "parse_yaml")
    for change in changes:
        constructed[0] = checked[0] = 0
        model = Model(change(text), PATH, surroundings)
        diagnose(model)
        offset = model.text.source.index("b30: {input: b") + len("b30: {input: b")
        assert complete(model, offset).offers
        assert constructed[0] <= 4
        assert checked[0] <= 4
    assert scanned[0] == parsed[0] == 0  # entries alone are read, in other modules
