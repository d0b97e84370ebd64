"""axe-core on pages in a headless browser.

In: a page, and the file of axe-core (``npm install axe-core``). Out: the serious violations::

    python -m tests.accessibility node_modules/axe-core/axe.min.js docs/_build/*.html

prints, for each page, its weight with all that it loads from beside it, and its violations.
"""

from __future__ import annotations

import json
import re
import shutil
import sys
import tempfile
from pathlib import Path
from urllib.parse import unquote

from tests.browser import find, load

RUN = """
// The page's own scripts first; a dump of the document waits for none that begin later.
document.dispatchEvent(new Event("DOMContentLoaded"));
axe.run(document, {resultTypes: ["violations"]}).then((found) => {
  const out = document.createElement("pre");
  out.id = "axe-found";
  out.textContent = JSON.stringify(found.violations.map((v) => ({id: v.id, impact: v.impact,
    nodes: v.nodes.map((n) => n.html.slice(0, 120))})));
  document.body.append(out);
});
"""
SERIOUS = ("serious", "critical")
_POLICY = re.compile(r"<meta http-equiv=\"Content-Security-Policy\"[^>]*>")
_LOADED = re.compile(r"<(?:img|script|link)\b[^>]*?\b(?:src|href)=\"([^\"#?]+)[^\"]*\"")


def violations(page: Path, axe: Path) -> list[dict[str, object]]:
    """The serious and critical violations of a page."""
    with tempfile.NamedTemporaryFile("w", suffix=".html", dir=page.parent, delete=False) as copy:
        # Its policy would not let a script of ours run.
        html = _POLICY.sub("", page.read_text(encoding="utf-8"))
        script = f"<script>{axe.read_text(encoding='utf-8')}\n{RUN}</script>"
        copy.write(html.replace("</body>", f"{script}</body>"))
    try:
        (answer,) = find(load(Path(copy.name)).html, "pre", id="axe-found")
    finally:
        Path(copy.name).unlink()
    return [each for each in json.loads(answer.text) if each["impact"] in SERIOUS]


def weight(page: Path) -> int:
    """The bytes of a page, and of the files beside it that it loads at once."""
    html = page.read_text(encoding="utf-8")
    shown = re.sub(r"<img[^>]*loading=\"lazy\"[^>]*>", "", html)
    files = {(page.parent / unquote(each)).resolve() for each in _LOADED.findall(shown)}
    return page.stat().st_size + sum(file.stat().st_size for file in files if file.is_file())


def find_axe() -> Path | None:
    """The file of axe-core where npm has installed it, in this folder or for all users."""
    npm = shutil.which("npm")
    roots = [Path("node_modules"), *([Path(npm).resolve().parents[2]] if npm else [])]
    places = (root / "axe-core" / "axe.min.js" for root in roots)
    return next((place for place in places if place.is_file()), None)


def main(axe: Path, pages: list[Path]) -> int:
    """Print the weight and the violations of each page; returns how many violations there are."""
    count = 0
    for page in pages:
        found = violations(page, axe)
        count += len(found)
        print(f"{page.name}: {weight(page) / 1000:.0f} kB, {len(found)} serious violations")
        for each in found:
            print(f"  {each['impact']}: {each['id']}: {each['nodes']}")
    return min(count, 1)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), [Path(each).resolve() for each in sys.argv[2:]]))
