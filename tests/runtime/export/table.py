"""The tables of docs/export.md: each shipped graph as C, as WebAssembly and as an FMU.

In: the shipped graphs. Out: a row for each, a summary of all rows, and the functions of math.h that
differ between C libraries, between the page's comments. ``python -m tests.runtime.export.table``
measures the graphs that have no row, ``... table GRAPH ...`` these again::

    | gallery/pid_loop | 5,000 of 5,000 | 0 | equal | 0 | | 3 equal | 4,155 | 352 | 28 |
"""

from __future__ import annotations

import re
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import runtime
from runtime.errors import SpikeblocksError
from runtime.export import export
from tests.runtime.export import libraries

ROOT = Path(__file__).parents[3]
PAGE = ROOT / "docs" / "export.md"
PARTS = ("summary of graphs as C", "functions of math.h", "shipped graphs as C")
COLUMNS = (
    *("graph", "ticks", "C – run", "WebAssembly", "other math.h", "functions that round"),
    *("FMU", "code [bytes]", "RAM [bytes]", "FMU [kB]"),
)
MOST_TICKS = 5000  # that the Python engine runs and the C replays
FMU_TICKS = 300
DUMP = """
#include <stdio.h>
#include "controller.h"
static struct controller c;
int main(void)
{
    static struct controller_inputs in;
    static struct controller_outputs out;
    double end = 0.0;
    controller_init(&c);
    for (; end < %d && !controller_step(&c, &in, &out); end++) fwrite(&out, sizeof out, 1, stdout);
    fwrite(&end, sizeof end, 1, stdout);
    return 0;
}
"""


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
            report = export(graph, folder / "c", ticks=MOST_TICKS).report
        except SpikeblocksError as error:
            reason = str(error).splitlines()[0].replace("|", "/")
            return " | ".join([name, "–", reason, *["–"] * (len(COLUMNS) - 3)])
        ticks = int(_find(r"Replay of (?:all|the first) (\d+)", report))
        apart = max(map(float, re.findall(r"largest difference (\S+)", report)))
        code = int(_find(r": (\d+) bytes of code", report) or 0)
        ram = int(_find(r"controller: (\d+) bytes", report))
        equal, other = webassembly(folder / "c", ticks)
        functions = ", ".join(
            libraries.inexact((folder / "c" / "controller.c").read_text(encoding="utf-8"))
        )
        signals, size = fmu(graph, folder / "fmu")
    cells = (name, f"{ticks:,} of {graph.network.ticks:,}", f"{apart:.2g}", equal, other, functions)
    return " | ".join([*cells, signals, f"{code:,}" if code else "–", f"{ram:,}", f"{size:.0f}"])


def _find(pattern: str, text: str) -> str:
    found = re.search(pattern, text)
    return found.group(1) if found else ""


def webassembly(folder: Path, ticks: int) -> tuple[str, str]:
    """Whether the C as WebAssembly has all bits of the C with musl natively; and the largest
    difference from it with the library of this computer, divided by 1 + |value|."""
    if not libraries.available():
        return "–", "–"
    (folder / "dump.c").write_text(DUMP % ticks, encoding="utf-8")
    found = libraries.results(folder, "controller.c", "dump.c")
    own, musl, wasm = (found[name] for name in (libraries.OWN, libraries.MUSL, libraries.WASM))
    equal = "equal" if musl.tobytes() == wasm.tobytes() else "other bits"
    if len(own) != len(wasm):
        return equal, f"ends at tick {wasm[-1]:.0f}, not {own[-1]:.0f}"
    return equal, f"{libraries.apart(own, wasm):.2g}"


def fmu(graph: runtime.Graph, folder: Path) -> tuple[str, float]:
    """How many recorded signals are equal in fmpy, and the kB of the file."""
    from spikeblocks.fmu.export import export_fmu

    ticks = min(FMU_TICKS, graph.network.ticks)
    graph = graph.set("run.until", ticks * graph.network.dt)
    made = export_fmu(graph, folder)
    file = made.folder / made.files[0]
    size = file.stat().st_size / 1e3
    if find_spec("fmpy") is None:
        return "–", size
    from tests.bridges.fmu import test_export as test_fmu

    problems = test_fmu.validation.validate_fmu(str(file))
    if problems:
        return f"not valid: {problems[0]}", size
    try:
        return f"{test_fmu.equal_signals(file, graph, ticks)} equal", size
    except AssertionError as error:
        return f"another {str(error).splitlines()[0]}", size


def rows() -> dict[str, list[str]]:
    """The rows that the page has, by graph."""
    part = PAGE.read_text(encoding="utf-8").partition(f"<!-- begin: {PARTS[2]} -->")[2]
    lines = part.partition("<!-- end")[0].splitlines()
    cells = [[cell.strip() for cell in line.split(" | ")] for line in lines if " | " in line]
    found = [[line[0].removeprefix("| "), *line[1:-1], line[-1].rstrip(" |")] for line in cells]
    return {each[0]: each for each in found if each[0] in shipped()}


def summary(found: dict[str, list[str]]) -> str:
    """What the rows say together."""
    left = len(shipped()) - len(found)
    whole = {name: cells for name, cells in found.items() if cells[1] != "–"}
    if not whole:
        return "No graph was measured.\n"

    def worst(column: int) -> str:
        name, value = max(
            (
                (name, float(cells[column]))
                for name, cells in whole.items()
                if _is_number(cells[column])
            ),
            key=lambda pair: pair[1],
        )
        return f"{value:.2g} (`{name}`)"

    def those(column: int, said: str) -> int:
        return sum(bool(re.fullmatch(said, cells[column])) for cells in whole.values())

    compared = those(3, "equal|other bits")
    ending = those(4, "ends.*")
    lines = [
        f"* **Whole:** {len(whole)} of {len(found)} graphs are exported"
        + (f"; {left} more were not measured." if left else "."),
        f"* **Replay:** {those(2, '0')} have every bit of the Python engine; the largest "
        f"difference of another one is {worst(2)}.",
        f"* **WebAssembly:** {those(3, 'equal')} of {compared} have every bit of the same C run "
        "natively with the same math.h (musl).",
        f"* **With another math.h:** {those(4, '0')} have every bit with this computer's; "
        f"the largest difference of another one is {worst(4)}"
        + (f", and {ending} end at another tick." if ending else "."),
        f"* **FMU:** {those(6, r'[0-9]+ equal')} are valid for fmpy and have every bit of a run.",
    ]
    lines += [
        f"* `{name}` is not exported: {cells[2]}."
        for name, cells in found.items()
        if name not in whole
    ]
    lines += [
        f"* `{name}`, {COLUMNS[c]}: {cells[c]}."
        for name, cells in whole.items()
        for c, fine in ((3, "equal|–"), (4, "[-+.e0-9]+|–"), (6, r"[0-9]+ equal|–"))
        if not re.fullmatch(fine, cells[c])
    ]
    return "\n".join(lines) + "\n"


def _is_number(text: str) -> bool:
    return bool(re.fullmatch(r"[-+.e0-9]+", text))


def functions() -> str:
    """The functions of math.h that are not the same in all libraries."""
    if not libraries.available():
        return ""
    lines = ["| function | results that differ | by at most |", "|---|---|---|"]
    for name, (share, most) in sorted(libraries.differences().items()):
        lines.append(f"| `{name}` | {100 * share:.2g} % | {most} ulp |")
    return "\n".join(lines) + "\n"


def write(parts: dict[str, str]) -> None:
    """Write parts into the page."""
    text = PAGE.read_text(encoding="utf-8")
    for name, part in parts.items():
        before, begin, rest = text.partition(f"<!-- begin: {name} -->\n")
        _, end, after = rest.partition(f"<!-- end: {name} -->\n")
        text = before + begin + part + end + after
    PAGE.write_text(text, encoding="utf-8")


def written(found: dict[str, list[str]]) -> dict[str, str]:
    """The parts of the page that follow from the rows."""
    found = {name: found[name] for name in shipped() if name in found}
    lines = [list(COLUMNS), ["---"] * len(COLUMNS), *found.values()]
    table = "".join(f"| {' | '.join(cells)} |\n" for cells in lines)
    fold = "<details><summary>The table</summary>\n\n"
    return {PARTS[0]: summary(found), PARTS[2]: f"{fold}{table}\n</details>\n"}


def main(names: list[str]) -> None:
    """Measure these graphs, or those that have no row, and write each row when it is there."""
    write({PARTS[1]: functions()})
    for name in names or [each for each in shipped() if each not in rows()]:
        found = row(name)
        print(found, flush=True)
        write(written(rows() | {name: found.split(" | ")}))


if __name__ == "__main__":
    main(sys.argv[1:])
