"""``runtime lsp``: its options, its port, and what it says without the extra."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from pathlib import Path
from typing import IO, Any

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


def message(method: str, number: int | None = None, parameters: Any = None) -> bytes:
    if method == "initialize":
        parameters = {"capabilities": {}, "processId": None, "rootUri": None}
    fields = {"id": number, "method": method, "params": parameters}
    given = {name: value for name, value in fields.items() if value is not None}
    data = json.dumps({"jsonrpc": "2.0", **given}).encode()
    return b"Content-Length: %d\r\n\r\n%s" % (len(data), data)


def opened(text: str) -> bytes:
    document = {"uri": "file:///tmp/t.yaml", "languageId": "yaml", "version": 1, "text": text}
    return message("textDocument/didOpen", None, {"textDocument": document})


def asked(method: str, number: int, **more: Any) -> bytes:
    place = {"textDocument": {"uri": "file:///tmp/t.yaml"}, "position": {"line": 1, "character": 9}}
    return message(f"textDocument/{method}", number, {**place, **more})


def session(script: Path, *messages: bytes) -> tuple[int, dict[int, Any], list[Any], str]:
    """One session: exit code, answers by number, published diagnostics, and stderr."""
    end = (message("shutdown", 99), message("exit"))
    sent = b"".join((message("initialize", 0), message("initialized", None, {}), *messages))
    with subprocess.Popen([str(script), "lsp"], stdin=-1, stdout=-1, stderr=-1) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        assert process.stderr is not None
        answers, published = {}, []
        process.stdin.write(sent)
        process.stdin.flush()
        while (not published and b"didOpen" in sent) or 0 not in answers:
            _receive(process.stdout, answers, published)
        process.stdin.write(b"".join(end))
        process.stdin.flush()
        while 99 not in answers:
            _receive(process.stdout, answers, published)
        assert process.stdout.read() == b""
        return process.wait(60), answers, published, process.stderr.read().decode()


def _receive(stream: IO[bytes], answers: dict[int, Any], published: list[Any]) -> None:
    length = 0
    while (header := stream.readline()) != b"\r\n":
        assert header, "the server has ended"
        name, _, value = header.partition(b":")
        length = int(value) if name == b"Content-Length" else length
    content = json.loads(stream.read(length))
    if content.get("method") == "textDocument/publishDiagnostics":
        published.append(content["params"]["diagnostics"])
    elif "id" in content:
        answers[content["id"]] = content.get("result", content.get("error"))


TEXT = "graph: g\nblocks: {a: {type: Constant, value: 1}, b: {type: Constant, value: 2}}\n"


@pytest.mark.slow
def test_a_session_ends_as_the_editor_asks(script: Path) -> None:
    code, _, published, errors = session(script, opened(TEXT))
    assert (code, published, errors) == (0, [[]], "")


@pytest.mark.slow
def test_a_session_over_a_port_ends_as_the_editor_asks(port: socket.socket) -> None:
    port.sendall(message("initialize", 1) + message("shutdown", 2) + message("exit"))
    with port.makefile("rb") as stream:
        assert b"completionProvider" in stream.read()


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("no name", "'no name' is not a name for a block; use letters, digits and _"),
        ("b", "there is a block 'b' already"),
    ],
)
@pytest.mark.slow
def test_a_refused_rename_is_an_answer_and_nothing_else(
    script: Path, name: str, reason: str
) -> None:
    refused = asked("rename", 1, newName=name)
    code, answers, _, errors = session(script, opened(TEXT), refused)
    assert (code, errors) == (0, "")
    assert answers[1] == {"code": -32602, "message": reason}


@pytest.mark.slow
def test_a_text_that_is_too_large_to_be_checked_blocks_nothing(script: Path) -> None:
    lines = (f"  b{i}: {{type: Constant, value: {i}, typo: 1}}" for i in range(45_000))
    text = "graph: g\nblocks:\n" + "\n".join(lines) + "\n"
    assert len(text) > 2_000_000
    requests = (
        asked("completion", 1),
        asked("references", 2, context={"includeDeclaration": True}),
    )
    code, answers, published, errors = session(script, opened(text), *requests)
    assert (code, errors) == (0, "")
    # Checking would find a thousand problems.
    assert [found["message"].partition(",")[0] for found in published[0]] == [
        "nothing in this file is checked or completed here"
    ]
    assert published[0][0]["severity"] == 2
    assert (answers[1]["items"], answers[2]) == ([], [])


@pytest.mark.slow
def test_an_editor_connects_to_a_port(port: socket.socket) -> None:
    port.sendall(message("initialize", 1))
    seen = b""
    while b"completionProvider" not in seen:
        seen += port.recv(65536)
    assert seen.startswith(b"Content-Length: ")


@pytest.mark.slow
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
