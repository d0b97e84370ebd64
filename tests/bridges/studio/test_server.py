"""The server: who may connect, what is served, what is done, and what survives a kill."""

from __future__ import annotations

import http.client
import json
import os
import random
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.bridges.studio.frames import GRAPHS, Kept
from tests.bridges.studio.test_worker import SMALL
from tests.conftest import Run

pytest.importorskip("starlette", reason="the extra studio is not installed")
websockets = pytest.importorskip("websockets", reason="the extra studio is not installed")
from websockets.sync.client import connect  # noqa: E402

PATIENCE = 60.0


class Client:
    """A page without a browser."""

    def __init__(self, port: int, token: str, origin: str = "") -> None:
        origin = origin or f"http://127.0.0.1:{port}"
        self.stack = ExitStack()
        address = f"ws://127.0.0.1:{port}/socket"
        self.socket = self.stack.enter_context(connect(address, origin=origin, max_size=2**28))
        self.page = Kept()
        self.socket.send(json.dumps({"token": token}))
        self.do("hello")

    def do(self, what: str, **values: Any) -> None:
        self.socket.send(json.dumps({"do": what, **values}))

    def read(self) -> tuple[str, Any]:
        data = self.socket.recv(timeout=PATIENCE)
        if isinstance(data, bytes):
            self.page.take("frame", data)
            return "frame", self.page.head
        message = json.loads(data)
        self.page.take(message["kind"], message)
        return message["kind"], message

    def until(self, kind: str, test: Callable[[Any], bool] = lambda _: True) -> Any:
        while True:
            found, values = self.read()
            if found == kind and test(values):
                return values

    def come_to(self, tick: int) -> None:
        self.until("frame", lambda head: head["tick"] == tick)


class Studio:
    """A studio in a process."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        found = re.search(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)", process.stdout.readline())
        assert found is not None
        self.process, self.port, self.token = process, int(found[1]), found[2]

    def client(self) -> Client:
        return Client(self.port, self.token)

    def get(self, path: str, host: str = "") -> tuple[int, dict[str, str], bytes]:
        with closing(http.client.HTTPConnection("127.0.0.1", self.port, timeout=PATIENCE)) as asked:
            asked.putrequest("GET", path, skip_host=True)
            asked.putheader("Host", host or f"127.0.0.1:{self.port}")
            asked.endheaders()
            answer = asked.getresponse()
            return answer.status, {k.lower(): v for k, v in answer.getheaders()}, answer.read()


@contextmanager
def studio(folder: Path, *words: str) -> Iterator[Studio]:
    command = "from runtime.cli import main; main()"
    with subprocess.Popen(
        [sys.executable, "-c", command, "studio", *words, "--no-browser"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(GRAPHS.parent)},
    ) as process:
        try:
            yield Studio(process)
        finally:
            process.terminate()


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Studio, Path]]:
    """A studio of a small graph in a folder."""
    folder = tmp_path_factory.mktemp("studio")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    (folder / "secret.txt").write_text("not for you", encoding="utf-8")
    with studio(folder, "small.yaml") as made:
        yield made, folder


@pytest.fixture
def client(small: tuple[Studio, Path]) -> Iterator[Client]:
    """The page that writes, with the small graph as it is in its file, at the beginning."""
    made = small[0].client()
    made.do("take_over")
    made.do("text", text=SMALL)
    made.do("begin", seed=3)
    made.until("views", lambda views: views["cause"] == "began" and views["seed"] == 3)
    yield made
    made.stack.close()


@pytest.mark.parametrize("words", [("--port", "70000"), ("nothing.yaml",), ("--port", "x")])
def test_what_cannot_be_served_is_a_sentence(cli: Run, words: tuple[str, ...]) -> None:
    result = cli("studio", "--no-browser", *words)
    assert result.returncode == 2 and "Traceback" not in result.stderr


def test_only_the_files_of_the_page_are_served(small: tuple[Studio, Path]) -> None:
    made, _ = small
    status, headers, body = made.get("/")
    assert status == 200 and b"<!doctype html>" in body
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy and "script-src 'self';" in policy
    assert "unsafe" not in policy and "frame-ancestors 'none'" in policy
    assert made.get("/studio.js")[0] == 200
    for path in (
        *("/secret.txt", "/small.yaml", "/../secret.txt", "/%2e%2e/worker.py", "/..%2fworker.py"),
        *(
            "/codemirror.LICENSE",
            "/static/x.js",
            "//etc/passwd",
            "/..%5cworker.py",
            "/page/studio.js",
        ),
    ):
        assert made.get(path)[0] == 404, path
    # A name that leads to this machine, of a page of somebody else.
    assert made.get("/", host="evil.example")[0] == 400


def test_who_may_connect(small: tuple[Studio, Path]) -> None:
    made, _ = small
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{made.port}"):
        with pytest.raises(websockets.exceptions.InvalidStatus):
            Client(made.port, made.token, origin)
    for token in ("", "x", made.token[:-1], "ü", None):
        with pytest.raises(websockets.exceptions.ConnectionClosed) as closed:
            Client(made.port, token).read()  # type: ignore[arg-type]
        assert closed.value.rcvd is not None and closed.value.rcvd.code == 4401


def test_it_runs_steps_and_goes_back(client: Client) -> None:
    client.do("step", ticks=200)
    client.come_to(200)
    first = client.page.rows["x"].copy()
    client.do("goto", tick=50)
    client.until("frame", lambda head: head["tick"] == 50)
    client.do("play", speed=0)
    client.until("frame", lambda head: head["tick"] == 500)
    assert np.array_equal(client.page.rows["x"][:200], first)


def test_an_edit_is_followed_and_a_wrong_text_is_not(client: Client) -> None:
    client.do("step", ticks=100)
    client.come_to(100)
    client.do("text", text=SMALL.replace("gain: 2.0", "gain: 2.5"))
    assert client.until("text")["valid"]
    assert client.until("became")["numbers"] == ["blocks.g.gain"]
    client.do("text", text=SMALL.replace("gain: 2.0", "gian: 2.5"))
    told = client.until("text")
    assert not told["valid"] and "did you mean 'gain'" in told["problems"][0]["text"]
    assert told["problems"][0]["fixes"][0]["title"] == "Replace by 'gain'"
    client.do("step", ticks=10)
    client.come_to(110)


def test_clicks_are_edits_of_the_text(client: Client) -> None:
    client.do("block", name="n")
    block = client.until("block")["block"]
    assert block["actions"]["without"] == "" and block["type"] == "WhiteNoise"
    client.do("act", action="without", block="n")
    assert "without: [n]\n" in client.until("text", lambda m: m["cause"] == "click")["text"]
    client.do("act", action="restore", block="n")
    assert client.until("text", lambda m: m["cause"] == "click")["text"] == SMALL
    client.do("block", name="u")
    assert "g.input" in client.until("block")["block"]["actions"]["without"]
    client.do("act", action="without", block="u")
    assert "g.input" in client.until("wrong")["text"]
    client.do("replacements", name="g")
    assert "Derivative" in client.until("replacements")["types"]
    client.do("number", path="blocks.g.gain", value=3.5)
    assert "g: {type: Gain, gain: 3.5}" in client.until("text")["text"]


def test_a_slider_acts_at_once_and_is_written_when_released(client: Client) -> None:
    client.do("set", path="blocks.g.gain", value=4.0)
    client.do("step", ticks=20)
    client.come_to(20)
    gains = client.page.rows["s"][:, 0]
    client.do("number", path="blocks.g.gain", value=4.0)
    assert "gain: 4.0" in client.until("text")["text"]
    client.do("begin", seed=3)
    client.until("views", lambda views: views["cause"] == "began")
    client.do("step", ticks=20)
    client.come_to(20)
    assert np.array_equal(client.page.rows["s"][:, 0], gains)


def test_two_pages_one_writes(small: tuple[Studio, Path], client: Client) -> None:
    other = small[0].client()
    assert other.until("role")["writes"] is False
    other.do("step", ticks=5)
    assert "another page" in other.until("wrong")["text"]
    other.do("take_over")
    other.until("role", lambda role: role["writes"])
    assert client.until("role")["writes"] is False
    other.do("step", ticks=5)
    other.come_to(5)
    client.come_to(5)
    other.stack.close()


def test_it_completes_and_explains(client: Client) -> None:
    client.do("complete", offset=SMALL.index("u.out") + 2, ask=1)
    found = client.until("answer", lambda m: m["ask"] == 1)["found"]
    assert any(offer["label"].endswith("out") for offer in found["offers"])
    client.do("hover", offset=SMALL.index("Gain") + 1, ask=2)
    assert "Gain" in client.until("answer", lambda m: m["ask"] == 2)["found"]["text"]


def test_saving_and_an_edit_from_outside(small: tuple[Studio, Path], client: Client) -> None:
    _, folder = small
    text = SMALL.replace("gain: 2.0", "gain: 2.25")
    client.do("text", text=text)
    client.until("text")
    client.do("save")
    assert client.until("stored")["name"] == "small.yaml"
    assert (folder / "small.yaml").read_text(encoding="utf-8") == text
    client.do("step", ticks=30)
    client.do("save_session")
    saved = Path(client.until("saved")["folder"])
    assert saved.parent == folder / "sessions" and (saved / "log.jsonl").is_file()
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    assert client.until("text", lambda m: m["cause"] == "outside")["text"] == SMALL


def test_a_killed_session_comes_back(small: tuple[Studio, Path], client: Client) -> None:
    client.do("step", ticks=60)
    client.do("set", path="blocks.n.density", value=0.3)
    client.do("step", ticks=60)
    client.come_to(120)
    before = client.page.rows["x"].copy()
    parent = small[0].process.pid
    children = Path(f"/proc/{parent}/task/{parent}/children")
    if not children.is_file():
        pytest.skip("processes are found in /proc, which this system does not have")
    named = {int(pid): Path(f"/proc/{pid}/cmdline") for pid in children.read_text().split()}
    pids = [pid for pid, line in named.items() if "spawn_main" in line.read_text()]
    for pid in pids:
        os.kill(pid, 9)
    assert pids
    client.until("ended")
    client.do("revive")
    client.until("views", lambda views: views["cause"] == "began")
    client.come_to(120)
    assert np.array_equal(client.page.rows["x"], before)


def test_fuzzed_messages_leave_it_standing(small: tuple[Studio, Path], client: Client) -> None:
    chance = random.Random(1)
    values: list[Any] = [None, -1, 1e308, "", "x" * 50, [], {}, [1e3], True, "blocks.g.gain", "u"]
    names = ["text", "set", "write", "play", "step", "goto", "begin", "act", "number", "watch"]
    names += ["block", "replacements", "complete", "hover", "open", "picture", "nothing", "handle"]
    keys = ["text", "path", "value", "port", "speed", "ticks", "tick", "seed", "action", "block"]
    keys += ["addresses", "name", "offset", "ask"]
    for _ in range(300):
        given = {chance.choice(keys): chance.choice(values) for _ in range(chance.randint(0, 3))}
        client.do(chance.choice(names), **given)
    for raw in ("", "[", "[]", "1", '"x"', '{"do": ["text"]}', "{" * 5000):
        client.socket.send(raw)
    client.do("text", text=SMALL)
    client.do("begin", seed=5)
    client.until("views", lambda views: views["cause"] == "began" and views["seed"] == 5)
    client.do("step", ticks=7)
    client.come_to(7)


def test_python_files_ask_first(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(
        "from pathlib import Path\nfrom blocks import Gain\n"
        "Path(__file__).with_suffix('.ran').touch()\nclass Mine(Gain):\n    '''A gain.'''\n",
        encoding="utf-8",
    )
    text = SMALL.replace("{type: Gain,", "{type: Mine, module: own.py,")
    (tmp_path / "g.yaml").write_text(text, encoding="utf-8")
    with studio(tmp_path, "g.yaml") as made:
        client = made.client()
        asked = client.until("text")["trust"]
        assert [Path(name).name for name in asked] == ["own.py"]
        client.do("step", ticks=3)
        client.do("block", name="u")
        client.until("block")
        assert not (tmp_path / "own.ran").exists()
        client.do("trust")
        client.until("views")
        assert (tmp_path / "own.ran").exists()
        client.do("step", ticks=3)
        client.come_to(3)


@pytest.mark.slow
def test_the_choice_of_a_graph_and_every_shipped_one(tmp_path: Path) -> None:
    with studio(tmp_path) as made:
        client = made.client()
        graphs = client.until("gallery")["graphs"]
        assert graphs[0]["name"].startswith("starters/") and len(graphs) > 100
        client.do("picture", name=graphs[0]["name"])
        assert client.until("picture")["svg"].startswith("<svg")
        for graph in graphs:
            client.do("open", name=graph["name"])
            client.until("text", lambda m: m["cause"] == "opened")
            views = client.until("views", lambda views: views["cause"] == "began")
            ticks = min(50, views["ticks"])
            client.do("step", ticks=ticks)
            client.come_to(ticks)
            assert not client.page.all("failed") and not client.page.all("wrong"), graph["name"]
        client.do("save")
        client.until("stored")
        assert (tmp_path / Path(graphs[-1]["name"]).with_suffix(".yaml").name).is_file()
