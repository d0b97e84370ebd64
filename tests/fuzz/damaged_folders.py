"""Damaged folders of runs, sweeps and ablations are read or refused in a sentence."""

from __future__ import annotations

import csv
import io
import json
import os
import shutil
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from hypothesis import strategies as st

from tests.fuzz.campaign import Record, campaign
from tests.fuzz.known import KNOWN
from tests.fuzz.mutation import entries, mutate_bytes, mutate_text, mutate_tree
from tests.fuzz.workspace import assert_answered, call, fresh, made, spawn

TITLE = "Damaged run, sweep and ablation folders"
WHAT = (
    "Files of a folder are cut off, overwritten, emptied, deleted, exchanged, given values of "
    "other types, or replaced by folders and links; then a verb reads the folder: report, "
    "compare, render, validate, sweep --resume or ablate --resume."
)
HOLDS = (
    "Each verb ends with an allowed exit code and a sentence, never a traceback; what --json "
    "prints is JSON; and nothing outside of the folder changes."
)
RUN, SWEEP, ABLATION = "runs/tiny/a", "sweeps/tiny", "ablations/tiny"
VERBS: tuple[tuple[str, tuple[str, ...]], ...] = (
    (RUN, ("report", RUN, "--json")),
    (RUN, ("report", RUN, "-o", "-")),
    (RUN, ("compare", RUN, "runs/tiny/b", "--json", "--no-plots")),
    (RUN, ("compare", "runs/tiny/b", RUN, "--exact", "--no-plots")),
    (RUN, ("validate", f"{RUN}/graph.resolved.yaml", "--json")),
    (SWEEP, ("report", SWEEP, "--json")),
    (ABLATION, ("report", ABLATION, "--json")),
)
# These run as processes: they start workers, or a renderer.
RESUMING: tuple[tuple[str, tuple[str, ...]], ...] = (
    (SWEEP, ("sweep", "exp.yaml", "--resume", "--keep", "all", "-j", "1", "--no-plots")),
    (ABLATION, ("ablate", "exp.yaml", "--resume", "-j", "1", "--no-plots")),
    (RUN, ("render", RUN, "--json")),
)
WRITTEN = "report.html"
OUTSIDE = "outside.txt"
UNTOUCHED = "nobody may write here\n"


@dataclass(frozen=True)
class Damage:
    """What is done to one file: new content, another file's content, a link, or nothing left."""

    file: str
    how: str
    content: bytes = b""
    other: str = ""


@dataclass(frozen=True)
class Case:
    """Damages to a folder, and the command that reads it then."""

    damages: tuple[Damage, ...]
    command: tuple[str, ...]
    real: bool


@cache
def files(folder: str) -> tuple[str, ...]:
    """The files of a folder that are read back, by their names in the working folder."""
    found = (path for path in (made() / folder).rglob("*") if path.is_file())
    names = (str(path.relative_to(made())) for path in found)
    return tuple(sorted(name for name in names if not name.endswith((".png", ".lock"))))


@st.composite
def damages(draw: st.DrawFn, folder: str) -> Damage:
    """One damage."""
    names = files(folder)
    if "links" not in KNOWN and draw(st.integers(0, 9)) == 0:
        return Damage(f"{folder}/{WRITTEN}", "link out")
    top = [name for name in names if name.count("/") <= folder.count("/") + 1]
    name = draw(st.one_of(st.sampled_from(top), st.sampled_from(names)))
    data = (made() / name).read_bytes()
    ways = ["bytes", "delete", "exchange", "folder", "unreadable name"]
    ways += ["values"] * 4 if name.endswith((".json", ".csv")) else []
    ways += ["text"] * 2 if not name.endswith(".npz") else []
    ways += [] if "links" in KNOWN else ["link out", "link to itself", "dangling link"]
    how = draw(st.sampled_from(ways))
    other = draw(st.sampled_from(names)) if how == "exchange" else ""
    if how == "bytes":
        data = mutate_bytes(draw, data)
    elif how == "text":
        data = mutate_text(draw, data.decode()).encode("utf-8", "surrogatepass")
    elif how == "values":
        data = _other_values(draw, name, data)
    else:
        data = b""
    return Damage(name, how, data, other)


def _other_values(draw: st.DrawFn, name: str, data: bytes) -> bytes:
    """JSON or CSV that can be read, with values that nobody expects."""
    if name.endswith(".json"):
        tree = json.loads(data)
        keys = sorted({str(path[-1]) for path in entries(tree)}) or [""]
        return json.dumps(mutate_tree(draw, tree, keys, keys)).encode()
    rows = list(csv.reader(io.StringIO(data.decode())))
    cells = sorted({cell for row in rows for cell in row})
    rows = mutate_tree(draw, rows, cells, cells)
    out = io.StringIO()
    writer = csv.writer(out)
    for row in rows:
        writer.writerow(row if isinstance(row, list) else [row])
    return out.getvalue().encode("utf-8", "surrogatepass")


@st.composite
def _cases(draw: st.DrawFn, verbs: tuple[tuple[str, tuple[str, ...]], ...], real: bool) -> Case:
    folder, command = draw(st.sampled_from(verbs))
    done = draw(st.lists(damages(folder), min_size=1, max_size=2))
    return Case(tuple(done), command, real)


def quick_cases() -> st.SearchStrategy[Case]:
    """Damages that are read in this process."""
    return _cases(VERBS, False)


def cases() -> st.SearchStrategy[Case]:
    """All damages; one in twenty is read by a process of its own."""
    slow = _cases(RESUMING, True)
    return st.integers(1, 20).flatmap(lambda i: slow if i == 20 else quick_cases())


def inflict(damage: Damage) -> None:
    """Do what the damage says, in the working folder."""
    path = Path(damage.file)
    if damage.how != "link out" and not path.is_file():
        return  # an earlier damage took its folder
    if damage.how == "exchange":
        other = Path(damage.other)
        if other.is_file():
            mine = path.read_bytes()
            path.write_bytes(other.read_bytes())
            other.write_bytes(mine)
        return
    path.unlink(missing_ok=True)
    if not path.parent.is_dir():
        return
    if damage.how in ("bytes", "text", "values"):
        path.write_bytes(damage.content)
    elif damage.how == "folder":
        path.mkdir()
    elif damage.how == "unreadable name":
        Path(os.fsdecode(os.fsencode(path) + b"\xff")).touch()
    elif damage.how == "link out":
        path.symlink_to(Path(OUTSIDE).resolve())
    elif damage.how == "link to itself":
        path.symlink_to(path.name)
    elif damage.how == "dangling link":
        path.symlink_to("nowhere")


def check(case: Case) -> str:
    """Damage a folder and read it; returns the command's exit code."""
    with fresh():
        Path(OUTSIDE).write_text(UNTOUCHED)
        for damage in case.damages:
            inflict(damage)
        if case.real and case.command[0] == "sweep":
            _tell_unfinished()
        answer = spawn(case.command) if case.real else call(case.command)
        assert Path(OUTSIDE).read_text() == UNTOUCHED, "a file outside of the folder was written"
    assert_answered(answer, case.command)
    return f"exit code {answer.code}"


def _tell_unfinished() -> None:
    """Take one of the trials' folders away: there is something left to look at."""
    trials = sorted(Path(SWEEP, "trials").glob("*"))
    for trial in trials[-1:]:
        if trial.is_dir() and not trial.is_symlink():
            shutil.rmtree(trial)


def run(examples: int, seed: int) -> Record:
    """Try damages."""
    made()
    return campaign("damaged_folders", cases(), check, examples, seed)


def run_quick(examples: int, seed: int) -> Record:
    """Try damages that are read in this process."""
    made()
    return campaign("damaged_folders", quick_cases(), check, examples, seed)
