"""Random command lines end with an allowed exit code and a sentence, whatever is written.

Verbs and options are those of the real parser. Most lines run in this process, which is fast;
some, and all that start workers, run as the console script.
"""

from __future__ import annotations

from argparse import Action, ArgumentParser
from dataclasses import dataclass
from functools import cache
from typing import Any

from hypothesis import strategies as st

from runtime.cli import make_parser
from tests.fuzz.campaign import Record, campaign
from tests.fuzz.known import KNOWN
from tests.fuzz.workspace import assert_answered, call, fresh, made, spawn

TITLE = "Command lines"
WHAT = (
    "Random verbs, options and values are run in a folder with graphs, runs, a sweep and an "
    "ablation: most in one process, some as the console script."
)
HOLDS = (
    "Each ends with exit code 0, 1, 2, 3, 4 or 130; where it is neither 0 nor 1, with a sentence; "
    "never with a traceback; and what --json prints is JSON in the strict sense."
)
SEPARATE = ("sweep", "ablate", "tune")
REAL = 25  # of so many lines that could run in this process, one runs as a process
FOLDERS = ("runs/tiny/a", "runs/tiny/latest", "runs/tiny", "sweeps/tiny", "ablations/tiny", ".")
GRAPHS = ("tiny.yaml", "tiny.yaml", "tiny.yaml", "exp.yaml", "scanning.yaml", "broken.yaml")
UNKIND = ("", " ", "-", ",", "=", "nope", "bytes.yaml", "own.py", "/dev/null", "tiny.yaml/x", "ü")
BAD = ("x" * 300, "\udcff.yaml", "\x1b[31m")
PLAUSIBLE: dict[str, tuple[str, ...]] = {
    "graph": GRAPHS,
    "graphs": GRAPHS,
    "folder": ("runs", "runs/tiny", ".", "nope"),
    "run": FOLDERS,
    "runs": FOLDERS[:4],
    "path": FOLDERS,
    "file": ("fresh.yaml", "tiny.yaml", "fresh", "a/b.yaml"),
    "group": ("worlds", "graphs", "world"),
    "shell": ("bash", "zsh", "tcsh"),
    "--search": ("sum", "delay", "zzz"),
    "--vs": ("without=gain", "set=gain.gain=3", "bypass=limit", "with=over.yaml", "gain", "run=3"),
    "--figures": ("pdf", "png,svg", "jpeg", ","),
    "--style": ("paper", "paper2", "screen"),
    "--inputs": ("plant.command", "go.value", "nope.x", "plant.command,go.value"),
    "--outputs": ("plant.pose", "plant.pose.x", "plant.pose_state", "nope"),
    "--at": ("0", "0.1", "-1", "x"),
    "--state": ("plant.pose_state=0", "x=1", "x", "x=[1, 2]"),
    "type": ("Sum", "Gain", "AdaptiveEnsemble", "Half", "gain"),
    "--with": ("over.yaml", "tiny.yaml", "broken.yaml"),
    "--set": (
        *("gain.gain=3", "params.k=0", "params.k=-1e9", "run.seed=4", "run.dt=0.02", "run.dt=0"),
        *("limit.omega_max=[1", "limit.omega_max=x", "plant.x0=[1, 2]", "plant.x0=[1, 2, 3]"),
        *("world=nope.yaml", "world=broken.yaml", "blocks={}", "metrics.end.above=9", "a.b.c=1"),
    ),
    "--wire": ("plant.command=go.value", "gain.input=plant.pose", "noise.pose=noise.measured"),
    "--without": ("noise", "gain", "plant", "noise,limit", "nobody"),
    "--bypass": ("limit", "gain", "noise,limit", "go"),
    "--from": ("runs", "nowhere", "."),
    "--initial": ("snn.weights=runs", "snn=nowhere", "snn", "=x"),
    "--replace": ("limit=ActuatorFault", "gain=Lowpass", "gain=Gian", "noise=PoseNoise,gain=Sum"),
    "--variant": ("soft", "a/b", "baseline"),
    "--except": ("plant", "plant,noise", "nobody"),
    "--seed": ("3", "-1", "1e3", "99999999999999999999"),
    "--until": ("0.1", "0.05", "0", "-1", "nan", "inf", "0.015", "1e400"),
    "--engine": ("python", "auto", "compild"),
    "--out": ("out", "out/deep/er", "tiny.yaml", "/dev/null/x", "runs"),
    "-o": ("o.svg", "o.png", "o.dot", "o.html", "-", "/dev/null/x", "runs"),
    "--format": ("svg", "png", "dot", "mermaid"),
    "--module": ("own.py", "tiny.yaml", "nope.py"),
    "--vary": ("gain.gain=[1, 2]", "params.k=1..2:2", "gain.gain=log(0..1):2", "gain.gain=[x]"),
    "--trials": ("2", "0", "x"),
    "--constrain": ("end below 3", "end under 3", "nope above 1"),
    "--sampler": ("sobol", "random", "tpe", "best"),
    "--batch": ("2", "0"),
    "--over": ("mean", "worst", "best"),
    "--held-out": ("7..8", "0", "x"),
    "--random": ("2", "0", "-1"),
    "--sobol": ("2", "0"),
    "--sampling-seed": ("1", "-1"),
    "--minimize": ("end", "far", "nope"),
    "--maximize": ("end", "far", "nope"),
    "--keep": ("all", "failed", "best:1", "best:0", "none"),
    "--name": ("again", "../x", "a b", "tiny"),
    "--seeds": ("0..1", "3", "1,0", "1..0", "0,0", "-1..1"),
    "-j": ("1", "2", "0", "5000"),
    "--timeout": ("60", "0", "nan", "-1"),
    "--scheduler": ("nowhere", "tcp://"),
    "--test": ("auto", "t", "ranks"),
    "--rtol": ("0", "1e-3", "-1", "nan"),
    "--atol": ("0", "1e-3", "inf"),
    "--probes": ("pose", "pose,seen", "nope", ",,"),
    "--labels": ("a,b", "a,a", "a", ",", "a,b,c,d"),
    "--block": ("plant", "nope", "gain,limit"),
    "--view": ("top", "perspective"),
    **dict.fromkeys(("--at", "--from", "--speed", "--fps", "--height"), ("1", "64", "-1", "1e9")),
    "--film-height": ("64", "1"),
}


@dataclass(frozen=True)
class Line:
    """A command line; ``real`` ones run as a process."""

    arguments: tuple[str, ...]
    real: bool


@cache
def verbs() -> dict[str, ArgumentParser]:
    """The parser of each verb that ends by itself."""
    (commands,) = (a for a in make_parser()._actions if a.dest == "command")
    found: Any = commands.choices
    # A server ends when its editor or its user says so.
    return {name: parser for name, parser in found.items() if name not in ("lsp", "studio")}


def _values(action: Action, key: str) -> st.SearchStrategy[str]:
    likely = PLAUSIBLE.get(key) or PLAUSIBLE.get((*action.option_strings, key)[0]) or UNKIND
    unkind = st.sampled_from(UNKIND if "names" in KNOWN else UNKIND + BAD)
    anything = st.text(st.characters(exclude_categories=["Cs", "Cc"]), max_size=5)
    return st.one_of(*[st.sampled_from(likely)] * 6, unkind, anything)


@st.composite
def lines(draw: st.DrawFn) -> Line:
    """Mostly lines that a verb's parser takes, now and then words in any order."""
    verb = draw(st.sampled_from(list(verbs())))
    actions = verbs()[verb]._actions
    words: list[str] = []
    for action in actions:
        if not action.option_strings:
            most = 3 if action.nargs == "+" else 1
            number = draw(st.sampled_from([1, 1, 1, 1, most, most, 0]))
            words += [draw(_values(action, action.dest)) for _ in range(number)]
    options = [action for action in actions if action.option_strings]
    for action in draw(st.lists(st.sampled_from(options), max_size=4)):
        flag = draw(st.sampled_from(action.option_strings))
        takes = action.nargs != 0
        words += [flag, draw(_values(action, flag))] if takes else [flag]
    if draw(st.integers(0, 9)) == 0:
        words = draw(st.permutations(words))
    if "--no-plots" in verbs()[verb]._option_string_actions and draw(st.integers(0, 9)):
        words.append("--no-plots")
    if verb in SEPARATE and "-j" not in words:
        words += ["-j", "1"]
    real = verb in SEPARATE or draw(st.integers(1, REAL)) == REAL
    return Line((verb, *words), real)


@st.composite
def quick_lines(draw: st.DrawFn) -> Line:
    """Lines that need no process of their own."""
    line = draw(lines().filter(lambda line: line.arguments[0] not in (*SEPARATE, "render")))
    return Line(line.arguments, False)


def check(line: Line) -> str:
    """Run a line; returns its exit code."""
    with fresh():
        answer = spawn(line.arguments) if line.real else call(line.arguments)
    assert_answered(answer, line.arguments)
    return f"exit code {answer.code}"


def run(examples: int, seed: int) -> Record:
    """Try lines of all verbs."""
    made()
    return campaign("command_lines", lines(), check, examples, seed)


def run_quick(examples: int, seed: int) -> Record:
    """Try lines that need no process of their own."""
    made()
    return campaign("command_lines", quick_lines(), check, examples, seed)
