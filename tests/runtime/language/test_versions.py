"""Edits of a graph that was right: what is found after each equals what a fresh check finds."""

from __future__ import annotations

import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime.language.model as model_module
import runtime.network.build as build_module
from blocks.core import Block
from runtime.language import Model, Surroundings, complete, diagnose
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
            before = dict(writer.kinds), dict(writer.blocks), dict(writer.wires), dict(writer.probes)
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
