"""Explains a graph: order of evaluation, rates, types, wires, and the generated function."""

from __future__ import annotations

import math
from typing import Any

from blocks.core import Block
from runtime.document import rate_text
from runtime.engine import Engine, python_seconds
from runtime.graph import Graph
from runtime.plan import Call, Plan, Stop
from runtime.runs import chosen_runner


def explain_json(graph: Graph) -> dict[str, Any]:
    """Order, rates, types and source as plain data."""
    network = graph.network
    runner = chosen_runner(network)
    engine = Engine(graph.program(), network.seed, runner)
    return {
        "schema_version": 1,
        "graph": network.title,
        "dt": network.dt,
        "ticks": network.ticks,
        "order": [
            {
                "block": call.block,
                "type": network.entries[call.block].cls.__name__,
                "every": call.gate.every,
                "dt": call.gate.every * network.dt,
                "offset": call.gate.offset * network.dt,
                "once": call.gate.once,
                "enabled_by": list(map(str, call.gate.switches)),
                "reads": [argument.port for argument in call.arguments],
                "writes": {signal.port: str(signal.kind) for signal in call.outputs},
            }
            for call in engine.plan.evaluations
        ],
        "wires": [
            {"from": str(w.source), "to": w.target, "type": str(network.types[w.block, w.port])}
            for w in network.wires
        ],
        "loops": [
            {"unknowns": list(map(str, loop.unknowns)), "through": loop.path}
            for loop in engine.plan.loops
        ],
        "continuous": _continuous(engine.plan),
        "populations": _populations(engine),
        "removed": dict(network.removed),
        "engine": {"asked": network.engine, "python_s": python_seconds(network)}
        | (
            _compiled(engine)
            if runner is not None
            else {"taken": "python", "source": engine.program.source()}
        ),
    }


def _continuous(plan: Plan) -> dict[str, Any] | None:
    """The states that a solver integrates, and the blocks that each of its stages calls again."""
    part = plan.integration
    if part is None:
        return None
    calls = [each for each in part.stage if isinstance(each, Call)]
    return {
        "solver": part.solver,
        "states": {str(slot): list(slot.shape) for slot in part.row.slots},
        "stages": [call.block for call in calls if call.outputs],
        "derivatives": [call.block for call in calls if call.rates],
        "events": [
            f"{each.block} (stop)" if isinstance(each.guards, Stop) else each.block
            for each in part.crossings
        ],
        "edges": sum(map(math.isfinite, part.edges.tolist())),
    }


def _populations(engine: Engine) -> dict[str, dict[str, float]]:
    """Numbers of neurons and synapses, operations per second, and the errors of solved weights.

    An operation is the work of one synapse in one tick.
    """
    entries = engine.network.entries
    if not any(type(entry.block).facts is not Block.facts for entry in entries.values()):
        return {}
    engine = Engine(engine.program, engine.seed)  # started apart, in Python
    engine.prepare()
    found = {
        name: dict(entry.block.facts(engine.state.blocks[name])) for name, entry in entries.items()
    }
    for name, facts in found.items():
        if "synapses" in facts:
            rate = 1.0 / (engine.network.dt * entries[name].every)
            facts["operations_per_second"] = facts["synapses"] * rate
    return {name: facts for name, facts in found.items() if facts}


def _population_lines(populations: dict[str, dict[str, float]]) -> list[str]:
    width = max(len(name) for name in populations)
    names = ("neurons", "synapses", "operations_per_second")
    total = {key: sum(facts.get(key, 0.0) for facts in populations.values()) for key in names}
    lines = ["Populations"]
    for name, facts in {**populations, "in all": total}.items():
        shown = [f"{value:.6g} {key.replace('_', ' ')}" for key, value in facts.items()]
        lines.append(f"  {name:<{width}}  {', '.join(shown)}")
    return lines


def _compiled(engine: Engine) -> dict[str, Any]:
    """Which blocks are compiled, why the others are not, and the plan in C."""
    from runtime.engine.compiled import CompiledRunner

    engine.prepare()
    runner = None if engine.exact is None else engine.exact.compiled
    if not isinstance(runner, CompiledRunner):
        raise TypeError("not the compiled engine")
    return {
        "taken": "compiled",
        "compiled": sorted(runner.kernels.compiled),
        "from_python": dict(runner.kernels.refused),
        "parts": runner.text.parts,
        "source": runner.text.text + ("\n\n" + runner.text.driver if runner.text.driver else ""),
    }


def explain_text(graph: Graph, code: bool = False) -> str:
    """The explanation for a terminal; ``code`` adds the generated function."""
    facts, unit = explain_json(graph), graph.network.time_unit
    lines = [
        f"{facts['graph']}: {len(graph.network.entries)} blocks, "
        f"base step {facts['dt']:g} {unit}, {facts['ticks']} ticks",
        "",
        "Order of evaluation",
    ]
    width = max((len(step["block"]) for step in facts["order"]), default=0)
    for i, step in enumerate(facts["order"], 1):
        rate = "once" if step["once"] else rate_text(step["dt"], unit)
        writes = ", ".join(f"{port}: {kind}" for port, kind in step["writes"].items())
        reads = f" from {', '.join(step['reads'])}" if step["reads"] else ""
        enables = f", while {' and '.join(step['enabled_by'])}" if step["enabled_by"] else ""
        first = f", from {step['offset']:g} {unit}" if step["offset"] else ""
        end = f"{writes}{reads}{enables}{first}"
        lines.append(f"  {i:>3}  {step['block']:<{width}}  {rate:>8}  {end}")
    for name, how in facts["removed"].items():
        lines.append(f"       {name:<{width}}  {'removed' if how == 'without' else 'bypassed':>8}")
    for loop in facts["loops"]:
        lines += ["", f"Solved for {', '.join(loop['unknowns'])}: {loop['through']}"]
    if facts["populations"]:
        lines += ["", *_population_lines(facts["populations"])]
    if facts["continuous"] is not None:
        lines += ["", *_continuous_lines(facts["continuous"])]
    lines += ["", *_engine_lines(facts["engine"])]
    if code:
        lines += ["", "The function that runs", "", facts["engine"]["source"]]
    return "\n".join(lines).rstrip()


def _continuous_lines(facts: dict[str, Any]) -> list[str]:
    """What is integrated between two ticks."""
    states = [
        name + (f" {tuple(shape)}" if shape else "") for name, shape in facts["states"].items()
    ]
    again = ", ".join(dict.fromkeys(facts["stages"])) or "none"
    return [
        f"Integrated between ticks by {facts['solver']}",
        f"  states       {', '.join(states)}",
        f"  each stage   outputs of {again}; derivatives of {', '.join(facts['derivatives'])}",
        *([f"  events of    {', '.join(facts['events'])}"] if facts["events"] else []),
        *([f"  edges        {facts['edges']}, not at ticks"] if facts["edges"] else []),
    ]


def _engine_lines(engine: dict[str, Any]) -> list[str]:
    """Which engine runs the graph, and which blocks it compiles."""
    asked = f" ({engine['asked']})" if engine["asked"] == "auto" else ""
    if engine["taken"] == "python":
        cost = f"about {engine['python_s']:.2g} s a run"
        return [f"Python engine{asked}, {cost}"]
    lines = [f"Compiled engine{asked}", f"  compiled     {', '.join(engine['compiled'])}"]
    for name, reason in engine["from_python"].items():
        lines.append(f"  from Python  {name}: {reason}")
    if engine["parts"] > 1:
        lines.append(f"  These split a tick into {engine['parts']} parts.")
    return lines
