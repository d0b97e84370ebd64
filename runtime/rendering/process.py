"""Starts the process that draws, with the first OpenGL library that works."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Any

from blocks.core import MissingPackageError, require
from runtime.errors import MissingExtraError, MissingLibraryError, UsageError
from runtime.rendering.motion import recorded_motion
from runtime.rendering.request import RenderRequest

MODULES = ("mujoco", "OpenGL", "imageio_ffmpeg")
CHOICE = "MUJOCO_GL"
MEND = (
    "no OpenGL library draws without a screen here ({tried}); on Debian and Ubuntu: "
    "apt-get install libegl1 libgl1 libgl1-mesa-dri"
)


def render(request: RenderRequest) -> list[Path]:
    """Make a picture and a film of a run, in a process of their own; returns the files.

    Raises
    ------
    UsageError : the run has nothing to draw, or the folder cannot be written.
    MissingExtraError, MissingLibraryError : what drawing needs is not installed.
    """
    libraries = _libraries()
    # Drawing heeds it, in a process of its own; importing mujoco here must not fail over it.
    os.environ.pop(CHOICE, None)
    try:
        for name in MODULES:
            require(name, "runtime render", "render")
    except MissingPackageError as error:
        raise MissingExtraError(error.feature, error.extra) from None
    last = float(recorded_motion(request.run, request.block).t[-1])
    if request.film and request.begin >= min(last, request.end or last):
        raise UsageError(
            f"no film begins at {request.begin:g} s: the run was recorded to {last:g} s"
        )
    tried = []
    for library in libraries:
        answer = _ask(request, library)
        if "files" in answer:
            return [Path(path) for path in answer["files"]]
        tried.append(f"{library or 'default'}: {answer['missing']}")
    raise MissingLibraryError(MEND.format(tried="; ".join(tried)))


def _libraries() -> tuple[str, ...]:
    """Values of MUJOCO_GL to try: the user's, or those that need no screen."""
    chosen = os.environ.get(CHOICE, "")
    if chosen:
        return (chosen,)
    return ("egl", "osmesa") if sys.platform.startswith("linux") else ("",)


def _ask(request: RenderRequest, library: str) -> dict[str, Any]:
    """Let a process draw; what it answers, or what became of it."""
    environment = {key: value for key, value in os.environ.items() if key != "PYOPENGL_PLATFORM"}
    environment[CHOICE] = library
    done = subprocess.run(
        [sys.executable, "-m", "runtime.rendering.worker"],
        input=json.dumps(asdict(request)),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE if not sys.stderr.isatty() else None,
        text=True,
        env=environment,
    )
    if done.returncode < 0:
        return {"missing": f"ended by {signal.Signals(-done.returncode).name}"}
    if done.returncode:
        last = (done.stderr or "").strip().splitlines()[-1:] or ["see above"]
        raise UsageError(f"'{request.run}' cannot be rendered: {last[0]}")
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer
