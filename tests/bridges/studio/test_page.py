"""The page in a browser: what a person sees and does, by mouse, by keyboard, and at random."""

from __future__ import annotations

import random
import re
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.bridges.studio.test_server import Studio, studio
from tests.bridges.studio.test_worker import SMALL
from tests.browser import browser

api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = pytest.mark.slow
PATIENCE = 20.0  # s


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """A browser without a window."""
    path = browser()
    with api.sync_playwright() as playwright:
        made = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield made
        made.close()


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Studio]:
    """A studio of a small graph."""
    folder = tmp_path_factory.mktemp("page")
    (folder / "small.yaml").write_text(SMALL, encoding="utf-8")
    with studio(folder, "small.yaml") as found:
        yield found


class Shown:
    """A page with what went wrong in it."""

    def __init__(self, chromium: Any, made: Studio, **options: Any) -> None:
        self.context = chromium.new_context(
            **{"viewport": {"width": 1280, "height": 800}, **options}
        )
        self.page = self.context.new_page()
        self.wrong: list[str] = []
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("console", lambda m: self.wrong.append(m.text) if m.type == "error" else None)
        self.page.goto(f"http://127.0.0.1:{made.port}/?token={made.token}")

    def wait(self, test: Callable[[], Any]) -> Any:
        """Wait until something is so."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = test()
            if found:
                return found
            self.page.wait_for_timeout(20)
        seen = {
            each: self.state(each) for each in ("writes", "playing", "tick", "frames", "cursor")
        }
        raise AssertionError(f"it did not come to be: {seen}, {self.wrong}, {self.status}")

    @property
    def status(self) -> str:
        return str(self.page.inner_text("#status"))

    def state(self, name: str) -> Any:
        return self.page.evaluate(f"window.studio.{name}")

    @property
    def text(self) -> str:
        return "\n".join(self.page.locator(".cm-line").all_inner_texts()).replace("\n\n", "\n")

    def type_over(self, old: str, new: str) -> None:
        """Replace a word of the text by the keyboard."""
        line = self.page.locator(".cm-line", has_text=old).first
        line.click()
        self.page.keyboard.press("End")
        content = line.inner_text()
        for _ in range(len(content) - content.index(old) - len(old)):
            self.page.keyboard.press("ArrowLeft")
        for _ in old:
            self.page.keyboard.press("Backspace")
        self.page.keyboard.insert_text(new)

    def reset(self) -> None:
        """The small graph at the beginning of its run."""
        self.wait(lambda: self.state("frames"))
        # Another page may still be there, which then writes.
        click = "for (const id of ['take', 'reset']) document.getElementById(id).click()"
        self.wait(lambda: self.page.evaluate(click) or self.state("tick") == 0)


@pytest.fixture
def shown(chromium: Any, made: Studio) -> Iterator[Shown]:
    """A page that writes."""
    found = Shown(chromium, made)
    found.reset()
    yield found
    found.context.close()
    assert found.wrong == []


def test_it_runs_by_the_keyboard_and_the_token_is_gone_from_the_address(shown: Shown) -> None:
    page = shown.page
    assert "token" not in page.url
    page.locator("#picture").click(position={"x": 3, "y": 3})
    page.keyboard.press("Space")
    shown.wait(lambda: shown.state("tick") > 50)
    assert page.inner_text("#play") == "Pause"
    page.keyboard.press("Space")
    shown.wait(lambda: not shown.state("playing"))
    assert re.fullmatch(r"\d\.\d\d of 5 s", page.inner_text("#clock"))
    assert page.locator(".plot canvas").count() == 1
    blank = "(c) => c.getContext('2d').getImageData(0, 0, c.width, c.height).data.every((x) => !x)"
    assert page.locator(".plot canvas").first.evaluate(blank) is False
    tick = shown.state("tick")
    page.keyboard.press(".")
    shown.wait(lambda: shown.state("tick") > tick)
    page.reload()  # the token is remembered for this tab alone
    shown.wait(lambda: shown.state("frames"))


def test_typing_is_followed_and_what_is_wrong_is_shown(shown: Shown) -> None:
    page = shown.page
    shown.type_over("gain: 2.0", "gain: 2.75")
    shown.wait(lambda: "blocks.g.gain" in shown.status)
    shown.type_over("gain: 2.75", "gian: 2.0")
    shown.wait(lambda: "1 problem" in page.inner_text("#count"))
    assert "did you mean 'gain'" in page.inner_text("#problems")
    assert "stale" in page.get_attribute("#picture", "class")
    page.get_by_role("button", name="Replace by 'gain'").click()
    shown.wait(lambda: page.inner_text("#count") == "no problems")
    assert "gain: 2.0" in shown.text


def test_a_click_on_a_block_is_an_edit_that_undo_takes_back(shown: Shown) -> None:
    page, before = shown.page, shown.text
    page.locator('[data-kind="block"][data-name="n"]').click()
    page.locator("#block h2", has_text="n").wait_for()
    assert "selected" in page.get_attribute('[data-kind="block"][data-name="n"]', "class")
    page.locator("#block button", has_text="Leave out").click()
    shown.wait(lambda: "without: [n]" in shown.text)
    page.locator("#block button", has_text="Put back").wait_for()
    page.locator(".cm-content").focus()
    page.keyboard.press("Control+z")
    shown.wait(lambda: shown.text == before)
    page.locator('[data-kind="block"][data-name="u"]').focus()
    page.keyboard.press("Enter")
    page.locator("#block h2", has_text="u").wait_for()
    leave = page.locator("#block button", has_text="Leave out")
    leave.wait_for()
    assert leave.is_disabled() and "g.input" in leave.get_attribute("title")


def test_a_slider_acts_while_it_moves_and_is_written_when_released(shown: Shown) -> None:
    page = shown.page
    page.locator("#find").fill("amplitude")
    slider = page.locator("#sliders input").first
    slider.focus()
    assert slider.get_attribute("aria-valuetext") == "1"
    page.keyboard.press("ArrowRight")
    shown.wait(lambda: "amplitude: 1.01" in shown.text)
    page.keyboard.press("ArrowLeft")
    shown.wait(lambda: re.search(r"amplitude: 1(\.0)?}", shown.text))


def test_going_back_and_on_is_a_branch_beside_the_run_before(shown: Shown) -> None:
    page = shown.page
    page.select_option("#speed", "0")
    page.click("#play")
    shown.wait(lambda: shown.state("tick") == 500)
    scrub = page.locator("#scrub")
    scrub.focus()
    page.keyboard.press("Home")
    shown.wait(lambda: shown.state("cursor") == 0)
    shown.wait(lambda: scrub.get_attribute("aria-valuetext").startswith("0.00 of 5 s"))
    page.locator("#picture").click(position={"x": 3, "y": 3})
    for _ in range(10):
        page.keyboard.press("ArrowRight")
    assert shown.state("cursor") == pytest.approx(0.5)
    page.keyboard.press(".")
    shown.wait(lambda: shown.state("tick") == 51)
    assert shown.state("cursor") is None
    page.select_option("#speed", "1")


def test_it_can_be_used_on_a_narrow_page(chromium: Any, made: Studio) -> None:
    narrow = Shown(chromium, made, viewport={"width": 390, "height": 844})
    narrow.wait(lambda: narrow.state("frames"))
    for tab, place in (
        ("Text", "#editor"),
        ("Diagram", "#picture"),
        ("Plots", ".plot"),
        ("Numbers", "#sliders"),
    ):
        narrow.page.get_by_role("tab", name=tab).click()
        assert narrow.page.locator(place).first.is_visible()
        assert narrow.page.evaluate("document.documentElement.scrollWidth") <= 390
    narrow.context.close()
    assert narrow.wrong == []


def test_random_clicks_leave_text_and_session_equal(chromium: Any, made: Studio) -> None:
    shown = Shown(chromium, made)
    shown.reset()
    chance, page = random.Random(2), shown.page
    keys = [
        "Space",
        ".",
        "Home",
        "End",
        "ArrowLeft",
        "Shift+ArrowRight",
        "[",
        "]",
        "Control+z",
        "Tab",
    ]
    for _ in range(150):
        targets = page.locator(
            "button:visible:enabled, #picture [data-kind=block], #sliders input, canvas"
        )
        if chance.random() < 0.3:
            page.keyboard.press(chance.choice(keys))
        else:
            target = targets.nth(chance.randrange(max(1, targets.count())))
            label = target.get_attribute("id", timeout=2000) if targets.count() else ""
            if label in ("save", "keep"):
                continue
            target.dispatch_event("click", timeout=2000)

    def is_equal() -> bool:
        other = made.client()
        text = other.until("text")["text"]
        other.stack.close()
        return bool(page.evaluate("window.studio.sent") == text)

    shown.wait(is_equal)
    assert shown.wrong == []
    shown.context.close()


def test_the_choice_of_a_graph_is_cards_with_pictures(chromium: Any, tmp_path: Path) -> None:
    with studio(tmp_path) as made:
        shown = Shown(chromium, made)
        shown.page.locator(".card").first.wait_for()
        shown.wait(lambda: shown.page.locator(".card img[src]").count())
        shown.page.locator("#search").fill("gallery/van_der_pol")
        shown.page.locator(".card:visible").first.click()
        shown.wait(lambda: shown.state("frames"))
        assert shown.page.inner_text("#name") == "van_der_pol.yaml"
        shown.context.close()
        assert shown.wrong == []
