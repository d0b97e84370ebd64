"""The git commit of the current folder, found without executing the repository's own programs.

In: a folder. Out: "1f0c...", "1f0c...+changes" if files differ from it, or None outside a
repository. Git executes what a repository's configuration names (``core.fsmonitor``, filters,
hooks), and a repository may not be trusted. So the commit is read from the repository's files, and
git is used only to find out whether files differ from it, with an empty configuration.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory, TemporaryFile

from blocks.files import opened

TIMEOUT = 5.0  # s
_HASH = re.compile(r"[0-9a-f]{40}([0-9a-f]{24})?")
MAX_BYTES = 1 << 24  # that are read of a file


def git_commit(folder: Path | None = None) -> str | None:
    """The commit of the repository that a folder is in, with ``+changes`` if files differ.

    None outside a repository.
    """
    try:
        repository = _repository(folder or Path.cwd())
        if repository is None:
            return None
        work, private, common = repository
        commit = _head(private, common)
    except (OSError, ValueError):
        return None
    if commit is None:
        return None
    return commit + ("+changes" if _is_changed(commit, work, private, common) else "")


def _repository(folder: Path) -> tuple[Path, Path, Path] | None:
    """The working tree, its own git folder, and the git folder that all working trees share."""
    for work in (folder, *folder.parents):
        private = work / ".git"
        # A further working tree (git worktree) has a file there: "gitdir:
        # /path/.git/worktrees/name".
        if private.is_file():
            target = _read(private).removeprefix("gitdir:").strip()
            private = work / target
        if (private / "HEAD").is_file():
            pointer = private / "commondir"
            common = private / _read(pointer).strip() if pointer.is_file() else private
            return work, private, common
    return None


def _read(path: Path) -> str:
    with opened(path) as file:
        return file.read(MAX_BYTES).decode("utf-8")


def _head(private: Path, common: Path) -> str | None:
    """The hash that HEAD refers to; None before the first commit."""
    text = _read(private / "HEAD").strip()
    # References can point to references, in a damaged repository in a circle.
    for _ in range(5):
        if not text.startswith("ref:"):
            break
        text = _reference(text.removeprefix("ref:").strip(), private, common)
    return text if _HASH.fullmatch(text) else None


def _reference(name: str, private: Path, common: Path) -> str:
    # A reference comes from a file that is not trusted: it must not lead outside the git folder.
    if ".." in name or name.startswith("/"):
        return ""
    for folder in (private, common):
        if (folder / name).is_file():
            return _read(folder / name).strip()
    packed_refs = common / "packed-refs"
    if packed_refs.is_file():
        for line in _read(packed_refs).splitlines():
            if line.endswith(f" {name}"):
                return line.split()[0]
    return ""


def _is_changed(commit: str, work: Path, private: Path, common: Path) -> bool:
    """Whether tracked files differ from the commit; False if git fails."""
    try:
        with TemporaryDirectory(prefix="spikeblocks-git-") as empty:
            # Hashes of 64 digits are SHA-256, which git reads only if the configuration says so.
            form = "\n[extensions]\n\tobjectFormat = sha256\n" if len(commit) == 64 else ""
            version = "1" if form else "0"
            # A git folder of our own, with an empty configuration, that borrows the other one's
            # index and objects.
            bare = Path(empty)
            (bare / "config").write_text(f"[core]\n\trepositoryformatversion = {version}\n{form}")
            (bare / "HEAD").write_text(f"{commit}\n")
            (bare / "refs").mkdir()
            (bare / "objects").mkdir()
            environment = {
                **{key: text for key, text in os.environ.items() if not key.startswith("GIT_")},
                "GIT_DIR": str(bare),
                "GIT_WORK_TREE": str(work),
                "GIT_INDEX_FILE": str(private / "index"),
                "GIT_OBJECT_DIRECTORY": str(common / "objects"),
                **{"GIT_CONFIG_NOSYSTEM": "1", "GIT_CONFIG_GLOBAL": os.devnull},
                **{"GIT_OPTIONAL_LOCKS": "0", "GIT_TERMINAL_PROMPT": "0"},
                **{"GIT_NO_LAZY_FETCH": "1", "LC_ALL": "C"},
            }
            return bool(_git(environment, work))
    except (OSError, subprocess.SubprocessError):
        return False


def _git(environment: dict[str, str], work: Path) -> bytes:
    """The output of ``git status``; git and its children are killed after a timeout."""
    # Submodules are ignored: each is a repository with its own configuration.
    arguments = ("status", "--porcelain", "--untracked-files=no", "--ignore-submodules=all")
    with TemporaryFile() as answer:
        process = subprocess.Popen(
            ["git", *arguments],
            stdin=subprocess.DEVNULL,
            stdout=answer,
            stderr=subprocess.DEVNULL,
            env=environment,
            cwd=work,
            start_new_session=True,
        )
        try:
            code = process.wait(TIMEOUT)
        finally:
            if process.poll() is None:
                with suppress(OSError):
                    _kill(process)
                process.wait(TIMEOUT)
        answer.seek(0)
        return answer.read() if code == 0 else b""


def _kill(process: subprocess.Popen[bytes]) -> None:
    """End a process, and its children where a system has groups of processes."""
    if sys.platform != "win32" and hasattr(os, "killpg"):
        os.killpg(process.pid, signal.SIGKILL)
    else:
        process.kill()
