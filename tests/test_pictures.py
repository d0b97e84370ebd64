"""Every picture comes from the commands that are printed above it."""

from __future__ import annotations

import importlib
import re
from pathlib import Path
from types import ModuleType

import pytest
from matplotlib.image import imread

import runtime
from tests.test_docs import PAGES, ROOT

# Written with their pages, by tests.studies.comparison and docs/learning_study.py.
OF_STUDIES = {
    *(path.name for path in (ROOT / "docs" / "images").glob("comparison*.png")),
    "learning_weights.png",
    "learning_deployed.png",
}
COMMAND = re.compile(r"runtime (?:run|draw|render|linearize|sweep) [^`#\n]*")
IMAGE = re.compile(r"!\[[^\]]*\]\((?:docs/|\.\./)?images/([^)]+)\)")


def of_docs(name: str, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "docs")
    return importlib.import_module(name)


def above(text: str, count: int) -> tuple[str, ...]:
    """The last commands of a text; my.yaml is the starter, which test_docs.py compares."""
    found = [command.strip() for command in COMMAND.findall(text)]
    return tuple(command.replace("my.yaml", "starters/adaptive") for command in found[-count:])


def below(text: str, count: int) -> tuple[str, ...]:
    """The first commands of a text."""
    return tuple(command.strip() for command in COMMAND.findall(text)[:count])


def test_pages_print_the_commands_of_their_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    pictures = of_docs("pictures", monkeypatch).PICTURES
    shown = set()
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        for image in IMAGE.finditer(text):
            if image[1] not in OF_STUDIES:
                commands = pictures[image[1]].commands
                before, after = text[: image.start()], text[image.end() :]
                # The first picture of a page comes before its command.
                first = below(after, len(commands)) if not above(before, 1) else ()
                assert commands in (above(before, len(commands)), first), page.name
                shown.add(image[1])
    assert shown == set(pictures)
    assert {path.name for path in (ROOT / "docs" / "images").iterdir()} == shown | OF_STUDIES


def test_the_study_of_learning_prints_what_it_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    study = of_docs("learning_study", monkeypatch)
    page = study.PAGE.read_text(encoding="utf-8")
    assert f"```text\n{study.TRAIN}\n{study.DEPLOY}\n```" in page


def page_of(name: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """A graph's page in the gallery, and the address of its picture."""
    pages = of_docs("site_pages", monkeypatch)
    group, _, stem = name.rpartition("/")
    (found,) = (each for each in pages.shipped(group or "graphs") if each.name == stem)
    each = pages.entry(group or "graphs", found)
    pages._page(folder, each)
    return (folder / f"{each.page}.md").read_text(encoding="utf-8"), pages._picture(folder, each)[0]


@pytest.mark.parametrize("name", ["wall_following_robust", "wall_following_mujoco_robust"])
def test_the_gallery_prints_the_commands_of_committed_pictures(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pictures = of_docs("pictures", monkeypatch).PICTURES
    text, address = page_of(name, tmp_path, monkeypatch)
    commands = pictures[Path(address).name].commands
    assert commands[0].split()[2] == name
    console = "\n".join(commands)
    assert re.search(
        rf"```sh\n{re.escape(console)}\n```\n\n!\[.*\]\({re.escape(address)}\)\n", text
    )


@pytest.mark.parametrize("long", [False, True])
def test_the_gallery_runs_what_it_prints(
    long: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a run that takes long, the command has the shorter time."""
    name = "gallery/first_order_feedback"
    pages, pictures = (of_docs(module, monkeypatch) for module in ("site_pages", "pictures"))
    monkeypatch.setattr(pages, "MAX_SECONDS", 1e-4 if long else 1e4)
    ran: list[str] = []
    monkeypatch.setattr(pictures, "printed", lambda command, folder: ran.append(command))
    with pytest.raises(RuntimeError, match="made 0 files"):
        page_of(name, tmp_path, monkeypatch)
    monkeypatch.setenv("SPIKEBLOCKS_DOCS_RUNS", "0")
    text, _ = page_of(name, tmp_path, monkeypatch)
    assert below(text, 1) == tuple(ran)
    assert ("--until=" in ran[0]) == long


@pytest.mark.slow
def test_a_picture_of_the_gallery_is_that_of_its_command(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = "gallery/van_der_pol"
    text, address = page_of(name, tmp_path, monkeypatch)
    assert below(text, 1) == (f"runtime run {name}",)
    graph = runtime.load(name)
    graph.run().plot(graph.observation.all_plots[0].name).savefig(tmp_path / "own.png", dpi=150)
    assert (imread(tmp_path / address) == imread(tmp_path / "own.png")).all()


def test_bars_of_a_page_are_as_long_as_its_times(monkeypatch: pytest.MonkeyPatch) -> None:
    evidence = of_docs("evidence", monkeypatch)
    head = "|  | per tick | ratio |\n| --- | --- | --- |\n"
    text = f"before\n\n{head}| slow <a> | 2 ms (1 to 3) | 1 |\n| quick | 500.0 µs | 0.25 |\n\nafter"
    drawn = evidence.with_bars(text)
    assert drawn.endswith(text[text.index("|") :])
    assert re.findall(r"<span>(.*?)</span><b style=\"--share:([\d.]+)\">(.*?)</b>", drawn) == [
        ("slow &lt;a&gt;", "1.0000", "2 ms"),
        ("quick", "0.2500", "500.0 µs"),
    ]
    page = (ROOT / "docs" / "performance.md").read_text(encoding="utf-8")
    assert evidence.with_bars(page).count('class="bars"') > 5
    claims = re.findall(
        r"^\| ([A-C]\d[a-c]?) \|", (ROOT / "docs/reproduction.md").read_text("utf-8"), re.M
    )
    assert set(claims) == set(re.findall(r"\b[A-C]\d[a-c]?\b", " ".join(evidence.FIGURES.values())))
