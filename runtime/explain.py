"""A graph explained: in which order its blocks run, how often, what flows, and the function."""

from __future__ import annotations

from typing import Any

from runtime.engine import Engine
from runtime.graph import Graph
from runtime.observe import observe


def explain_json(graph: Graph) -> dict[str, Any]:
    """Order, rates, types and source as plain data."""
    network = graph.network
    engine = Engine(network, observe(network))
    return {
        "schema_version": 1,
        "graph": network.title,
        "dt": network.dt,
        "ticks": network.ticks,
        "order": [
            {
                "block": step.block,
                "type": network.entries[step.block].cls.__name__,
                "every": step.every,
                "dt": step.every * network.dt,
                "once": step.constant,
                "reads": [str(port) for port in step.evaluation.needs],
                "writes": {
                    port: str(network.types[step.block, port]) for port in step.evaluation.outputs
                },
            }
            for step in engine.plan.steps
        ],
        "wires": [
            {"from": str(w.source), "to": w.target, "type": str(network.types[w.block, w.port])}
            for w in network.wires
        ],
        "removed": dict(network.removed),
        "source": engine.source(),
    }


def explain_text(graph: Graph) -> str:
    """The same for a terminal."""
    facts = explain_json(graph)
    lines = [
        f"{facts['graph']}: {len(graph.network.entries)} blocks, "
        f"base step {facts['dt']:g} s, {facts['ticks']} ticks",
        "",
        "Order of evaluation",
    ]
    width = max((len(step["block"]) for step in facts["order"]), default=0)
    for i, step in enumerate(facts["order"], 1):
        rate = "once" if step["once"] else f"{1.0 / step['dt']:g} Hz"
        writes = ", ".join(f"{port}: {kind}" for port, kind in step["writes"].items())
        reads = f" from {', '.join(step['reads'])}" if step["reads"] else ""
        lines.append(f"  {i:>3}  {step['block']:<{width}}  {rate:>8}  {writes}{reads}")
    for name, how in facts["removed"].items():
        lines.append(f"       {name:<{width}}  {'removed' if how == 'without' else 'bypassed':>8}")
    lines += [
        "",
        "The function that runs",
        "",
        facts["source"],
    ]
    return "\n".join(lines).rstrip()
