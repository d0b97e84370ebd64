"""What the pages of one studio share: the desk, the process of the session, and who writes.

In: the messages of pages, as mappings with ``do``. Out: messages and frames to all pages. One page
writes, the others look; the text and its checks are handled in a thread, one after the other, so
that frames never wait for them.
"""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from datetime import datetime
from functools import cache
from pathlib import Path
from typing import Any, Protocol

from blocks.files import read_text
from runtime.document import SHIPPED
from runtime.errors import SpikeblocksError, UsageError
from runtime.files import write_whole
from spikeblocks.studio.desk import Desk, shipped
from spikeblocks.studio.process import SessionProcess

MAX_TEXT = 2_000_000  # characters
SILENT = 2.0  # s without an answer after which the page is told
LOOKS = 1.0  # s between two looks at the file
CHANGING = (
    *("text", "set", "write", "play", "pause", "step", "goto", "begin", "act", "number"),
    *("save", "save_session", "open", "trust", "revive"),
)


class Page(Protocol):
    """A page that is open."""

    def post(self, data: str | bytes) -> None:
        """Send it something, without waiting for it."""


class Room:
    """The state of one studio.

    Parameters
    ----------
    path : of the graph; None to begin with the choice of one. trusted : whether Python files that
        graphs name are run without asking.
    """

    def __init__(self, path: Path | None, trusted: bool = False) -> None:
        self.folder = Path.cwd() if path is None or shipped(path) else path.resolve().parent
        self.trusted = trusted
        self.pages: list[Page] = []
        self.writer: Page | None = None
        self.process = SessionProcess(self.listen)
        self.thread = ThreadPoolExecutor(1)
        self.desk: Desk | None = None
        self.on_disk: str | None = None
        self.number = 0  # of the present text
        self.views: dict[str, Any] = {}
        self.state: dict[str, Any] = {}
        self.was_silent = False
        self.gallery: list[dict[str, str]] | None = None
        if path is not None:
            self.read(path)

    def read(self, path: Path) -> None:
        """Take the text of a file.

        Raises
        ------
        UsageError : it cannot be read.
        """
        try:
            text = _content(path)
        except (OSError, UnicodeDecodeError) as error:
            raise UsageError(f"cannot read '{path}': {error}") from None
        self.on_disk = text
        self.desk = Desk(text, path)
        # Files that come with the library are the library's own.
        if self.trusted or shipped(path) or not self.desk.python_files:
            self.desk = Desk(text, path, True)

    # Pages

    def join(self, page: Page) -> None:
        """Let a page take part; the first one writes."""
        self.pages.append(page)
        if self.writer is None:
            self.writer = page

    def leave(self, page: Page) -> None:
        """A page was closed; the run goes on."""
        self.pages.remove(page)
        if self.writer is page:
            self.writer = self.pages[0] if self.pages else None
            self.tell_roles()

    def tell_roles(self) -> None:
        """Say to each page whether it writes."""
        for page in self.pages:
            page.post(_text("role", writes=page is self.writer))

    def tell(self, kind: str, **values: Any) -> None:
        """Send a message to all pages."""
        data = _text(kind, **values)
        for page in self.pages:
            page.post(data)

    def listen(self, name: str, values: Any) -> None:
        """Hand on what comes from the process of the session."""
        if name == "frame":
            for page in self.pages:
                page.post(values)
            return
        if name == "views":
            self.views = values
        if name == "state":
            self.state = values
        self.tell(name, **values)

    # The session

    def start(self) -> None:
        """Start the process, and begin the session if the text is that of a graph."""
        self.process.start()
        self.begin()

    def begin(self, seed: int | None = None) -> None:
        """Begin a session anew with the present text."""
        desk = self.desk
        if desk is None or not desk.is_valid or self.asks_for_trust:
            return
        given = {"text": desk.text, "path": str(desk.path), "modules": self._runs_modules}
        self.process.send("begin", **given, seed=seed)

    @property
    def _runs_modules(self) -> bool:
        return self.desk is not None and bool(self.desk.surroundings.modules)

    @property
    def asks_for_trust(self) -> bool:
        """Whether the graph names Python files that may not run yet."""
        return self.desk is not None and not self._runs_modules and bool(self.desk.python_files)

    async def watch(self) -> None:
        """Say when the session does not answer, and take edits of the file from outside."""
        while True:
            await asyncio.sleep(LOOKS)
            is_silent = self.process.silent_for > SILENT
            if is_silent != self.was_silent:
                self.was_silent = is_silent
                self.tell("silent", silent=is_silent)
            desk = self.desk
            if desk is None or shipped(desk.path) or not desk.path.is_file():
                continue
            try:
                text = _content(desk.path)
            except (OSError, UnicodeDecodeError):
                continue
            if text != self.on_disk:
                is_edited = desk.text != self.on_disk
                self.on_disk = text
                if not is_edited:
                    await self.take_text(text, "outside")
                else:
                    self.tell("outside", text=text)

    # Messages of pages

    async def handle(self, page: Page, message: Mapping[str, Any]) -> None:
        """Carry out one message of a page; what is wrong with it is told to the page."""
        name = message.get("do")
        handler: Callable[..., Any] | None = getattr(self, f"on_{name}", None)
        try:
            if not isinstance(name, str) or handler is None:
                raise UsageError("there is no such message")
            if name in CHANGING and page is not self.writer:
                raise UsageError("another page of this studio writes; take over to change things")
            await handler(page, **{key: value for key, value in message.items() if key != "do"})
        except SpikeblocksError as error:
            page.post(_text("wrong", text=str(error), what=name))
        except (TypeError, ValueError, LookupError, AttributeError, OSError) as error:
            page.post(_text("wrong", text=f"the message cannot be read: {error}", what=str(name)))

    async def _in_thread(self, call: Callable[..., Any], *given: Any) -> Any:
        return await asyncio.get_running_loop().run_in_executor(self.thread, call, *given)

    async def on_hello(self, page: Page) -> None:
        """Everything that a page needs to begin."""
        page.post(_text("role", writes=page is self.writer))
        if self.desk is None:
            if self.gallery is None:
                self.gallery = await self._in_thread(cards)
            page.post(_text("gallery", graphs=self.gallery))
            return
        page.post(await self._in_thread(self._whole, "opened"))
        if self.views:
            self.process.send("all")

    def _whole(self, cause: str) -> str:
        """The text with all that is known about it."""
        desk = self.desk
        if desk is None:
            return _text("gallery", graphs=[])
        return _text(
            "text",
            text=desk.text,
            number=self.number,
            cause=cause,
            name=desk.path.name,
            saved=desk.text == self.on_disk,
            shipped=shipped(desk.path),
            problems=desk.problems(),
            valid=desk.is_valid,
            picture=desk.picture(),
            numbers=desk.numbers(),
            trust=desk.python_files if self.asks_for_trust else [],
        )

    async def take_text(self, text: str, cause: str) -> None:
        """Take another text, tell it to all pages, and let the session follow."""
        desk = self.desk
        if desk is None:
            return
        if len(text) > MAX_TEXT:
            raise UsageError(f"a text of more than {MAX_TEXT:,} characters")
        self.number += 1
        number = self.number
        await self._in_thread(desk.read, text)
        if number != self.number:
            return  # a later one is on its way
        self.tell_raw(await self._in_thread(self._whole, cause))
        if await self._in_thread(lambda: desk.is_valid) and not self.asks_for_trust:
            given = {"text": text, "path": str(desk.path), "modules": self._runs_modules}
            self.process.send("text", number=number, **given)

    def tell_raw(self, data: str) -> None:
        """Send a message that is ready to all pages."""
        for page in self.pages:
            page.post(data)

    async def on_text(self, page: Page, text: str) -> None:
        """The text was edited in a page."""
        await self.take_text(str(text), "typed")

    async def on_act(self, page: Page, action: str, block: str, value: Any = "") -> None:
        """Leave out, bypass, delete, restore or replace a block."""
        desk = self._open_desk()
        text = await self._in_thread(desk.change, action, block, value)
        reason = await self._in_thread(desk.reason, action, block, value)
        if reason:
            raise UsageError(reason)
        await self.take_text(text, "click")

    async def on_number(self, page: Page, path: str, value: Any) -> None:
        """Write a number into the text, once a slider is released."""
        desk = self._open_desk()
        text = await self._in_thread(desk.change, "set", path, _number(value))
        await self.take_text(text, "slider")

    async def on_set(self, page: Page, path: str, value: Any) -> None:
        """Change a number of the session alone, while a slider moves."""
        self.process.send("set", path=str(path), value=_number(value))

    async def on_write(self, page: Page, port: str, value: Any) -> None:
        """Write to an input of the graph."""
        self.process.send("write", port=str(port), value=_number(value))

    async def on_play(self, page: Page, speed: float) -> None:
        """Run by the clock; a speed of 0 is as fast as it goes."""
        speed = float(speed)
        if not (speed >= 0.0 and math.isfinite(speed)):
            raise UsageError("a speed is a number of at least 0")
        self.process.send("play", speed=speed or math.inf)

    async def on_pause(self, page: Page) -> None:
        """Stop the clock."""
        self.process.send("pause")

    async def on_step(self, page: Page, ticks: int) -> None:
        """Do some ticks."""
        self.process.send("step", ticks=min(10**7, max(0, int(ticks))))

    async def on_goto(self, page: Page, tick: int) -> None:
        """Go to a tick."""
        self.process.send("goto", tick=max(0, int(tick)))

    async def on_begin(self, page: Page, seed: int | None = None) -> None:
        """Begin anew, with a seed."""
        if seed is not None and not 0 <= int(seed) < 2**63:
            raise UsageError("a seed is a whole number of at least 0")
        self.begin(None if seed is None else int(seed))

    async def on_watch(self, page: Page, addresses: list[str]) -> None:
        """Show the values of signals."""
        self.process.send("watch", addresses=[str(each) for each in addresses][:40])

    async def on_revive(self, page: Page) -> None:
        """End a session that does not answer, and compute its state again."""
        self.process.revive()

    async def on_block(self, page: Page, name: str) -> None:
        """What a block is, and what can be done to it."""
        desk = self._open_desk()
        page.post(_text("block", block=await self._in_thread(desk.block, str(name))))

    async def on_replacements(self, page: Page, name: str) -> None:
        """Types that can take a block's place."""
        desk = self._open_desk()
        found = await self._in_thread(desk.replacements, str(name))
        page.post(_text("replacements", name=name, types=found))

    async def on_complete(self, page: Page, offset: int, ask: int) -> None:
        """What can be written at an offset."""
        desk = self._open_desk()
        found = await self._in_thread(desk.completions, int(offset))
        page.post(_text("answer", ask=ask, found=found))

    async def on_hover(self, page: Page, offset: int, ask: int) -> None:
        """What is known of a name."""
        desk = self._open_desk()
        found = await self._in_thread(desk.card, int(offset))
        page.post(_text("answer", ask=ask, found=found))

    async def on_block_at(self, page: Page, offset: int, ask: int) -> None:
        """The block at an offset."""
        desk = self._open_desk()
        found = await self._in_thread(desk.block_at, int(offset))
        page.post(_text("answer", ask=ask, found=found))

    async def on_take_over(self, page: Page) -> None:
        """Let this page write."""
        self.writer = page
        self.tell_roles()

    async def on_trust(self, page: Page) -> None:
        """Run the Python files that the graph names."""
        desk = self._open_desk()
        self.desk = Desk(desk.text, desk.path, True)
        self.tell_raw(await self._in_thread(self._whole, "opened"))
        self.begin()

    async def on_save(self, page: Page) -> None:
        """Write the text to its file; a shipped graph becomes a file of the current folder."""
        desk = self._open_desk()
        path = self.folder / desk.path.name if shipped(desk.path) else desk.path
        if shipped(desk.path) and path.exists():
            raise UsageError(f"'{path.name}' exists already in '{self.folder}'")
        try:
            write_whole(path, desk.text)
        except OSError as error:
            raise UsageError(f"cannot write '{path}': {error.strerror or error}") from None
        if path != desk.path:
            self.desk = Desk(desk.text, path, desk.surroundings.modules)
        self.on_disk = desk.text
        self.tell("stored", name=path.name, folder=str(self.folder))

    async def on_save_session(self, page: Page) -> None:
        """Save the session beside the graph, for runtime replay."""
        desk = self._open_desk()
        moment = datetime.now().strftime("%Y%m%d-%H%M%S")
        self.process.send(
            "save", folder=str(self.folder / "sessions" / f"{desk.path.stem}-{moment}")
        )

    async def on_picture(self, page: Page, name: str) -> None:
        """The diagram of a shipped graph, for its card."""
        if name not in shipped_names():
            raise UsageError("there is no shipped graph of that name")
        page.post(_text("picture", name=name, svg=await self._in_thread(picture, name)))

    async def on_open(self, page: Page, name: str) -> None:
        """Open a shipped graph."""
        if name not in shipped_names():
            raise UsageError("there is no shipped graph of that name")
        await self._in_thread(self.read, SHIPPED / f"{name}.yaml")
        self.views, self.number = {}, self.number + 1
        self.tell_raw(await self._in_thread(self._whole, "opened"))
        self.begin()

    def _open_desk(self) -> Desk:
        if self.desk is None:
            raise UsageError("no graph is open")
        return self.desk


def _content(path: Path) -> str:
    """The text of a graph's file, with the line ends of Python.

    Raises
    ------
    OSError, UnicodeDecodeError : as of :func:`blocks.files.read_text`.
    """
    return read_text(path, encoding="utf-8-sig").replace("\r\n", "\n")


@cache
def shipped_names() -> tuple[str, ...]:
    """The graphs that come with the library: starters, the paper's cases, the gallery."""
    found = [*SHIPPED.glob("starters/*.yaml"), *SHIPPED.glob("*.yaml")]
    found += sorted(SHIPPED.glob("gallery/**/*.yaml"))
    return tuple(path.relative_to(SHIPPED).with_suffix("").as_posix() for path in found)


def cards() -> list[dict[str, str]]:
    """The shipped graphs with the first sentence of their comment, starters first."""
    found = []
    for name in shipped_names():
        path = SHIPPED / f"{name}.yaml"
        text = path.read_text(encoding="utf-8")
        lines = [line.strip("# ") for line in text.split("\n")[:8] if line.startswith("#")]
        about = " ".join(line for line in lines if not line.startswith("yaml-language-server"))
        about = f"{about.split('. ')[0].rstrip('.')}."
        if "\nrun:" in f"\n{text}" and "\nblocks:" in f"\n{text}":
            found.append({"name": name, "about": about})
    return found


def picture(name: str) -> str:
    """The diagram of a shipped graph; '' if it cannot be drawn."""
    path = SHIPPED / f"{name}.yaml"
    return Desk(path.read_text(encoding="utf-8"), path).picture()


def _number(value: Any) -> Any:
    """A number or a list of numbers from a page."""
    if isinstance(value, list):
        return [_number(each) for each in value]
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise UsageError("expected a finite number")
    return value


def _text(kind: str, **values: Any) -> str:
    return json.dumps({"kind": kind, **values}, default=str)
