"""Messages: location, cause and suggested fix, all at once, without errors that only follow."""

from __future__ import annotations

import pickle
from pathlib import Path

import pytest

import runtime
from blocks import Constant
from runtime.document.sections import SECTIONS
from runtime.errors import (
    NOWHERE,
    GraphError,
    MissingExtraError,
    Problem,
    Problems,
    SimulationError,
    SpikeblocksError,
    UsageError,
    Where,
)
from runtime.observation.metrics import METRIC_KINDS
from tests.runtime.broken import PART, SOUND, changed, problems, with_part

CASES = {
    # -- sections
    "section": [
        ("probes:", "probs:"),
        "g.yaml:16:1: probs: unknown section, did you mean 'probes'?",
    ],
    "section of wires": [
        ("wires:", "wirs:"),
        "g.yaml:10:1: wirs: unknown section, did you mean 'wires'?",
    ],
    "section of blocks": [
        ("blocks:", "bloks:"),
        "g.yaml:3:1: bloks: unknown section, did you mean 'blocks'?",
    ],
    "section unknown": [
        "extra: 1\n",
        f"g.yaml:18:1: extra: unknown section; expected {', '.join(SECTIONS)}",
    ],
    "list for a section": [
        "plots: [a]\n",
        "g.yaml:18:8: plots: expected entries such as "
        "'path: {kind: trajectory, of: plant.pose}', got ['a']",
    ],
    "title": [
        ("graph: g", "graph: [g]"),
        "g.yaml:1:8: graph: expected a title, one line of up to 120 characters, got ['g']",
    ],
    # -- run
    "dt of a text": [
        ("dt: 0.01", "dt: 0.01s"),
        "g.yaml:2:11: run.dt: expected a number of seconds above 0, got the string '0.01s'",
    ],
    "dt forgotten": [
        ("dt: 0.01", "dt: "),
        "g.yaml:2:11: run.dt: expected a number of seconds above 0, got nothing (null)",
    ],
    "dt zero": [
        ("dt: 0.01", "dt: 0"),
        "g.yaml:2:11: run.dt: expected a number of seconds above 0, got 0",
    ],
    "until before dt": [
        ("until: 0.1", "until: 0.005"),
        "g.yaml:2:24: run.until: 0.005 s are 0.5 ticks of dt = 0.01 s; expected one or more",
    ],
    "until without end": [
        ("until: 0.1", "until: 1e308"),
        "g.yaml:2:24: run.until: 1e+308 s are inf ticks of dt = 0.01 s; at most 1e+12 can run",
    ],
    "memory": [
        ("until: 0.1", "until: 1e9"),
        "g.yaml:17:9: probes.pose: recording takes 2.183 TiB, most of it 'pose'; record it less "
        "often, {of: plant.pose, every: 100}, or run shorter",
    ],
    "seed": [
        ("until: 0.1", "until: 0.1, seed: -1"),
        "g.yaml:2:35: run.seed: expected a non-negative integer, got -1",
    ],
    "seed of a list": [
        ("until: 0.1", "until: 0.1, seed: [1]"),
        "g.yaml:2:35: run.seed: expected a non-negative integer, got [1]",
    ],
    "key of run": [
        ("until:", "utnil:"),
        "g.yaml:2:17: run.utnil: unknown key, did you mean 'until'?",
    ],
    # -- params
    "param missing": [
        ("{type: LinePath}", "{type: LinePath, y: $z}"),
        "g.yaml:4:30: blocks.track.y: there is no param 'z'; params: none",
    ],
    "param in a list": [
        ("q: [1, 1, 1]", "q: [$z, 1, 1]"),
        "g.yaml:7:24: blocks.lqr.q[0]: there is no param 'z'; params: none",
    ],
    "param misspelt": [
        ("until: 0.1}", "until: $untl}\nparams: {until: 0.1}"),
        "g.yaml:2:24: run.until: there is no param 'untl', did you mean 'until'?",
    ],
    "param unused": [
        "params: {v: 1}\n",
        "g.yaml:18:10: params.v: $v is not used; remove it, or write it as a value",
    ],
    "param of params": [
        ("{type: LinePath}", "{type: LinePath, y: $a}"),
        "params: {a: $b, b: 2*$a}\n",
        "g.yaml:18:13: params.a: the param is computed from itself: $a -> $b -> $a",
    ],
    "arithmetic of params": [
        ("{type: LinePath}", "{type: LinePath, y: $a}"),
        "params: {a: 2*$b*c, b: 1}\n",
        "g.yaml:18:13: params.a: expected arithmetic with numbers, as in '$d * 0.5': "
        "unknown name 'c'; known: pi, e, tau (in '2*$b*c')",
    ],
    "value of a param": [
        ("{type: LinePath}", "{type: LinePath, samples: $n}"),
        "params: {n: many}\n",
        "g.yaml:18:13: blocks.track.samples: expected an integer at least 2, got the string 'many'",
    ],
    "params no mapping": [
        ("{type: LinePath}", "{type: LinePath, y: $a}"),
        "params: 3\n",
        "g.yaml:18:9: params: expected entries such as 'v_r: 1.0', got 3",
    ],
    # -- blocks
    "block type": [
        ("type: LinePath", "type: LinePth"),
        "g.yaml:4:17: blocks.track.type: no block type 'LinePth', did you mean 'LinePath'?",
    ],
    "block type of its own": [
        ("type: LinePath", "type: Custom"),
        "g.yaml:4:17: blocks.track.type: no block type 'Custom'; see 'runtime blocks'; your own "
        "block needs 'module: file.py'",
    ],
    "no type": [
        ("{type: LinePath}", "{y: 3}"),
        "g.yaml:4:3: blocks.track: expected a type, as in {type: Sum}; see 'runtime blocks'",
    ],
    "type misspelt": [
        ("{type: LinePath}", "{y: 3, typ: LinePath}"),
        "g.yaml:4:17: blocks.track: unknown key 'typ', did you mean 'type'?",
    ],
    "block of a text": [
        ("{type: LinePath}", "LinePath"),
        "g.yaml:4:10: blocks.track: expected {type: ...}, got the string 'LinePath'",
    ],
    "block name": [
        ("  track: {", "  1track: {"),
        ("track.path", "1track.path"),
        "g.yaml:4:3: blocks.1track: '1track' is not a name for a block; use letters, digits and _",
    ],
    "block named inputs": [
        ("  track: {", "  inputs: {"),
        ("track.path", "inputs.path"),
        "g.yaml:4:3: blocks.inputs: 'inputs' is reserved for the ports of a part; give the block "
        "another name",
    ],
    "colon missing": [
        ("  track: {", "  track {"),
        "g.yaml:4:3: blocks.track {type: a colon is missing after 'track'",
    ],
    "parameter": [
        ("{type: MatchingPoint}", "{type: MatchingPoint, widow: 3}"),
        "g.yaml:5:32: blocks.match.widow: unknown parameter, did you mean 'window'?",
    ],
    "parameter misspelt and required": [
        ("  plant: {type", "  g: {type: Gain, gian: 2}\n  plant: {type"),
        ("wires:\n", "wires:\n  g: {input: lqr.command}\n"),
        "g.yaml:9:19: blocks.g.gian: unknown parameter, did you mean 'gain'?",
    ],
    "parameter required": [
        ("  plant: {type", "  g: {type: Gain}\n  plant: {type"),
        ("wires:\n", "wires:\n  g: {input: lqr.command}\n"),
        "g.yaml:9:3: blocks.g.gain: missing; expected a number or an array of n or m x n numbers: "
        "the factor, one per component, or a matrix by rows",
    ],
    "decimal comma": [
        ("{type: LinePath}", "{type: LinePath, y: 3,5}"),
        "g.yaml:4:32: blocks.track.5: unknown parameter; a decimal point is a dot, as in y: 3.5",
    ],
    "decimal comma with an exponent": [
        ("{type: LinePath}", "{type: LinePath, y: 3,5e-6}"),
        "g.yaml:4:32: blocks.track.5e-6: unknown parameter; a decimal point is a dot, as in y: "
        "3.5e-6",
    ],
    "degrees where degrees per second are meant": [
        ("  plant: {type", "  limit: {type: Saturator, omega_max: 60 deg}\n  plant: {type"),
        ("wires:\n", "wires:\n  limit: {command: lqr.command}\n"),
        "g.yaml:9:39: blocks.limit.omega_max: expected a number above 0 rad/s, got the string "
        "'60 deg'; in degrees, it is 60deg/s",
    ],
    "number with its unit": [
        ("{type: LinePath}", "{type: LinePath, y: 3 m}"),
        "g.yaml:4:30: blocks.track.y: expected a number in m, got the string '3 m'; write the "
        "number alone, in m",
    ],
    "decimal comma in a block of lines": [
        ("{type: LinePath}", "\n    type: LinePath\n    y: -3,5"),
        "g.yaml:6:8: blocks.track.y: expected a number in m, got the string '-3,5'; a decimal "
        "point is a dot: -3.5",
    ],
    "two wires to one input": [
        ("pose: plant.pose,", "pose: [plant.pose, plant.pose],"),
        "g.yaml:11:17: wires.match.pose: expected one producer.output, got "
        "['plant.pose', 'plant.pose']; to add signals, wire them to a Sum: {terms: [a.out, b.out]}",
    ],
    "two wires to one input, one by one": [
        ("pose: plant.pose,", "pose: plant.pose, pose: plant.pose,"),
        "g.yaml:11:29: wires.match.pose: duplicate key, first in line 11; keep one; to add two "
        "signals, wire both to a Sum: {terms: [a.out, b.out]}",
    ],
    "too large a block": [
        ("{type: LinePath}", "{type: LinePath, samples: 1000000000000}"),
        "g.yaml:4:3: blocks.track: 'path' would take 2.98e+04 GiB; make it smaller",
    ],
    "too large a probe": [
        ("  plant: {type", "  snn: {type: AdaptiveEnsemble, neurons: 2000000}\n  plant: {type"),
        ("wires:\n", "wires:\n  snn: {input: error.position, error: error.position}\n"),
        ("dt: 0.01", "dt: 0.001"),
        "  spikes: snn.spikes\n",
        "g.yaml:20:11: probes.spikes: 2000000 columns are too many to record; name one, "
        "'snn.spikes.0'",
    ],
    "no whole multiple": [
        ("{type: LinePath}", "{type: LinePath, dt: 0.015}"),
        "g.yaml:4:31: blocks.track.dt: 0.015 s is not a multiple of run.dt = 0.01 s; the "
        "nearest is 0.02",
    ],
    "module missing": [
        ("{type: LinePath}", "{type: LinePath, module: own.py}"),
        "g.yaml:4:35: blocks.track.module: no such file: 'own.py'; paths are relative to the "
        "graph's own file",
    ],
    "module no file": [
        ("{type: LinePath}", "{type: LinePath, module: [own.py]}"),
        "g.yaml:4:35: blocks.track.module: expected a Python file, got ['own.py']",
    ],
    # -- wires
    "producer": [
        ("pose: plant.pose, path", "pose: plnt.pose, path"),
        "g.yaml:11:17: wires.match.pose: there is no block 'plnt', did you mean 'plant'?",
    ],
    "output": [
        ("pose: plant.pose, path", "pose: plant.pos, path"),
        "g.yaml:11:17: wires.match.pose: 'plant' has no output 'pos', did you mean 'pose'?",
    ],
    "block for an output": [
        ("pose: plant.pose, path", "pose: total, path"),
        "g.yaml:11:17: wires.match.pose: 'total' is a block; expected one of its outputs: "
        "total.out",
    ],
    "state": [
        ("pose: plant.pose, path", "pose: lqr.cost_to_go, path"),
        "g.yaml:11:17: wires.match.pose: 'cost_to_go' of 'lqr' is a state; it can be probed but "
        "not wired",
    ],
    "no address": [
        ("pose: plant.pose, path", "pose: plant.pose., path"),
        "g.yaml:11:17: wires.match.pose: 'plant.pose.' is not an address; expected block.output",
    ],
    "too many parts": [
        ("pose: plant.pose, path", "pose: plant.pose.x.y, path"),
        "g.yaml:11:17: wires.match.pose: 'plant.pose.x.y' has too many parts; expected "
        "block.output.component",
    ],
    "inputs outside a part": [
        ("pose: plant.pose, path", "pose: inputs.pose, path"),
        "g.yaml:11:17: wires.match.pose: 'inputs.pose' is not an input of this graph; its "
        "inputs: none",
    ],
    "wire of a number": [
        ("pose: plant.pose, path", "pose: 3, path"),
        "g.yaml:11:17: wires.match.pose: expected one producer.output, got 3; a number comes from "
        "a block {type: Constant, value: ...}",
    ],
    "wire of a list": [
        ("pose: plant.pose, path", "pose: [plant.pose], path"),
        "g.yaml:11:17: wires.match.pose: expected one producer.output, got ['plant.pose']",
    ],
    "wire forgotten": [
        ("pose: plant.pose, path", "pose: , path"),
        "g.yaml:11:17: wires.match.pose: expected one producer.output, got nothing (null)",
    ],
    "terms forgotten": [
        ("terms: [lqr.command, match.feedforward]", "terms: "),
        "g.yaml:14:18: wires.total.terms: expected a list of producer.output, got nothing (null)",
    ],
    "two terms": [
        ("[lqr.command, match.feedforward]", "[lqr.comand, 3]"),
        "g.yaml:14:19: wires.total.terms[0]: 'lqr' has no output 'comand', did you mean 'command'?",
        "g.yaml:14:31: wires.total.terms[1]: expected one producer.output, got 3; a number comes "
        "from a block {type: Constant, value: ...}",
    ],
    "input": [
        ("{pose: plant.pose, path", "{poze: plant.pose, path"),
        "g.yaml:11:11: wires.match.poze: 'match' has no input 'poze', did you mean 'pose'?",
    ],
    "consumer": [
        ("  total: {terms", "  totl: {terms"),
        "g.yaml:14:3: wires.totl: there is no block 'totl', did you mean 'total'?",
    ],
    "consumer with a dot": [
        ("  plant: {command: total.out}", "  plant.command: total.out"),
        "g.yaml:15:3: wires.plant.command: there is no block 'plant.command'; write plant: "
        "{command: ...}",
    ],
    "wires of a text": [
        ("  plant: {command: total.out}", "  plant: total.out"),
        "g.yaml:15:10: wires.plant: expected {input: producer.output}, got the string 'total.out'",
    ],
    "not connected": [
        ("{error: error.state, reference: match.reference}", "{reference: match.reference}"),
        "g.yaml:13:3: input 'lqr.error' (TrackingState) is not connected; outputs of that type: "
        "error.state",
    ],
    "nothing to connect": [
        ("  track: {type: LinePath}\n", ""),
        (", path: track.path", ""),
        "g.yaml:10:3: input 'match.path' (Path(n)) is not connected; no output is a Path; add a "
        "block that has one",
    ],
    "deleted block": [
        ("  lqr: {type: LQR, q: [1, 1, 1], r: [1, 1]}\n", ""),
        "g.yaml:12:3: wires.lqr: there is no block 'lqr'; delete these wires, or restore it and "
        "write 'without: [lqr]'",
        "g.yaml:13:19: wires.total.terms[0]: there is no block 'lqr'; if it was deleted, "
        "restore it and write 'without: [lqr]'",
    ],
    # -- types
    "type clash": [
        ("pose: plant.pose, path", "pose: plant.wheels, path"),
        "g.yaml:11:17: wires.match.pose: expected Pose, got WheelSpeeds from 'plant.wheels'; "
        "outputs of that type: plant.pose",
    ],
    "component": [
        ("pose: plant.pose, path", "pose: plant.pose.z, path"),
        "g.yaml:11:17: wires.match.pose: Pose 'plant.pose' has no component 'z'; its components: "
        "x, y, theta",
    ],
    "mixed terms": [
        ("[lqr.command, match.feedforward]", "[plant.pose, lqr.command]"),
        "g.yaml:14:19: wires.total.terms[0]: expected Twist (as 'lqr.command' is), got Pose from "
        "'plant.pose'",
    ],
    "open type": [
        ("  plant: {type", "  lone: {type: Sum}\n  plant: {type"),
        "g.yaml:9:3: the signal type of 'lone.terms' is open; wire a typed signal to it, or write "
        "its type, as in 'signal: Scalar'",
    ],
    "loop": [
        ("[lqr.command, match", "[total.out, match"),
        "g.yaml:14:19: algebraic loop: total.out ▸ total.terms[0]; a UnitDelay on one of these "
        "wires breaks it, and run: {loops: solve} solves it at each tick",
    ],
    # -- removing
    "without nothing": [
        "without: [totl]\n",
        "g.yaml:18:11: without[0]: there is no block 'totl', did you mean 'total'?",
    ],
    "without leaves an input open": [
        "without: [total]\n",
        "g.yaml:15:20: wires.plant.command: input 'plant.command' (Twist) is not connected without "
        "'total'; outputs of that type: match.feedforward, lqr.command",
    ],
    "without everything": [
        "without: [track, match, error, lqr, total, plant]\n",
        "g.yaml:18:10: without: nothing is left of the graph; keep a block",
    ],
    "bypass without a pair": [
        "bypass: lqr\n",
        "g.yaml:18:9: bypass: 'lqr' (LQR) has no pass-through; 'without: [lqr]' removes it",
    ],
    "without of a number": [
        "without: [3]\n",
        "g.yaml:18:11: without[0]: expected a block's name, got 3",
    ],
    # -- probes, plots, metrics
    "probe": [
        ("pose: plant.pose\n", "pose: plant.pos\n"),
        "g.yaml:17:9: probes.pose: 'plant' has no output or state 'pos', did you mean 'pose'?",
    ],
    "probe of nothing": [
        "  way: []\n",
        "g.yaml:18:8: probes.way: expected an address, as in {of: plant.pose}",
    ],
    "probe with a dot": [
        "  plant.pose: lqr.command\n",
        "g.yaml:18:3: probes.plant.pose: 'plant.pose' is not a valid name; use up to 100 "
        "letters, digits, _ and -",
    ],
    "probe every": [
        "  way: {of: plant.pose, every: 0.1}\n",
        "g.yaml:18:32: probes.way.every: expected a number of base ticks, 1 or more, got 0.1",
    ],
    "table beside others": [
        "  way: [track.path, plant.pose]\n",
        "g.yaml:18:8: probes.way: a table needs a probe of its own",
    ],
    "plot's kind": [
        "plots: {p: {kind: timeserie, of: pose}}\n",
        "g.yaml:18:19: plots.p.kind: there is no kind 'timeserie', did you mean 'timeseries'?",
    ],
    "plot's key": [
        "plots: {p: {kid: timeseries, of: pose}}\n",
        "g.yaml:18:13: plots.p.kid: unknown key, did you mean 'kind'?",
    ],
    "plot of no probe": [
        "plots: {p: {kind: timeseries, of: [pose, poze]}}\n",
        "g.yaml:18:42: plots.p.of[1]: there is no probe 'poze', did you mean 'pose'?",
    ],
    "plot of a component": [
        "plots: {p: {kind: timeseries, of: pose.x}}\n",
        "g.yaml:18:35: plots.p.of: 'pose' is a probe; '.x' needs the address that it records",
    ],
    "plot that does not fit": [
        "plots: {p: {kind: trajectory, of: plant.wheels}}\n",
        "g.yaml:18:35: plots.p.of: a trajectory needs a Pose, a Path or a PointCloud; "
        "'plant.wheels' is a WheelSpeeds",
    ],
    "metric's kind": [
        "metrics: {m: {of: pose}}\n",
        f"g.yaml:18:11: metrics.m.kind: missing; expected one of {', '.join(METRIC_KINDS)}",
    ],
    "metric of several columns": [
        "metrics: {m: {kind: final, of: pose}}\n",
        "g.yaml:18:32: metrics.m.of: expected one column, got 3; name one, as in plant.pose.theta",
    ],
    "metric of several signals": [
        "metrics: {m: {kind: final, of: [plant.pose.x, plant.pose.y]}}\n",
        "g.yaml:18:32: metrics.m.of: expected one signal, got ['plant.pose.x', 'plant.pose.y']; a "
        "probe may hold several",
    ],
    "metric's option": [
        "metrics: {m: {kind: settling_time, of: pose}}\n",
        "g.yaml:18:11: metrics.m.band: missing; expected a number or an array of 3 numbers at "
        "least 0: largest size that is settled, or per column",
    ],
    "metric's option misspelt": [
        "metrics: {m: {kind: settling_time, of: pose, bnd: 1}}\n",
        "g.yaml:18:46: metrics.m.bnd: unknown key, did you mean 'band'?",
    ],
}


@pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())
def test_an_error_is_reported_with_its_location(
    case: list[tuple[str, str] | str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    messages = [edit for edit in case if isinstance(edit, str) and edit.startswith("g.yaml")]
    text = changed(SOUND, *(edit for edit in case if edit not in messages))
    assert problems(tmp_path, {"g.yaml": text}) == messages


PARTS = {
    "param unknown": [
        with_part(("{graph: p.yaml}", "{graph: p.yaml, params: {kk: 3}}")),
        PART,
        "g.yaml:9:31: blocks.p.params.kk: the part has no param 'kk', did you mean 'k'?",
    ],
    "param of the wrong kind": [
        with_part(("{graph: p.yaml}", "{graph: p.yaml, params: {k: x}}")),
        PART,
        "g.yaml:9:34: blocks.p.blocks.g.gain: expected a number or an array of n or m x n numbers, "
        "got the string 'x'",
    ],
    "param beside params": [
        with_part(("{graph: p.yaml}", "{graph: p.yaml, k: 3}")),
        PART,
        "g.yaml:9:22: blocks.p.k: a part has no 'k'; write it as params: {k: ...}",
    ],
    "param that must be given": [
        with_part(),
        changed(PART, ("k: 2.0", "k: ")),
        "p.yaml:2:10: blocks.p.blocks.g.gain: param 'k' has no value",
    ],
    "part and type": [
        with_part(("{graph: p.yaml}", "{graph: p.yaml, type: Sum}")),
        PART,
        "g.yaml:9:22: blocks.p.type: a part has no 'type'; it has params, inputs, outputs, blocks, "
        "wires",
    ],
    "part of a list": [
        with_part(("{graph: p.yaml}", "{graph: [p.yaml]}")),
        PART,
        "g.yaml:9:14: blocks.p.graph: expected the file of a part, got ['p.yaml']",
    ],
    "section": [
        with_part(),
        PART + "probes: {a: s.out}\n",
        "p.yaml:7:1: blocks.p.probes: a part has no 'probes'; it has params, inputs, outputs, "
        "blocks, wires",
    ],
    "no blocks": [
        with_part((": {a: total.out}", ": {}"), ("p.out", "total.out")),
        "graph: p\n",
        "g.yaml:9:6: blocks.p.blocks: there are no blocks; expected entries such as "
        "'total: {type: Sum}'",
    ],
    "input unknown": [
        with_part(("{a: total.out}", "{aa: total.out}")),
        PART,
        "g.yaml:12:7: wires.p.aa: part 'p' has no input 'aa', did you mean 'a'?",
    ],
    "input open": [
        with_part(("{a: total.out}", "{}")),
        PART,
        "g.yaml:12:3: input 'p.a' (Twist) is not connected; outputs of that type: "
        "match.feedforward, lqr.command, total.out",
    ],
    "input without wires": [
        with_part(("  p: {a: total.out}\n", "")),
        PART,
        "g.yaml:9:3: input 'p.a' (Twist) is not connected; outputs of that type: "
        "match.feedforward, lqr.command, total.out",
    ],
    "wire from nothing": [
        with_part(("{a: total.out}", "{a: totl.out}")),
        PART,
        "g.yaml:12:10: wires.p.a: there is no block 'totl', did you mean 'total'?",
    ],
    "wire of the wrong type": [
        with_part(("{a: total.out}", "{a: plant.pose}")),
        PART,
        "g.yaml:12:10: wires.p.a: expected Twist, got Pose from 'plant.pose'; outputs of that "
        "type: match.feedforward, lqr.command, total.out",
    ],
    "wire of the wrong type into any": [
        with_part(("{a: total.out}", "{a: plant.pose}")),
        changed(PART, ("a: Twist", "a: "), ("b: {type: Twist, ", "b: {")),
        "g.yaml:12:10: wires.p.a: expected Twist (as 'plant.command' is), got Pose from "
        "'plant.pose'",
    ],
    "component through an input": [
        with_part(("{a: total.out}", "{a: total.out.vv}")),
        PART,
        "g.yaml:12:10: wires.p.a: Twist 'total.out' has no component 'vv'; its components: v, "
        "omega",
    ],
    "inner input unknown": [
        with_part(),
        changed(PART, ("inputs.a", "inputs.aa")),
        "p.yaml:6:51: blocks.p.wires.g.input: 'inputs.aa' is not an input of this part, did you "
        "mean 'a'?",
    ],
    "outside seen from inside": [
        with_part(),
        changed(PART, ("inputs.a", "lqr.command")),
        "p.yaml:6:51: blocks.p.wires.g.input: there is no block 'lqr' in part 'p'; inputs of the "
        "part: inputs.a, inputs.b",
    ],
    "inputs no mapping": [
        with_part(),
        changed(PART, ("{a: Twist, b: {type: Twist, optional: true}}", "[a, b]")),
        "p.yaml:3:9: blocks.p.inputs: expected entries such as 'push: {type: Scalar, "
        "default: 0.0}', got ['a', 'b']",
    ],
    "input's type": [
        with_part(),
        changed(PART, ("a: Twist", "a: Twst"), ("optional: true", "optional: yes")),
        "p.yaml:3:13: blocks.p.inputs.a: no signal type 'Twst'; the types are Scalar, Pose, Twist, "
        "WheelSpeeds, TrackingState, Vector, Spikes, Scan, PointCloud, Path, did you mean 'Twist'?",
        "p.yaml:3:46: blocks.p.inputs.b.optional: expected true or false, got the string 'yes'",
    ],
    "output unknown": [
        with_part(("p.out", "p.ou")),
        PART,
        "g.yaml:17:20: wires.plant.command: part 'p' has no output 'ou', did you mean 'out'?",
    ],
    "part for an output": [
        with_part(("p.out", "p")),
        PART,
        "g.yaml:17:20: wires.plant.command: 'p' is a part; expected one of its outputs: p.out",
    ],
    "part without outputs": [
        with_part(("p.out", "p")),
        changed(PART, ("outputs: {out: s.out}\n", "")),
        "g.yaml:17:20: wires.plant.command: 'p' is a part; expected one of its outputs: none",
    ],
    "inner input far off": [
        with_part(),
        changed(PART, ("inputs.a", "inputs.speed")),
        "p.yaml:6:51: blocks.p.wires.g.input: 'inputs.speed' is not an input of this part; its "
        "inputs: a, b",
    ],
    "output names nothing": [
        with_part(),
        changed(PART, ("out: s.out", "out: s.ot, more: t.out")),
        "p.yaml:4:16: blocks.p.outputs.out: 'p.s' has no output 'ot', did you mean 'out'?",
        "p.yaml:4:28: blocks.p.outputs.more: there is no block 't' in part 'p'; inputs of the "
        "part: inputs.a, inputs.b",
    ],
    "outputs no mapping": [
        with_part(),
        changed(PART, ("{out: s.out}", "[s.out]")),
        "p.yaml:4:10: blocks.p.outputs: expected entries such as 'command: join.out', got "
        "['s.out']",
    ],
    "optional input that must be wired": [
        with_part(("{a: total.out}", "{}")),
        changed(PART, ("a: Twist", "a: {type: Twist, optional: true}")),
        "p.yaml:6:40: input 'p.g.input' (Twist) is not connected, since nothing is wired to "
        "'p.a'; outputs of that type: inputs.a, inputs.b, s.out",
    ],
    "without a part": [
        with_part("without: [p]\n"),
        PART,
        "g.yaml:17:20: wires.plant.command: input 'plant.command' (Twist) is not connected without "
        "'p'; outputs of that type: match.feedforward, lqr.command, total.out",
    ],
    "without an inner block": [
        with_part("without: [p.s]\n"),
        PART,
        "g.yaml:17:20: wires.plant.command: input 'plant.command' (Twist) is not connected without "
        "'p.s'; outputs of that type: match.feedforward, lqr.command, total.out",
    ],
    "bypass a part": [
        with_part("bypass: [p]\n"),
        PART,
        "g.yaml:20:10: bypass[0]: 'p' is a part; only a block with a pass-through can be bypassed",
    ],
}


@pytest.mark.parametrize("case", PARTS.values(), ids=PARTS.keys())
def test_an_error_in_a_part_is_reported_with_its_location(case: list[str], tmp_path: Path) -> None:
    graph, part, *messages = case
    assert problems(tmp_path, {"g.yaml": graph, "p.yaml": part}) == messages


def test_a_run_may_be_one_tick(tmp_path: Path) -> None:
    text = changed(SOUND, ("until: 0.1", "until: 0.01"))
    assert problems(tmp_path, {"g.yaml": text}) == []


def test_sound_graphs_have_no_problems(tmp_path: Path) -> None:
    assert problems(tmp_path, {"g.yaml": SOUND}) == []
    assert problems(tmp_path, {"g.yaml": with_part(), "p.yaml": PART}) == []


def test_all_at_once_in_the_order_of_the_text(tmp_path: Path) -> None:
    text = changed(
        SOUND,
        ("q: [1", "Q: [1"),
        ("{type: LinePath}", "{type: LinePath, y: high}"),
        ("error.state", "error.stat"),
        ("pose: plant.pose\n", "pose: plant.poze\n"),
        "metrics: {m: {kind: rsm, of: pose}}\n",
    )
    found = problems(tmp_path, {"g.yaml": text})
    assert [line.split(": ")[:2] for line in found] == [
        ["g.yaml:4:30", "blocks.track.y"],
        ["g.yaml:7:20", "blocks.lqr.Q"],
        ["g.yaml:13:16", "wires.lqr.error"],
        ["g.yaml:17:9", "probes.pose"],
        ["g.yaml:18:21", "metrics.m.kind"],
    ]


def test_every_loop_is_reported(tmp_path: Path) -> None:
    text = changed(
        SOUND,
        (
            "  plant: {type",
            "  c: {type: Constant, value: 1}\n  a: {type: Sum}\n  b: {type: Sum}\n"
            "  e: {type: Sum}\n  plant: {type",
        ),
        (
            "wires:\n",
            "wires:\n  a: {terms: [b.out, c.value]}\n  b: {terms: [a.out]}\n"
            "  e: {terms: [c.value, e.out]}\n",
        ),
    )
    first, second = problems(tmp_path, {"g.yaml": text})
    # A loop has no first wire: it may be reported from either of its blocks.
    assert first.split(": ")[2].split("; ")[0] in (
        "a.out ▸ b.terms[0] ▸ b.out ▸ a.terms[0]",
        "b.out ▸ a.terms[0] ▸ a.out ▸ b.terms[0]",
    )
    suggestion = "; a UnitDelay on one of these wires breaks it, and run: {loops: solve} solves it"
    suggestion += " at each tick"
    assert second == f"g.yaml:17:24: algebraic loop: e.out ▸ e.terms[1]{suggestion}"


OWN = """\
from blocks import Block, Input, Output, Scalar, param


class Mine(Block):
    out = Output(Scalar, doc="k")
    k: float = param(1.0, doc="what comes out")

    def output(self, state, t):
        return self.k
"""
MODULES = {
    "syntax": ["def (\n", "blocks.own.module: m.py:1: invalid syntax"],
    "raises": [
        "raise ValueError('a\\nb')\n",
        "blocks.own.module: m.py failed: ValueError: a\\nb (m.py:1)",
    ],
    "leaves": ["raise SystemExit(3)\n", "blocks.own.module: m.py failed: SystemExit: 3 (m.py:1)"],
    "other name": [
        OWN.replace("class Mine", "class Other"),
        "blocks.own.type: no block type 'Mine'; 'm.py' defines Other",
    ],
    "validate": [
        OWN + "    def validate(self):\n        raise RuntimeError('no')\n",
        "blocks.own: Mine failed: RuntimeError: no (m.py:11)",
    ],
    "validate_in": [
        OWN + "    def validate_in(self, context):\n        raise KeyError('no')\n",
        "blocks.own: Mine failed: KeyError: 'no' (m.py:11)",
    ],
}


@pytest.mark.parametrize("case", MODULES.values(), ids=MODULES.keys())
def test_a_failing_block_of_the_user_is_reported(
    case: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    code, message = case
    text = changed(SOUND, ("  plant: {type", "  own: {type: Mine, module: m.py}\n  plant: {type"))
    found = problems(tmp_path, {"g.yaml": text, "m.py": code})
    assert [line.split(": ", 1)[1] for line in found] == [message]
    assert found[0].startswith("g.yaml:9:")


def test_a_block_of_ones_own_is_found(tmp_path: Path) -> None:
    text = changed(SOUND, ("  plant: {type", "  own: {type: Mine, module: m.py}\n  plant: {type"))
    assert problems(tmp_path, {"g.yaml": text, "m.py": OWN}) == []


def test_problems_of_a_dict_carry_addresses() -> None:
    plain = runtime.load("line_actuator_failure").to_dict()
    plain["blocks"]["lqr"]["Q"] = 1
    plain["wires"]["error"]["pose"] = "plant.pos"
    with pytest.raises(GraphError) as caught:
        runtime.load(plain).check()
    assert [(p.where, p.address) for p in caught.value.problems] == [
        (NOWHERE, "blocks.lqr.Q"),
        (NOWHERE, "wires.error.pose"),
    ]


def test_a_problem_is_one_line() -> None:
    problem = Problem(Where("a\nb", 3, 4), "x.y", "got '\x1b[31m\u2028'")
    assert str(problem) == "a\\nb:3:4: x.y: got '\\x1b[31m\\u2028'"
    assert str(Problem(NOWHERE, "", "it")) == "it"


def test_a_silenced_location_has_no_further_problems() -> None:
    found = Problems()
    found.add(Where("f", 1, 2), "a.b[1]", "unknown")
    found.silence(Where("f", 1, 2), "a.b[1]")
    found.add(Where("f", 1, 2), "elsewhere", "follows from it")
    found.add(Where("f", 1, 1), "a.b", "follows from it")
    found.add(Where("f", 1, 1), "a.c", "stands by itself")
    assert [problem.text for problem in found.items] == ["unknown", "stands by itself"]


TITLES = ['"""', 'a"""; raise SystemExit; """', "\\", 'a\\"""', "{0} %s", "é😀", "'"]


@pytest.mark.parametrize("title", TITLES)
def test_any_title_runs(title: str) -> None:
    graph = runtime.Graph(title, dt=0.01, until=0.02)
    graph = graph.add("one", Constant(value=1.0)).probe("one.value")
    assert graph.run().title == title


@pytest.mark.parametrize("title", ["a\nb", "\0", "x" * 121])
def test_a_title_is_one_line(title: str) -> None:
    with pytest.raises(GraphError, match="graph: expected a title, one line"):
        _ = runtime.Graph(title).network


@pytest.mark.parametrize(
    "error",
    [
        GraphError([Problem(Where("g.yaml", 3, 4), "blocks.x", "is wrong")]),
        SimulationError("plant", 7, 0.007, "output 'pose' is not finite"),
        MissingExtraError("rendering", "render"),
        UsageError("no such seed"),
    ],
)
def test_errors_travel_between_processes(error: SpikeblocksError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert str(back) == str(error)
    assert back.__dict__ == error.__dict__
