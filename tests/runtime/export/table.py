"""The table of docs/export.md: each shipped graph as C, as WebAssembly and as an FMU.

In: the shipped graphs. Out: a row for each, between two comments of the page; those of other graphs
stay. ``python -m tests.runtime.export.table [GRAPH ...]`` writes it::

    | gallery/pid_loop | 5000 | 0 | 9,612 | 784 | yes | 97 |
"""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from concurrent.futures import ProcessPoolExecutor
from importlib.util import find_spec
from pathlib import Path
from shutil import which

import runtime
from runtime import toolchain
from runtime.errors import SpikeblocksError
from runtime.export import export
from runtime.export.fmu import export_fmu

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "export.md"
BEGIN, END = "<!-- begin: shipped graphs as C -->\n", "<!-- end: shipped graphs as C -->\n"
HEAD = (
    "| graph | ticks replayed | largest difference | code [bytes] | RAM [bytes] | WebAssembly | "
    "FMU [kB] |\n|---|---|---|---|---|---|---|\n"
)
MOST_TICKS = 5000  # on which WebAssembly is compared
# A hash of the bits of all outputs, which is the same natively and as WebAssembly.
BITS = """
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include "controller.h"
static struct controller c;
int main(void)
{
    static struct controller_inputs in;
    static struct controller_outputs out;
    unsigned char bytes[sizeof out];
    uint64_t hash = 14695981039346656037u;
    int k = 0;
    controller_init(&c);
    for (; k < %d && !controller_step(&c, &in, &out); k++) {
        memcpy(bytes, &out, sizeof out);
        for (int i = 0; i < (int)sizeof out; i++) hash = (hash ^ bytes[i]) * 1099511628211u;
    }
    printf("%%d %%llx", k, (unsigned long long)hash);
    return 0;
}
"""
NODE = """const {WASI} = require("wasi"), fs = require("fs");
const wasi = new WASI({version: "preview1"});
const module = new WebAssembly.Module(fs.readFileSync(process.argv[1]));
wasi.start(new WebAssembly.Instance(module, wasi.getImportObject()));
"""
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "controller.c", "bits.c", "-lm", "-o")


def shipped() -> list[str]:
    """All shipped graphs that are no part of another one, and need no extra."""
    found = []
    for path in sorted((ROOT / "graphs").rglob("*.yaml")):
        name = str(path.relative_to(ROOT / "graphs").with_suffix(""))
        if "\nrun:" in path.read_text(encoding="utf-8") and "mujoco" not in name:
            found.append(name)
    return found


def row(name: str) -> str:
    """The cells of a graph."""
    graph = runtime.load(name)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        try:
            report = export(graph, folder / "c").report
        except SpikeblocksError as error:
            return f"{name} | – | {str(error).splitlines()[0]} | – | – | – | –"
        ticks = int(_find(r"Replay of (?:all|the first) (\d+)", report))
        apart = max(map(float, re.findall(r"largest difference (\S+)", report)))
        code = _find(r": (\d+) bytes of code", report)
        ram = _find(r"controller: (\d+) bytes", report)
        whole = "" if "all" in _find(r"Replay of (\w+)", report) else "first "
        made = export_fmu(graph, folder / "fmu")
        size = (made.folder / made.files[0]).stat().st_size
        equal = webassembly(folder / "c", min(ticks, MOST_TICKS))
    numbers = f"{int(code):,} | {int(ram):,}" if code else f"– | {int(ram):,}"
    return f"{name} | {whole}{ticks:,} | {apart:.2g} | {numbers} | {equal} | {size / 1e3:.0f}"


def _find(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    return found.group(1) if found else ""


def webassembly(folder: Path, ticks: int) -> str:
    """Whether the C has the same outputs as WebAssembly as it has natively, to the bit."""
    if which("node") is None or find_spec("ziglang") is None:
        return "–"
    (folder / "bits.c").write_text(BITS % ticks, encoding="utf-8")
    zig = (sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi")
    for command in ((*toolchain.find_compiler().command, *FLAGS, "n"), (*zig, *FLAGS, "w.wasm")):
        subprocess.run(command, cwd=folder, check=True, capture_output=True)
    said = [
        subprocess.run(command, cwd=folder, check=True, capture_output=True).stdout
        for command in ((folder / "n",), ("node", "--no-warnings", "-e", NODE, "w.wasm"))
    ]
    if said[0] == said[1]:
        return "equal"
    first, second = (int(each.split()[0]) for each in said)
    return "other bits" if first == second else f"ends at tick {second}, not {first}"


def rows() -> dict[str, str]:
    """The rows that the page has, by graph."""
    part = PAGE.read_text(encoding="utf-8").partition(BEGIN)[2].partition(END)[0]
    lines = [line.strip("| ") for line in part.splitlines()[4:] if line.startswith("|")]
    return {line.partition(" |")[0]: line for line in lines}


def write(found: dict[str, str]) -> None:
    """Write the rows into the page, in the order of the graphs' names."""
    names = [name for name in shipped() if name in found]
    failed = sum("| – | – | – | –" in found[name] for name in names)
    left = len(shipped()) - len(names)
    text = f"{len(names) - failed} of {len(names)} graphs are exported whole"
    text += f"; {left} more were not measured.\n\n{HEAD}" if left else f".\n\n{HEAD}"
    text += "".join(f"| {found[name]} |\n" for name in names)
    before, _, rest = PAGE.read_text(encoding="utf-8").partition(BEGIN)
    PAGE.write_text(before + BEGIN + text + END + rest.partition(END)[2], encoding="utf-8")


def main(names: list[str]) -> None:
    """Measure these graphs, or all of them, and write each row when it is there."""
    chosen = names or shipped()
    with ProcessPoolExecutor(2) as pool:
        for name, found in zip(chosen, pool.map(row, chosen), strict=True):
            print(found, flush=True)
            write(rows() | {name: found})


if __name__ == "__main__":
    main(sys.argv[1:])
