"""Runs the README's first line with the wheel of a folder, in a new environment elsewhere.

    python .ci/quickstart.py dist

Ends with an error if a command fails, the robot does not settle, or the wheel is not what ran.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import venv
from pathlib import Path


def main() -> None:
    (wheel,) = Path(sys.argv[1]).resolve().glob("*.whl")
    with tempfile.TemporaryDirectory() as folder:
        venv.create(f"{folder}/env", with_pip=True)
        programs = Path(folder, "env", "Scripts" if os.name == "nt" else "bin")
        variables = {n: v for n, v in os.environ.items() if n not in ("PYTHONPATH", "VIRTUAL_ENV")}

        def run(program: str, *arguments: str) -> str:
            print("+", program, *arguments, flush=True)
            command = [programs / program, *arguments]
            return subprocess.check_output(command, cwd=folder, env=variables, text=True)

        run("python", "-m", "pip", "install", "--quiet", str(wheel))
        where = "import spikeblocks as s; print(s.__version__, s.__file__)"
        version, _, file = run("python", "-c", where).strip().partition(" ")
        assert wheel.name.startswith(f"spikeblocks-{version}-"), (wheel.name, version)
        assert Path(file).is_relative_to(Path(folder).resolve() / "env"), file
        assert run("runtime", "--version").split() == ["spikeblocks", version]
        run("runtime", "new", "my.yaml")
        run("runtime", "draw", "my.yaml")
        run("runtime", "run", "starters/adaptive", "--vs", "without=adaptive")
        summary = json.loads(run("runtime", "run", "my.yaml", "--json"))
        assert summary["metrics"]["settled_at"] is not None, summary
    print(f"{wheel.name} runs under Python {sys.version.split()[0]}")


if __name__ == "__main__":
    main()
