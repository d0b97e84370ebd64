"""A real browser without a window, where one is installed."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
    *("--allow-file-access-from-files", "--enable-logging=stderr"),
)
MEASURE = """<!doctype html><meta charset="utf-8"><title>measuring</title>
<iframe src="{page}" style="width: {width}px; height: 900px; border: 0"></iframe>
<pre></pre>
<script>
document.querySelector("iframe").addEventListener("load", (event) => {{
  const root = event.target.contentDocument.documentElement;
  const wide = [...root.querySelectorAll("body *")].filter(
    (e) => !e.closest(".scroll") && e.getBoundingClientRect().right > {width} + 0.5
  );
  const said = {{width: root.scrollWidth, wide: wide.map((e) => e.outerHTML.slice(0, 80))}};
  document.querySelector("pre").textContent = JSON.stringify(said);
}});
</script>
"""


@dataclass(frozen=True)
class Loaded:
    """A page as a browser built it, and what it wrote to its console."""

    html: str
    console: list[str]


def browser() -> str:
    """The path of a browser; skips the test where there is none."""
    found = next(filter(None, map(shutil.which, NAMES)), None)
    if found is None:
        pytest.skip(f"no browser is installed; looked for {', '.join(NAMES)}")
    return found


@cache
def load(page: Path) -> Loaded:
    """Load a page, once for all tests, and return its document once it stands."""
    with tempfile.TemporaryDirectory() as profile:
        command = [browser(), *FLAGS, f"--user-data-dir={profile}", "--dump-dom", page.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    console = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    return Loaded(done.stdout, console)


class Driven:
    """A browser that is driven through its debugging pipe, with input as hands give it."""

    def __init__(self, page: Path, width: int, height: int) -> None:
        self.number = 0
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        given, self.writing = os.pipe()
        self.reading, taken = os.pipe()
        options = [f"--window-size={width},{height}", f"--user-data-dir={self.profile.name}"]

        def connect() -> None:
            # The browser reads commands from descriptor 3, and writes to 4.
            inside = os.dup(taken)
            os.dup2(given, 3)
            os.dup2(inside, 4)

        self.process = subprocess.Popen(
            [browser(), *FLAGS, *options, "--remote-debugging-pipe", "about:blank"],
            preexec_fn=connect,
            close_fds=True,
            pass_fds=(3, 4),
            stderr=subprocess.DEVNULL,
        )
        os.close(given)
        os.close(taken)
        self.session: str | None = None
        self.rest = b""
        made = self.call("Target.createTarget", {"url": "about:blank"})
        target = {"targetId": made["targetId"], "flatten": True}
        self.session = self.call("Target.attachToTarget", target)["sessionId"]
        self.call("Page.navigate", {"url": page.as_uri()})

    def call(self, method: str, parameters: dict[str, Any]) -> Any:
        """Call a method of the debugging protocol, and wait for its result."""
        self.number += 1
        said: dict[str, Any] = {"id": self.number, "method": method, "params": parameters}
        said |= {"sessionId": self.session} if self.session else {}
        os.write(self.writing, json.dumps(said).encode() + b"\0")
        while True:
            while b"\0" not in self.rest:
                block = os.read(self.reading, 1 << 16)
                assert block, "the browser has ended"
                self.rest += block
            text, self.rest = self.rest.split(b"\0", 1)
            answer = json.loads(text)
            if answer.get("id") == self.number:
                assert "error" not in answer, answer
                return answer["result"]

    def value(self, expression: str) -> Any:
        """What an expression is in the page; a promise is waited for."""
        asked = {"expression": expression, "awaitPromise": True, "returnByValue": True}
        return self.call("Runtime.evaluate", asked)["result"].get("value")

    def drag(self, places: list[tuple[float, float]]) -> None:
        """Press the pointer at the first place, move it over all, and release it at the last."""
        kinds = ["mousePressed", *["mouseMoved"] * len(places), "mouseReleased"]
        for kind, (x, y) in zip(kinds, [places[0], *places, places[-1]], strict=True):
            event = {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1}
            self.call("Input.dispatchMouseEvent", event)

    def close(self) -> None:
        self.process.terminate()
        self.process.wait()
        os.close(self.writing)
        os.close(self.reading)
        self.profile.cleanup()


def measure(page: Path, width: int) -> dict[str, Any]:
    """How wide (pixels) a page is in a window of a width, and what stands out of it.

    What may scroll by itself is left out.
    """
    frame = page.with_name("frame.html")
    frame.write_text(MEASURE.format(page=page.as_uri(), width=width), encoding="utf-8")
    message = find(load(frame).html, "pre")[0].text
    found: dict[str, Any] = json.loads(message)
    return found


@dataclass
class Element:
    """An element of a document: its name, attributes, all text in it, and what it lies in."""

    tag: str
    attributes: dict[str, str]
    parent: Element | None
    text: str = ""

    def inside(self, tag: str, **attributes: str) -> bool:
        """Whether it lies in an element of that kind."""
        parent = self.parent
        while parent is not None:
            if parent.matches(tag, attributes):
                return True
            parent = parent.parent
        return False

    def matches(self, tag: str, attributes: dict[str, str]) -> bool:
        names = {key.rstrip("_").replace("_", "-"): value for key, value in attributes.items()}
        given = self.attributes
        return self.tag == tag and all(given.get(key) == value for key, value in names.items())


class _Reader(HTMLParser):
    EMPTY = ("br", "hr", "img", "input", "link", "meta", "wbr")

    def __init__(self) -> None:
        super().__init__()
        self.found: list[Element] = []
        self.open: list[Element] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        parent = self.open[-1] if self.open else None
        element = Element(tag, {key: value or "" for key, value in attrs}, parent)
        self.found.append(element)
        if tag not in self.EMPTY:
            self.open.append(element)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.EMPTY:
            self.open.pop()

    def handle_endtag(self, tag: str) -> None:
        if tag in self.EMPTY:
            return
        while self.open and self.open.pop().tag != tag:
            pass

    def handle_data(self, data: str) -> None:
        for element in self.open:
            element.text += data


def elements(html: str) -> list[Element]:
    """All elements of a document, in their order."""
    reader = _Reader()
    reader.feed(html)
    reader.close()
    return reader.found


def find(html: str, tag: str, **attributes: str) -> list[Element]:
    """The elements of a kind, with attributes such as ``class_="x"`` or ``aria_label="x"``."""
    return [e for e in elements(html) if e.matches(tag, attributes)]


def rows(html: str, label: str) -> list[list[str]]:
    """The cells of the table with a label, its head left out."""
    every = elements(html)
    table = [e for e in every if e.tag == "tr" and e.inside("div", aria_label=label)]
    table = [row for row in table if row.inside("tbody")]
    return [[e.text for e in every if e.parent is row] for row in table]
