"""One C program under three C libraries: that of this computer, musl natively, musl as WebAssembly.

In goes C text, out come the numbers that it writes to its standard output. Of the functions of
math.h, :func:`differences` says how far musl's results are from those of this computer::

    exp   0.06 % of results differ, by at most 1 ulp
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import numpy as np

from runtime import toolchain
from runtime.codegen import MATH
from runtime.toolchain.library import FLAGS

INEXACT = tuple(name for name in toolchain.INEXACT if name in MATH)
OWN, MUSL, WASM = "own", "musl", "wasm"
TARGETS = {MUSL: "x86_64-linux-musl", WASM: "wasm32-wasi"}
BITS = FLAGS[2:]  # of the toolchain, which decide on bits: no fused operations, no known functions
NODE = """const {WASI} = require("wasi"), fs = require("fs");
const wasi = new WASI({version: "preview1"});
const module = new WebAssembly.Module(fs.readFileSync(process.argv[1]));
wasi.start(new WebAssembly.Instance(module, wasi.getImportObject()));
"""
ARGUMENTS = 200_000
FUNCTION = """
#include <math.h>
#include <stdint.h>
#include <stdio.h>
static uint64_t seed = 88172645463325252u;
static double any(void) /* of both signs, from 2^-20 to 2^10 */
{
    seed ^= seed << 13;
    seed ^= seed >> 7;
    seed ^= seed << 17;
    const double share = 1.0 + (double)(seed >> 12) / 4503599627370496.0;
    return (seed & 1 ? -1.0 : 1.0) * ldexp(share, (int)(seed >> 3 & 31) %% 31 - 20);
}
int main(void)
{
    for (int i = 0; i < %(arguments)d; i++) {
        const double x = any(), y = any();
        const double results[] = {%(calls)s};
        fwrite(results, sizeof results, 1, stdout);
        (void)y;
    }
    return 0;
}
"""
TWO = ("atan2", "hypot", "pow")


def inexact(text: str) -> list[str]:
    """The functions that a C text calls of which libraries differ in the last bits."""
    return [name for name in INEXACT if re.search(rf"\b(?:real_)?{name}\(", text)]


def available() -> bool:
    """Whether a program can be compiled for all three, and run."""
    return which("node") is not None and find_spec("ziglang") is not None and toolchain.available()


def results(folder: Path, *sources: str) -> dict[str, np.ndarray]:
    """What a program writes, as numbers, under each library."""
    zig = (sys.executable, "-m", "ziglang", "cc", "-target")
    compilers = {OWN: toolchain.find_compiler().command}
    compilers |= {name: (*zig, target) for name, target in TARGETS.items()}
    found = {}
    for name, compiler in compilers.items():
        flags = ("-std=gnu99", "-O1", *BITS, *sources, "-lm", "-o", name)
        subprocess.run((*compiler, *flags), cwd=folder, check=True, capture_output=True)
        run = ("node", "--no-warnings", "-e", NODE, name) if name == WASM else (folder / name,)
        said = subprocess.run(run, cwd=folder, check=True, capture_output=True).stdout
        found[name] = np.frombuffer(said)
    return found


def ulps(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How many numbers of double precision two results are apart; 0 of two NaN."""
    bits = [np.where(a < 0, np.int64(-(2**63)) - a, a) for a in (one.view("i8"), other.view("i8"))]
    both = np.isnan(one) & np.isnan(other)
    return np.where(both, 0, np.abs(bits[0] - bits[1]))


def differences() -> dict[str, tuple[float, int]]:
    """The share of results that differ between this computer's library and musl, and the most ulp.

    Raises
    ------
    ValueError : musl gives other bits as WebAssembly than natively.
    """
    calls = ", ".join(f"{name}({'x, y' if name in TWO else 'x'})" for name in INEXACT)
    with tempfile.TemporaryDirectory() as place:
        text = FUNCTION % {"arguments": ARGUMENTS, "calls": calls}
        Path(place, "functions.c").write_text(text, encoding="utf-8")
        found = results(Path(place), "functions.c")
    own, musl, wasm = (found[name].reshape(-1, len(INEXACT)) for name in (OWN, MUSL, WASM))
    if (ulps(musl, wasm) != 0).any():
        raise ValueError("musl has other results as WebAssembly than natively")
    apart = ulps(own, musl)
    columns = zip(INEXACT, apart.T, strict=True)
    return {name: (float(np.mean(each != 0)), int(each.max())) for name, each in columns}


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The largest difference, divided by 1 + |value|."""
    with np.errstate(invalid="ignore"):
        same = (one == other) | (np.isnan(one) & np.isnan(other))
        return float(np.max(np.where(same, 0.0, np.abs(one - other) / (1.0 + np.abs(other)))))
