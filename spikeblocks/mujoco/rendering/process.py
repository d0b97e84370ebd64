"""Renders a run in a child process, with the first OpenGL library that works."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from runtime.errors import MissingExtraError, MissingLibraryError, UsageError
from runtime.terminal import tell
from spikeblocks.mujoco.rendering.request import RenderRequest

MODULES = ("mujoco", "OpenGL", "imageio_ffmpeg")
CHOICE = "MUJOCO_GL"
NO_LIBRARY = (
    "no OpenGL library can draw without a screen here ({tried}); on Debian and Ubuntu: "
    "apt-get install libegl1 libgl1 libgl1-mesa-dri"
)


def render(request: RenderRequest) -> list[Path]:
    """Make a picture and a film of a run in a child process; returns the files.

    Raises
    ------
    UsageError : the run has nothing to draw, or the folder cannot be written.
    MissingExtraError, MissingLibraryError : a package or library is not installed.
    """
    # Every start of the command line imports this module for the defaults of a request.
    from blocks.core import MissingPackageError, require
    from spikeblocks.mujoco.rendering.motion import recorded_motion

    libraries = _libraries()
    # Only the child process uses it; importing mujoco here must not fail because of it.
    os.environ.pop(CHOICE, None)
    try:
        for name in MODULES:
            require(name, "runtime render", "render")
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None
    last = float(recorded_motion(request.run, request.block).t[-1])
    if request.film and request.begin >= min(last, request.end or last):
        raise UsageError(
            f"the film cannot begin at {request.begin:g} s: the recording ends at {last:g} s"
        )
    tried = []
    for library in libraries:
        answer = _run_worker(request, library)
        if "files" in answer:
            return [Path(path) for path in answer["files"]]
        tried.append(f"{library or 'default'}: {answer['missing']}")
    raise MissingLibraryError(NO_LIBRARY.format(tried="; ".join(tried)))


def _libraries() -> tuple[str, ...]:
    """Values of MUJOCO_GL to try: the user's, or those that do not need a screen."""
    chosen = os.environ.get(CHOICE, "")
    if chosen:
        return (chosen,)
    return ("egl", "osmesa") if sys.platform.startswith("linux") else ("",)


def _run_worker(request: RenderRequest, library: str) -> dict[str, Any]:
    """Run the child process; returns its answer, or the signal that ended it."""
    environment = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"}
    environment[CHOICE] = library
    # A file, since a pipe that nobody reads meanwhile would stop a library that prints much.
    with tempfile.TemporaryFile("w+") as errors:
        with subprocess.Popen(
            [sys.executable, "-m", "spikeblocks.mujoco.rendering.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=None if sys.stderr.isatty() else errors,
            text=True,
            env=environment,
        ) as worker:
            answer = _answer(worker, json.dumps(asdict(request)))
        errors.seek(0)
        last = errors.read().strip().splitlines()[-1:] or ["see above"]
    if worker.returncode < 0:
        return {"missing": f"ended by {signal.Signals(-worker.returncode).name}"}
    if worker.returncode:
        raise UsageError(f"'{request.run}' cannot be rendered: {last[0]}")
    return answer


def _answer(worker: subprocess.Popen[str], request: str) -> dict[str, Any]:
    """What the worker answers; what it notes before is told."""
    answer: dict[str, Any] = {}
    if worker.stdin is None or worker.stdout is None:
        return answer
    with suppress(BrokenPipeError), worker.stdin:
        worker.stdin.write(request)
    for line in worker.stdout:
        answer = json.loads(line)
        if "note" in answer:
            tell(answer["note"])
    return answer
