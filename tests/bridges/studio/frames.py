"""Frames as a page reads them, and a worker whose messages are kept in a list."""

from __future__ import annotations

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np

from spikeblocks.studio.worker import Worker

GRAPHS = Path(__file__).parents[3] / "graphs"


def unpack(frame: bytes) -> tuple[dict[str, Any], dict[str, tuple[int, Any]]]:
    """The head of a frame, and for each stream the number of its first row and its numbers."""
    (size,) = struct.unpack_from("<I", frame)
    head = json.loads(frame[4 : 4 + size])
    numbers = np.frombuffer(frame, "<f4", offset=4 + size)
    return head, {n: (first, numbers[at : at + k]) for n, first, at, k in head["parts"]}


class Kept:
    """What a page has of the streams."""

    def __init__(self) -> None:
        self.about: dict[str, Any] = {}
        self.rows: dict[str, Any] = {}
        self.head: dict[str, Any] = {}
        self.said: list[tuple[str, dict[str, Any]]] = []

    def take(self, kind: str, values: Any) -> None:
        if kind == "views":
            self.about = values["streams"]
            self.rows = {n: np.empty((0, s["width"])) for n, s in self.about.items()}
        if kind != "frame":
            self.said.append((kind, values))
            return
        self.head, parts = unpack(values)
        for name, (first, numbers) in parts.items():
            if name not in self.about:
                continue  # a frame may come before it is said what it has; all of it comes again
            new = numbers.reshape(-1, self.about[name]["width"])
            old = self.rows[name]
            if self.about[name]["mode"] == "events":
                first = int(np.searchsorted(old[:, 0], first))
            assert first <= len(old), f"{name} has a gap"
            self.rows[name] = np.vstack([old[:first], new])

    def all(self, kind: str) -> list[dict[str, Any]]:
        return [values for name, values in self.said if name == kind]


class Sent(list[Any]):
    """The end of a pipe that keeps what is sent."""

    send = list.append


class Local(Worker):
    """A worker in this process."""

    def __init__(self, name: str = "line_actuator_failure", text: str | None = None) -> None:
        self.sent = Sent()
        super().__init__(self.sent)
        self.page = Kept()
        self.path = GRAPHS / f"{name}.yaml"
        self.text = text or self.path.read_text(encoding="utf-8")

    def begin(self, **given: Any) -> Local:
        self.on_begin(self.text, str(self.path), True, **given)
        self.read()
        return self

    def read(self) -> None:
        for each in self.sent:
            self.page.take(*each)
        self.sent.clear()

    def edit(self, text: str) -> None:
        """Follow another text."""
        self.on_text(1, text, str(self.path), True)
        while self.next is not None:
            self.next[1].exception(timeout=60)
            self.follow()
        self.send_frame()
        self.read()
