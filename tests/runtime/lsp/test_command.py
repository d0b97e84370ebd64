"""``runtime lsp``: its options, its port, and what it says without the extra."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import Run
from tests.extras import ROOT


@pytest.mark.parametrize("address", ["x", "70000", "a:b", "host:99999", ":1"])
def test_a_port_has_to_be_one(cli: Run, address: str) -> None:
    result = cli("lsp", "--tcp", address)
    assert result.returncode == 2
    assert "expected a port, as in 7345" in result.stderr


def test_the_two_ways_exclude_each_other(cli: Run) -> None:
    assert cli("lsp", "--tcp", "7345", "--stdio").returncode == 2


def test_it_ends_with_its_input(cli: Run) -> None:
    result = cli("lsp", stdin=subprocess.DEVNULL, timeout=60)
    assert (result.returncode, result.stdout) == (0, "")


@pytest.fixture
def port(script: Path) -> socket.socket:
    """A connection to a server on a port."""
    with subprocess.Popen(
        [str(script), "lsp", "--tcp", "0"], stderr=subprocess.PIPE, text=True
    ) as process:
        assert process.stderr is not None
        line = process.stderr.readline()
        assert line.startswith("listening on 127.0.0.1:")
        with socket.create_connection(("127.0.0.1", int(line.rsplit(":", 1)[1]))) as connection:
            connection.settimeout(60)
            yield connection  # type: ignore[misc]
        process.wait(60)


def message(method: str, number: int) -> bytes:
    parameters = {"capabilities": {}, "processId": None, "rootUri": None}
    content = {"jsonrpc": "2.0", "id": number, "method": method, "params": parameters}
    data = json.dumps(content).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(data), data)


def test_an_editor_connects_to_a_port(port: socket.socket) -> None:
    port.sendall(message("initialize", 1))
    seen = b""
    while b"completionProvider" not in seen:
        seen += port.recv(65536)
    assert seen.startswith(b"Content-Length: ")


def test_an_http_request_is_not_taken_for_an_editor(port: socket.socket) -> None:
    """A web page could otherwise send messages to the port."""
    body = message("initialize", 1)
    port.sendall(b"POST / HTTP/1.1\r\nHost: localhost\r\nContent-Type: text/plain\r\n" + body)
    assert port.recv(65536) == b""


def test_the_extra_is_named_where_it_is_missing(tmp_path: Path) -> None:
    code = "import sys; sys.modules['pygls'] = None; from runtime.cli import main; main(['lsp'])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT)
    assert result.returncode == 4
    assert "pip install -e '.[editor]'" in result.stderr
