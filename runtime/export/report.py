"""What an exported controller needs: memory, code, operations."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

from runtime.codegen import Counter, Operations
from runtime.export.files import Replay
from runtime.export.layout import Layout
from runtime.export.recording import Native, still
from runtime.plan import Port

CORTEX = ("-mcpu=cortex-m4", "-mthumb", "-mfpu=fpv4-sp-d16", "-mfloat-abi=hard")
COMPILER, SIZE = "arm-none-eabi-gcc", "arm-none-eabi-size"
FLAGS = ("-std=c99", "-O2", "-ffp-contract=off", "-c")


def operations(layout: Layout) -> dict[str, Operations]:
    """The operations of a step that computes everything, by block."""
    found: dict[str, Operations] = {}
    for call in layout.selection.calls:
        text = layout.units.blocks[call.block]
        count = Counter(text.functions).count(text.methods[call.method], text.integers)
        found.setdefault(call.block, Operations()).add(count)
    return found


def cortex_sizes(texts: Mapping[str, str]) -> dict[str, int] | None:
    """Bytes of code with constants, and of static data, on a Cortex-M4; None without a compiler.

    Parameters
    ----------
    texts : the header and the source, by file name.
    """
    compiler, size = shutil.which(COMPILER), shutil.which(SIZE)
    if compiler is None or size is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        for name, text in texts.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        source = next(name for name in texts if name.endswith(".c"))
        made = [compiler, *CORTEX, *FLAGS, source, "-o", "made.o"]
        try:
            subprocess.run(made, cwd=folder, check=True, capture_output=True)
            answer = subprocess.run(
                [size, "made.o"], cwd=folder, check=True, capture_output=True, text=True
            )
        except (OSError, subprocess.CalledProcessError):
            return None
    numbers = [int(word) for word in answer.stdout.split("\n")[1].split()[:3]]
    return {"text": numbers[0], "static": numbers[1] + numbers[2]}


def report(
    layout: Layout,
    about: Sequence[str],
    native: Native | None,
    sizes: dict[str, int] | None,
    tolerance: float,
    replay: Replay,
    float32: bool,
) -> str:
    """The report as text."""
    name, selection = layout.name, layout.selection
    rates = sorted({call.gate.every for call in selection.calls})
    lines = [*about, ""]
    step = f"{selection.network.dt:g} {selection.network.time_unit}"
    often = "every block runs at each" if rates == [1] else f"blocks run every {_list(rates)} steps"
    lines.append(f"Steps of {step}; {often}.")
    lines.append("")
    lines += ["Memory"]
    if native is not None:
        lines.append(f"  struct {name}: {native.size} bytes, the arena included")
        lines += _arena(layout, native)
    if sizes is not None:
        what = "Cortex-M4 (arm-none-eabi-gcc -O2)"
        lines.append(f"  {what}: {sizes['text']} bytes of code and constants,")
        lines.append(f"    {sizes['static']} bytes of static data")
    lines += ["", "Largest number of operations of a step"]
    lines += _operations(layout)
    lines += ["", f"Replay of {replay.covered}, tolerance {tolerance:g}"]
    if native is None:
        lines.append("  not run: there is no C compiler on this computer")
    else:
        for port, apart in native.largest.items():
            lines.append(f"  {'.'.join(port)}: {_difference(replay, port, apart, float32)}")
            if not apart <= tolerance:
                lines.append(
                    f"    warning: more than the tolerance, so that {name}_test fails; if it is "
                    "small enough for you, give --tolerance"
                )
    return "\n".join([*lines, *warnings(layout, replay)]) + "\n"


def _arena(layout: Layout, native: Native) -> list[str]:
    """The memory for local arrays: the worst case, or that there is no bound."""
    size = f"  arena: {8 * layout.arena_words} bytes"
    if not layout.units.open:
        return [f"{size}, the worst case of any step, whatever the data"]
    owners = _list(sorted(layout.units.open), "and")
    return [
        f"{size}, {native.arena} used in the recorded run; the worst case is not known,",
        f"    since data decide how much memory {owners} takes: a step that needs more",
        "    is a failure, and leaves the outputs as they are",
    ]


def _difference(replay: Replay, port: Port, apart: float, float32: bool) -> str:
    """A difference from the graph; of float32 with its share of the signal's range."""
    if not float32:
        return f"largest difference {apart:.3g}"
    size = replay.range_of(port)
    return f"largest difference {apart * size:.3g}, which is {apart:.3g} of its range, {size:.3g}"


def warnings(layout: Layout, replay: Replay) -> list[str]:
    """What the recording does not show."""
    names = still(replay, layout.selection.outputs)
    if not names:
        return []
    what = f"{', '.join(names)} {'does' if len(names) == 1 else 'do'} not change"
    return [f"  warning: {what} in the recording, which shows little; record more with --ticks"]


def _list(items: Sequence[object], word: str = "or") -> str:
    texts = list(map(str, items))
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} {word} {texts[-1]}"


def _operations(layout: Layout) -> list[str]:
    counted = operations(layout)
    total = Operations()
    width = max(map(len, (*counted, "together")))
    lines = [f"  {'':{width}}  arithmetic  divisions  functions of math.h"]
    for block, found in counted.items():
        total.add(found)
        lines.append(f"  {block:{width}}  {_row(found)}")
    lines.append(f"  {'together':{width}}  {_row(total)}")
    lines.append("  Every branch counts as taken, and every rate as due.")
    if total.open_loops:
        lines.append(f"  {total.open_loops} loops depend on data; one pass of each is counted.")
    return lines


def _row(found: Operations) -> str:
    numbers = f"{found.arithmetic:10d}  {found.divisions:9d}  {found.functions:9d}"
    return f"{numbers}{'  and loops' if found.open_loops else ''}"
