"""``python -m tests.gallery.coming_from``: writes the table of docs/coming-from.md.

Each of Nengo's examples, as :mod:`tests.gallery.nengo_models` has them, is imported and run beside
Nengo; so are the networks of which the CPU time is measured.
"""

from __future__ import annotations

import inspect
import re
import tempfile
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any

import nengo
import numpy as np

import runtime
from runtime.errors import SpikeblocksError
from spikeblocks.nengo.importing import Imported, import_network, run_both
from tests.gallery import nengo_models
from tests.gallery.nengo_models import MODELS

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "coming-from.md"
BEGIN, END = "<!-- begin: models of Nengo -->\n", "<!-- end: models of Nengo -->\n"
SECONDS, SPEED_SECONDS = 0.3, 1.0
# Of these the CPU time is measured: compiled, of the run alone, and of Nengo's run alone.
TIMED = ("communication_channel", "learn_communication_channel", "lorenz_attractor")


def basal_ganglia_10() -> nengo.Probe:
    network = nengo.networks.BasalGanglia(10)
    nengo.Connection(nengo.Node(np.linspace(0.2, 0.8, 10)), network.input, synapse=None)
    return nengo.Probe(network.output, synapse=0.01)


def convolution_16() -> nengo.Probe:
    network = nengo.networks.CircularConvolution(50, 16)
    for side in (network.input_a, network.input_b):
        nengo.Connection(nengo.Node(np.eye(16)[3]), side, synapse=None)
    return nengo.Probe(network.output, synapse=0.01)


FURTHER: dict[str, Callable[[], Any]] = {
    "basal_ganglia_10": basal_ganglia_10,
    "convolution_16": convolution_16,
}


def row(name: str, model: Callable[[], Any], folder: Path) -> str:
    """A line of the table."""
    with nengo.Network(seed=0) as network:
        model()
    theirs, own = f"{characters(model, set())}", f"{by_hand(name) or ''}"
    try:
        done = import_network(network, folder / f"{name}.yaml", until=SECONDS)
        redrawn = import_network(network, folder / f"{name}_redrawn.yaml", redraw=True)
        ours = len(redrawn.files[0].read_text(encoding="utf-8"))
        equal = compared(done)
    except SpikeblocksError as error:
        # Without the object's address and the folder, which differ from run to run.
        reason = str(error).splitlines()[0].rpartition("Error: ")[2].rpartition(">: ")[2]
        reason = reason.partition(" (/")[0]
        return f"| {name} | not whole: {reason} | {theirs} | | {own} | |"
    timed = name in TIMED or name in FURTHER
    speed = f"{ratio(done):.1f}" if timed else ""
    return f"| {name} | {equal} | {theirs} | {ours} | {own} | {speed} |"


def characters(function: Callable[..., Any], counted: set[str]) -> int:
    """The length of a model's source, with the functions of its module that it calls."""
    counted.add(function.__name__)
    # From its first line on: the decorator that lists it as a model is no part of it.
    text = textwrap.dedent(inspect.getsource(function))
    text = text[text.index("def ") :]
    names = set(re.findall(r"\w+", text)) - counted
    called = [getattr(nengo_models, name, None) for name in sorted(names)]
    own = [each for each in called if getattr(each, "__module__", "") == nengo_models.__name__]
    return len(text) + sum(
        characters(each, counted)
        for each in own
        if inspect.isfunction(each) and each.__name__ not in counted
    )


def by_hand(name: str) -> int:
    """The length of the gallery's graph of a model; 0 if there is none.

    Without comments, and without what the models of Nengo have not: plots, metrics and labels.
    """
    path = ROOT / "graphs" / "gallery" / "nengo" / f"{name}.yaml"
    text = path.read_text(encoding="utf-8") if path.exists() else ""
    text = re.sub(r"^(plots|metrics):\n(  .*\n)*", "", text, flags=re.MULTILINE)
    text = re.sub(r", label: (\[[^]]*\]|\"[^\"]*\"|[^,}]*)", "", text)
    return sum(len(line) for line in text.splitlines(True) if not line.lstrip().startswith("#"))


def compared(done: Imported) -> str:
    """Whether all spikes are equal, and how large the largest difference of a probe is."""
    ours, theirs = run_both(done, SECONDS)
    spikes = [name for name in theirs if name.startswith("spikes of ")]
    total = sum(int(np.count_nonzero(theirs[name])) for name in spikes)
    differ = sum(int(np.count_nonzero((ours[n] != 0.0) != (theirs[n] != 0.0))) for n in spikes)
    probed = [np.abs(ours[n] - theirs[n]).max(initial=0.0) for n in theirs if n not in spikes]
    told = f"{total} spikes equal" if not differ else f"{differ} of {total} spikes differ"
    return f"{told}; probes to {max(probed, default=0.0):.0e}"


def ratio(done: Imported) -> float:
    """Nengo's CPU time of a run over ours, compiled, both without what comes before the run."""
    graph = runtime.load(done.files[0]).set("run.until", SPEED_SECONDS)
    graph.run(engine="compiled")  # compiles
    mine = min(_cpu(lambda: graph.run(engine="compiled")) for _ in range(2))
    with nengo.Simulator(done.network, progress_bar=False) as simulator:
        return _cpu(lambda: simulator.run(SPEED_SECONDS, progress_bar=False)) / mine


def _cpu(run: Callable[[], Any]) -> float:
    begin = time.process_time()
    run()
    return time.process_time() - begin


def table() -> str:
    """The table, of all models."""
    lines = [
        "| model | imported | characters in Python | YAML, imported | by hand | times faster |",
        "|---|---|---|---|---|---|",
    ]
    with tempfile.TemporaryDirectory() as folder:
        for name, model in {**MODELS, **FURTHER}.items():
            lines.append(row(name, model, Path(folder)))
            print(lines[-1], flush=True)
    return "\n".join([*lines, "", lengths()]) + "\n"


def lengths() -> str:
    """How long the graphs by hand are, as shares of the models in Python."""
    shares = {name: by_hand(name) / characters(model, set()) for name, model in MODELS.items()}
    written = {name: share for name, share in shares.items() if share}
    longest = max(written, key=written.__getitem__)
    return (
        f"By hand, {len(written)} graphs are {median(written.values()):.2f} times as long as the "
        f"models in Python in the median, and at most {written[longest]:.2f} times ({longest})."
    )


def main() -> None:
    """Write the table into the page."""
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    _, _, after = rest.partition(END)
    PAGE.write_text(f"{before}{BEGIN}{table()}{END}{after}", encoding="utf-8")


if __name__ == "__main__":
    main()
