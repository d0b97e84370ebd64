"""Press Ctrl-C twice at random moments of real commands.

Every example runs a verb in a process group of its own, as a shell does, and sends the whole group
SIGINT at a random moment and once more shortly afterwards: the second one meets the command while
it ends its workers and writes what was recorded.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from tests.fuzz.campaign import Record, cpu_seconds
from tests.fuzz.kill_workers import GRAPH, MODULE

TITLE = "Ctrl-C twice"
WHAT = (
    "Runs, sweeps, ablations and tunings are sent SIGINT at a random moment of their first two "
    "seconds, together with their workers, and again within 0.3 s."
)
HOLDS = (
    "Each ends within a minute with exit code 130 (or 0, if it was faster), without a traceback, "
    "and leaves no process behind. What Python itself prints while it starts is not counted."
)
MANY = ("-j", "2", "--no-plots", "-q")
COMMANDS = (
    ("run", "noise.yaml", "--until", "2000"),
    ("sweep", "noise.yaml", "--vary", "noise.level=0..1:200", *MANY),
    ("ablate", "noise.yaml", "--without", "spare", "--seeds", "0..99", *MANY),
    ("tune", "noise.yaml", "--vary", "noise.level=0..1", "--minimize", "first", *MANY),
)
SPARE = "  spare: {type: Constant, value: 1.0}\n"
PATIENCE = 60.0  # s; a command that takes longer hangs


def run(examples: int, seed: int) -> Record:
    """Interrupt commands twice; whatever does not end properly is a failure."""
    started = cpu_seconds()
    outcomes: Counter[str] = Counter()
    failures: list[str] = []
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        (folder / "own.py").write_text(MODULE)
        (folder / "noise.yaml").write_text(GRAPH.replace("probes:", SPARE + "probes:"))
        for number in range(examples):
            moments = random.Random(f"{seed}.{number}")
            command = COMMANDS[number % len(COMMANDS)]
            outcome, fault = interrupted(folder, command, moments)
            outcomes[f"{command[0]}: {outcome}"] += 1
            if fault:
                failures.append(f"example {number}: runtime {' '.join(command)}: {fault}")
    return Record(
        "interrupts", examples, seed, dict(outcomes), tuple(failures), cpu_seconds() - started
    )


def interrupted(folder: Path, command: tuple[str, ...], moments: random.Random) -> tuple[str, str]:
    """Run one command and interrupt it; returns how it ended, and what was wrong, if anything."""
    first, second = moments.uniform(0.0, 2.0), moments.uniform(0.0, 0.3)
    script = Path(sys.executable).parent / "runtime"
    with (
        tempfile.TemporaryFile() as output,
        subprocess.Popen(
            [script, *command], cwd=folder, stdout=output, stderr=output, start_new_session=True
        ) as process,
    ):
        for pause in (first, second):
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(pause)
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGINT)
        try:
            process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs", f"did not end (SIGINT after {first:.3f} and {second:.3f} s)"
        output.seek(0)
        text = output.read().decode()
    after = f" (SIGINT after {first:.3f} and {second:.3f} s)"
    if left := remaining(process.pid):
        os.killpg(process.pid, signal.SIGKILL)
        return "processes remain", f"{left} processes remain{after}"
    is_early = "init_import_site" in text or "from spikeblocks_command import main" in text
    if is_early or (process.returncode == -signal.SIGINT and not text):
        return "before Python had started", ""  # no line of ours had run
    if process.returncode not in (0, 130):
        return "other exit code", f"exit code {process.returncode}{after}: {text}"
    if "Traceback" in text or "Exception ignored" in text:
        return "traceback", f"{text}{after}"
    return f"exit code {process.returncode}", ""


def remaining(group: int) -> int:
    """How many processes of a group are left; those that are ending have five seconds."""
    end = time.monotonic() + 5.0
    while members := sum(1 for entry in Path("/proc").iterdir() if _group(entry) == group):
        if time.monotonic() > end:
            return members
        time.sleep(0.05)
    return 0


def _group(entry: Path) -> int:
    """The process group of an entry of /proc; 0 where it is no living process."""
    with contextlib.suppress(OSError, IndexError):
        fields = (entry / "stat").read_text().rpartition(")")[2].split()
        return 0 if fields[0] == "Z" else int(fields[2])
    return 0
