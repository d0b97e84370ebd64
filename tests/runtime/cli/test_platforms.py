"""Every verb runs, or ends with one sentence, where Python has what macOS or Windows lets it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from runtime.cli.commands import VERBS
from tests.compilers import needs_compiler

FOLDER = Path(__file__).parent / "platforms"
GRAPH = """graph: lag
run: {dt: 0.01, until: 0.5}
blocks:
  step: {type: Step, time: 0.1}
  noise: {type: WhiteNoise, density: 0.01}
  sum: {type: Sum}
  plant: {type: TransferFunction, numerator: [1], denominator: [1, 1]}
wires: {sum: {terms: [step.out, noise.out]}, plant: {input: sum.out}}
probes: {y: plant.out}
plots: {y: {kind: timeseries, of: y}}
metrics: {mean: {kind: mean_abs, of: y}}
"""
OWN = '''from blocks import Block, Input, Output, Scalar


class Twice(Block):
    """Twice the input."""

    x = Input(Scalar)
    out = Output(Scalar)

    def output(self, state, t, x):
        return 2.0 * x
'''
SET = "--vary=plant.numerator.0=[1,2]"
COMMANDS = (
    "new copy.yaml --from tracking",
    "run g.yaml --out runs/a --json",
    "run g.yaml --out runs/b --engine compiled --seed 1",
    "validate g.yaml copy.yaml",
    "draw g.yaml -o g.svg",
    "explain g.yaml",
    "linearize g.yaml --without noise --inputs sum.out --outputs plant.out",
    "blocks",
    "check own.py",
    "graphs",
    f"sweep g.yaml {SET} --seeds 0..1 --no-plots",
    f"sweep g.yaml {SET} --seeds 0..1 --no-plots --resume -j 2",
    "ablate g.yaml --without noise --seeds 0..1 --no-plots -j 1",
    "tune g.yaml --vary plant.numerator.0=0.5..2 --minimize mean --trials 2 --seeds 0..1 -j 1",
    "fit g.yaml --vary plant.numerator.0=0.5..2 --to {a}/probes.npz:y=plant.out --starts 1",
    "compare {a} {b} --no-plots",
    "report {a} -o run.html",
    "report sweeps/lag -o sweep.html",
    "render {a}",
    "export g.yaml c --block sum",
    "clean runs/a --yes",
    "completion bash",
    "lsp",
    "schema",
    "plugins",
    "help changes",
    "run g.yaml --out runs/c --no-plots --checkpoint 1h",
    "resume runs/c/lag --until 4 --no-plots",
    "replay nothing",
    "contest nothing.yaml",
    "import nengo nothing.py -o n.yaml",
    "bag nothing",
    "play nothing.yaml --bag nothing.mcap",
    "drive nothing.yaml --ports nothing.yaml",
    "serve-plant nothing.yaml --ports nothing.yaml",
    "studio nothing.yaml --no-browser",
)
# One process runs all: starting one for each would take longer than what they do.
DRIVER = """
import contextlib, io, json, sys, traceback
from pathlib import Path
from runtime.cli import run

found = []
for line in json.loads(sys.argv[1]):
    places = {n: str(next(iter(Path("runs", n).glob("*/2*")), "")) for n in ("a", "b")}
    out, err = io.TextIOWrapper(io.BytesIO()), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = run([word.format(**places) for word in line.split()])
        except SystemExit as error:
            code = error.code
        except BaseException:
            code = traceback.format_exc()
    found.append((line, code, err.getvalue()))
print(json.dumps(found))
"""


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("system", ["macos", "windows"])
def test_every_verb_runs_or_says_what_is_missing(system: str, tmp_path: Path) -> None:
    assert {line.split()[0] for line in COMMANDS} == set(VERBS.library())
    (tmp_path / "g.yaml").write_text(GRAPH)
    (tmp_path / "own.py").write_text(OWN)
    done = subprocess.run(
        [sys.executable, "-c", DRIVER, json.dumps(COMMANDS)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(FOLDER), "LOOKS_LIKE": system},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    wrong = []
    for line, code, errors in json.loads(done.stdout):
        # What is not there is said, too.
        is_expected = "pip install" in errors or line[:6] == "render" or "nothing" in line
        sentence = errors.count("\n") == 1 and is_expected
        if code and not (code in (2, 4) and sentence):
            wrong.append(f"{line}: {code} {errors}")
    assert not wrong, "\n".join(wrong)
    # Links need a right under Windows that users do not have.
    assert os.path.lexists(tmp_path / "runs/a/lag/latest") == (system != "windows")
