"""Neovim without a screen: a graph is opened, a wire completed, a block renamed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

NVIM = shutil.which("nvim")
SCRIPT = Path(__file__).with_name("neovim.lua")
GRAPH = """graph: small
blocks:
  a: {type: Constant, value: 1.0}
  b: {type: Gain, gian: 2.0}   # 🙂
wires:
  b: {input: a.value}
probes:
  p: b.out
"""


@pytest.mark.skipif(NVIM is None, reason="nvim is not installed")
def test_neovim_shows_problems_completes_and_renames(tmp_path: Path) -> None:
    (tmp_path / "small.yaml").write_text(GRAPH, encoding="utf-8")
    result = tmp_path / "result.json"
    server = [str(Path(sys.executable).parent / "runtime"), "lsp"]
    environment = {
        **os.environ,
        "SERVER": json.dumps(server),
        "GRAPH": str(tmp_path / "small.yaml"),
        "RESULT": str(result),
        "HOME": str(tmp_path),
        "XDG_STATE_HOME": str(tmp_path),
        "XDG_CACHE_HOME": str(tmp_path),
    }
    command = [str(NVIM), "--headless", "--clean", "-n", "-c", f"luafile {SCRIPT}"]
    done = subprocess.run(
        command, env=environment, capture_output=True, text=True, timeout=300, check=False
    )
    assert result.exists(), done.stderr
    seen = json.loads(result.read_text(encoding="utf-8"))
    assert "error" not in seen, seen
    assert any("did you mean 'gain'?" in message for message in seen["diagnostics"])
    assert seen["labels"][0] == "a.value"
    expected = GRAPH.replace("  b:", "  twice:").replace("b.out", "twice.out")
    assert "\n".join(seen["lines"]) + "\n" == expected
