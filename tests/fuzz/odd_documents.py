"""Anchors, names, models of Nengo and folders of fits that nobody expects, in real commands."""

from __future__ import annotations

import atexit
import csv
import io
import json
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from hypothesis import strategies as st

from tests.fuzz.campaign import Record, campaign
from tests.fuzz.mutation import mutate_bytes, mutate_tree
from tests.fuzz.workspace import PATIENCE, SCRIPT, Answer, assert_answered

TITLE = "Anchors, names, models of Nengo, folders of fits"
WHAT = (
    "Graphs whose YAML has anchors and aliases that are cyclic, merged, unknown, nested or many; "
    "graphs whose blocks, metrics, probes and parameters have odd, long and reserved names, names "
    "of columns, other scripts and control characters; Python files for import nengo that end the "
    "process, raise what cannot be printed, change folders or streams, with and without "
    "--no-modules; damaged folders, data and links of fits. Then a verb reads them, as a process."
)
HOLDS = (
    "Each verb ends with a documented exit code and a sentence, never a traceback; JSON, YAML, "
    "archives and tables that were written are whole, and none is hidden; no other file "
    "changes. A run and a sweep that end with 0 have a value for each metric, under its name. "
    "import says that it executes a file before it does, and with --no-modules it does not."
)
GRAPH: dict[str, Any] = {
    "graph": "g",
    "run": {"dt": 0.1, "until": 0.3},
    "params": {"k": 2.0},
    "blocks": {"a": {"type": "Constant", "value": "$k"}, "b": {"type": "Integrator"}},
    "wires": {"b": {"input": "a.value"}},
    "probes": {"p": "b.out"},
    "metrics": {"m": {"kind": "final", "of": "b.out"}},
}
RUN = ("--no-plots", "--out", "out")


@dataclass(frozen=True)
class Case:
    """Files by name (None removes one, a name with ``->`` in front is a link), and a command."""

    kind: str
    files: tuple[tuple[str, bytes | str | None], ...]
    command: tuple[str, ...]
    metric: str = ""


# What aliases are put into: {0} is the definition and use of an anchor.
ANCHORED = (
    "blocks: &a {{x: *a}}\n",
    "blocks: &a [*a]\n",
    "blocks: {{a: &a {{type: Constant, value: [1, *a]}}}}\n",
    "params: &p {{k: 2.0}}\nblocks: {{a: {{type: Constant, <<: *p}}}}\n",
    "blocks: {{a: &a {{type: Constant}}, b: {{<<: *a, value: 2}}}}\n",
    "blocks: {{a: &a {{type: Constant}}, b: {{<<: [*a, *a, *nobody]}}}}\n",
    "blocks: {{a: {{type: *nobody}}}}\n",
    "blocks: {{a: {{type: Constant, value: &v 1}}, b: {{type: Constant, value: *v}}}}\n",
    "blocks: {{&k a: {{type: Constant}}, b: {{type: Constant, value: *k}}}}\n",
    "blocks: {{a: {{type: Constant}}, ? *a : 3}}\n",
    "blocks: {{&k a: {{type: Constant}}, *k : {{type: Constant}}}}\n",
    "blocks: {{a: {{type: Constant, value: &v 1, value: &v 2}}}}\nprobes: {{p: *v}}\n",
    "blocks: {{a: {{type: Constant, value: {many}}}}}\n",
    "{levels}blocks: {{a: {{type: Constant, value: *l{deep}}}}}\n",
    "{levels}blocks: *l{deep}\n",
    "{levels}blocks: {{a: {{type: Constant, <<: *l{deep}}}}}\n",
    "blocks: {{a: {{type: Constant, value: {nested}}}}}\n",
    "--- &doc\nblocks: {{a: *doc}}\n",
)
NAMES = (
    *("", " ", "a b", "a.b", "a/b", "../x", "..", ".", "-x", "--json", "$k", "$", "=1+1", "@x"),
    *("run", "blocks", "latest", "class", "None", "True", "null", "~", "yes", "NaN", "inf", "1e3"),
    *(
        "__init__",
        "self",
        "state",
        "inputs",
        "t",
        "dt",
        "params",
        "world",
        "time",
        "np",
        "0",
        "007",
    ),
    *("trial", "seed", "status", "reason", "signals", "check", "wall_s", "params.k", "worker"),
    *("a,b", 'a"b', "a'b", "a\nb", "a\tb", "a\rb", "\x00", "\x1b[31mred", "\x7f", "\x85", "\u2028"),
    *("é", "e\u0301", "\u202eabc", "\u200b", "\ufeff", "ａ", "漢字", "\U0001f916", "а", "ß", "İ"),
    *(
        "a" * 300,
        "a" * 20_000,
        "a:",
        "a: b",
        "# a",
        "<script>",
        "</svg>",
        "&amp;",
        "%s",
        "{0}",
        "\\",
    ),
    *("A", "b", "a", "con", "nul", "x.npz", "x=1", "a[0]", "a->b", "a;b", "a|b", "*", "?"),
)
PLACES = ("graph", "block", "metric", "probe", "param", "anchor of all")
MODEL = """import nengo, sys, os
open("ran.txt", "w").close()
sys.stderr.write("STARTED\\n"); sys.stderr.flush()
with nengo.Network(seed=1, label={label!r}) as model:
    one = nengo.Node([0.5], label={label!r})
    two = nengo.Ensemble(5, 1, seed=2, label={label!r})
    nengo.Connection(one, two)
    seen = nengo.Probe(two, label={label!r})
{rest}
"""
HOSTILE = (
    *("", "sys.exit(0)", "sys.exit('bye')", "raise BaseException('b')", "raise GeneratorExit"),
    *("raise KeyboardInterrupt", "raise SystemExit(None)", "exit()", "def (", "\x00", "1/0"),
    "class E(Exception):\n    def __str__(self): raise RuntimeError('no text')\nraise E",
    "class E(Exception):\n    def __repr__(self): sys.exit(0)\n    __str__ = __repr__\nraise E",
    *("f = lambda: f()\nf()", "del model", "model = 3", "model = nengo.Network", "other = model"),
    "other = nengo.Network()",
    "class N:\n    def __getattr__(self, name): raise ValueError(name)\nmodel = N()",
    *("os.chdir('/')", "sys.stdout = None", "sys.stderr = None", "sys.stdout.close()"),
    *(
        "print('text ' * 9)",
        "import warnings; warnings.warn('\\x1b[31m\\n')",
        "os.remove(__file__)",
    ),
    *(
        "sys.modules.pop('nengo')",
        "os.close(1)",
        "sys.argv[:] = []",
        "sys.path[:] = []",
        "model.seed = 'x'",
    ),
    *("one.output = lambda t: 1/0", "one.output = lambda t: [t, t]", "two.neuron_type = None"),
    *(
        "raise MemoryError",
        "raise ImportError('\\x1b[31m')",
        "raise StopIteration",
        "import nobody",
    ),
    "one.output = lambda t: sys.exit(0)",
    "one.output = lambda t: 1 / 0 if t > 0.0005 else 0.0",
    "one.output = lambda t: 'x' if t > 0 else 0.0",
    "model = nengo.Network()\nwith model: nengo.Node(lambda t: 1 / 0 if t else 0.0)",
    "nengo.Connection(two, two, function=lambda x: 1 / 0 if x > 0.5 else x, add_to_container=1)",
    "with model: nengo.Connection(two, two, function=lambda x: 1 / 0 if x > 0.5 else x)",
    "with model: nengo.Connection(two, two, function=lambda x: sys.exit(0) if x > 0.5 else x)",
    "raise ExceptionGroup('g', [ValueError(1)])",
)
LABELS = (
    None,
    "a",
    "a b",
    "../x",
    "\x1b[31m",
    "a\nb",
    "=1",
    "run",
    "漢",
    "x" * 3000,
    "",
    "a.b",
    "\x00",
)


@st.composite
def anchors(draw: st.DrawFn) -> Case:
    """A graph with anchors."""
    most, deep = draw(st.sampled_from([2, 9, 60])), draw(st.integers(0, 12))
    levels = "l0: &l0 [1]\n" + "".join(
        f"l{n}: &l{n} [{', '.join([f'*l{n - 1}'] * most)}]\n" for n in range(1, deep + 1)
    )
    number = draw(st.sampled_from([1, 100, 30_000]))
    text = draw(st.sampled_from(ANCHORED)).format(
        levels=levels,
        deep=deep,
        many="[&v 1" + ", *v" * number + "]",
        nested="&n [" * number + "]" * number,
    )
    text = "graph: g\nrun: {dt: 0.1, until: 0.3}\n" * (not text.startswith("---")) + text
    command = draw(
        st.sampled_from(
            [
                *(("validate", "g.yaml"), ("validate", "g.yaml", "--json"), ("explain", "g.yaml")),
                *(("run", "g.yaml", *RUN), ("draw", "g.yaml", "-o", "g.svg")),
                ("validate", "sound.yaml", "--with", "g.yaml"),
            ]
        )
    )
    return Case("anchors", (("g.yaml", text),), command)


@st.composite
def names(draw: st.DrawFn) -> Case:
    """A graph with odd names in one or two places."""
    graph = json.loads(json.dumps(GRAPH))
    name = draw(st.one_of(st.sampled_from(NAMES), st.text(min_size=1, max_size=3)))
    name = name.encode("utf-8", "ignore").decode()
    metric = "m"
    for place in draw(st.lists(st.sampled_from(PLACES), min_size=1, max_size=2, unique=True)):
        if place == "graph":
            graph["graph"] = name
        elif place == "block":
            graph["blocks"] = {name: graph["blocks"]["a"], "b": {"type": "Integrator"}}
            graph["wires"] = {"b": {"input": f"{name}.value"}}
        elif place == "metric":
            graph["metrics"], metric = {name: GRAPH["metrics"]["m"]}, name
        elif place == "probe":
            graph["probes"] = {name: "b.out"}
        elif place == "param":
            graph["params"], graph["blocks"]["a" if "a" in graph["blocks"] else name] = (
                {name: 2.0},
                {"type": "Constant", "value": f"${name}"},
            )
        else:
            graph["metrics"] |= {name: {"kind": "mean", "of": "b.out"}}
    text = json.dumps(graph, ensure_ascii=False).replace("\x7f", "\\u007f").replace("\x85", "\\N")
    key = next(iter(graph["params"]))
    commands = [
        *[("run", "g.yaml", *RUN), ("validate", "g.yaml", "--json")] * 2,
        *[("sweep", "g.yaml", f"--vary=params.{key}=[1.0,2.0]", "-j", "1", "--no-plots")] * 2,
        *(("draw", "g.yaml", "-o", f"g.{suffix}") for suffix in ("svg", "dot", "tex", "mmd")),
        ("run", "g.yaml", "--out", "out"),
        ("export", "c", "g.yaml", "-o", "c"),
        ("explain", "g.yaml"),
    ]
    command = tuple(word.replace("\x00", "") for word in draw(st.sampled_from(commands)))
    return Case("names", (("g.yaml", text),), command, metric)


@st.composite
def models(draw: st.DrawFn) -> Case:
    """A Python file for ``import nengo``."""
    text = MODEL.format(label=draw(st.sampled_from(LABELS)), rest=draw(st.sampled_from(HOSTILE)))
    more = draw(
        st.sampled_from([(), (), ("--compare", "--until", "0.01"), ("--json",), ("--redraw",)])
    )
    more += draw(st.sampled_from([(), (), ("--no-modules",)]))
    file = draw(st.sampled_from(["model.py", "model.py", "model.py:model", "model.py:nobody"]))
    return Case("models", (("model.py", text),), ("import", "nengo", file, "-o", "new.yaml", *more))


FIT = ("fit", "sound.yaml", "--vary", "params.k=0..5", "--to", "data.csv:x=b.out", "--starts", "1")
FITTING = (*FIT, "--no-plots")
FITS = "fits/g/latest"


@st.composite
def fits(draw: st.DrawFn) -> Case:
    """A damaged folder of a fit, or damaged data, and what reads it."""
    files = {
        path.name: path
        for path in (prepared() / "fits" / "g" / "first").iterdir()
        if path.is_file()
    }
    reading = [
        *(("report", FITS), ("compare", FITS, FITS, "--no-plots"), ("clean", "fits")),
        *(("run", "sound.yaml", "--from", FITS, *RUN), ("validate", f"{FITS}/fit.json")),
        *(FITTING, (*FITTING, "--json"), (*FIT, "--figures", "svg"), (*FITTING, "--write")),
    ]
    command = draw(st.sampled_from(reading))
    links = [
        ("fits/g/latest", way) for way in ("->nowhere", "->latest", "->/dev/null", b"text", None)
    ]
    above = [("fits/g", b"text"), ("fits/g", "->nowhere"), ("fits", b""), ("fits", "->fits")]
    data = (prepared() / "data.csv").read_bytes()
    name = draw(st.sampled_from(sorted(files)))
    content = files[name].read_bytes()
    if name.endswith(".json") and draw(st.booleans()):
        tree = mutate_tree(draw, json.loads(content), ["values", "x", ""], ["b.out", "x"])
        content = json.dumps(tree).encode()
    else:
        content = mutate_bytes(draw, content)
    damage = draw(
        st.sampled_from(
            [
                *[(f"fits/g/first/{name}", content)] * 2,
                *[("data.csv", mutate_bytes(draw, data))] * 4,
                *links,
                *above,
            ]
        )
    )
    return Case("fits", (damage,), command)


@cache
def prepared() -> Path:
    """A folder with a sound graph, data and a fit of it."""
    folder = Path(tempfile.mkdtemp(prefix="spikeblocks-odd-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    (folder / "sound.yaml").write_text(yaml.safe_dump(GRAPH), encoding="utf-8")
    (folder / "data.csv").write_text("time,x\n0,0\n0.1,0.3\n0.2,0.61\n")
    subprocess.run([SCRIPT, *FIT], cwd=folder, check=True, capture_output=True)
    (made,) = (folder / "fits" / "g").glob("2*")
    made.rename(made.with_name("first"))
    (folder / FITS).unlink()
    (folder / FITS).symlink_to("first")
    return folder


def put(path: Path, content: bytes | str | None) -> None:
    """Put content, a link or nothing in the place of a file, a link or a folder."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None and content.startswith("->"):
        path.symlink_to(content[2:])
    elif content is not None:
        path.write_bytes(content.encode("utf-8", "surrogatepass"))


def spawned(command: Sequence[str], folder: Path) -> Answer:
    """What a command answers in a folder."""
    options: dict[str, Any] = {"capture_output": True, "timeout": PATIENCE, "cwd": folder}
    done = subprocess.run([SCRIPT, *command], stdin=subprocess.DEVNULL, **options)
    texts = (stream.decode("utf-8", "backslashreplace") for stream in (done.stdout, done.stderr))
    return Answer(done.returncode, *texts)


def contents(folder: Path) -> dict[str, bytes]:
    """What each file of a folder holds."""
    found = (path for path in folder.rglob("*") if path.is_file() and not path.is_symlink())
    return {str(path.relative_to(folder)): path.read_bytes() for path in found}


def assert_whole(before: dict[str, bytes], after: dict[str, bytes], changes: set[str]) -> None:
    """What was there is there, and what is new can be read to its end."""
    changed = {name for name, content in before.items() if after.get(name) != content} - changes
    assert not changed, f"changed: {sorted(changed)}"
    for name in sorted(after.keys() - before.keys()):
        content = after[name]
        assert "partial" not in name, f"left behind: {name}"
        if name.endswith(".json"):
            json.loads(content)
        elif name.endswith(".yaml"):
            yaml.compose(content)
        elif name.endswith(".csv"):
            lengths = {len(row) for row in csv.reader(io.StringIO(content.decode()))}
            assert len(lengths) == 1, f"{name}: rows of {lengths}"
        elif name.endswith(".npz"):
            assert zipfile.ZipFile(io.BytesIO(content)).testzip() is None, name
        elif name.endswith(".svg"):
            assert content.rstrip().endswith(b"</svg>"), name


def check(case: Case) -> str:
    """Put the files in their places, run the command, look at its answer and what it left."""
    with tempfile.TemporaryDirectory(prefix="spikeblocks-odd-") as above:
        folder = Path(above, "work")
        shutil.copytree(prepared(), folder, symlinks=True)
        for name, content in case.files:
            put(folder / name, content)
        before = contents(folder)
        answer = spawned(case.command, folder)
        after = contents(folder)
        assert_answered(answer, case.command)
        changes = {"sound.yaml"} if "--write" in case.command else set()
        changes |= {"model.py"} if "os.remove" in str(case.files) else set()
        assert_whole(before, after, changes)
        if case.kind == "models":
            _assert_announced(case, answer, after)
        if case.kind == "names" and answer.code == 0:
            _assert_named(case, folder)
    return f"{case.kind}: exit code {answer.code}"


def _assert_announced(case: Case, answer: Answer, after: dict[str, bytes]) -> None:
    ran = "ran.txt" in after
    if "--no-modules" in case.command:
        assert not ran and answer.code == 2, f"exit code {answer.code} with --no-modules"
    if ran:
        told = answer.err.find("executing 'model.py'")
        assert 0 <= told < answer.err.find("STARTED"), f"not said before: {answer.err}"
    # --compare runs the graph after it is written.
    assert answer.code not in (0, 1) or "new.yaml" in after, f"nothing written: {answer.err}"


def _assert_named(case: Case, folder: Path) -> None:
    """Values of the metric under its name, which is 0.4 for the sound graph."""
    if case.command[0] == "run":
        (file,) = (path for path in folder.glob("out/*/2*/metrics.json"))
        assert case.metric in json.loads(file.read_text(encoding="utf-8")), file.read_text()
        report = spawned(("report", str(file.parent)), folder)
        assert report.code == 0, report.err
    elif case.command[0] == "sweep":
        (file,) = folder.glob("sweeps/*/index.csv")
        head, *rows = csv.reader(io.StringIO(file.read_text(encoding="utf-8"), newline=""))
        assert len(set(head)) == len(head), f"columns {head}"
        found = [row[head.index(case.metric)] for row in rows]
        assert sorted(map(float, found)) == [0.2, 0.4], f"{head}, {rows}"


def cases() -> st.SearchStrategy[Case]:
    """All kinds."""
    return st.one_of(anchors(), names(), models(), fits())


def run(examples: int, seed: int) -> Record:
    """Try odd documents."""
    prepared()
    return campaign("odd_documents", cases(), check, examples, seed, shrink=False)
