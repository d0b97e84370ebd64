"""A graph's text, cut at the entries of ``blocks`` and ``wires``: which of them an edit changed.

In: a text. Out: a :class:`Cut`, without reading YAML; None for texts that are read as a whole, such
as a graph that extends another::

    blocks:
      a: {type: Sine}       chunks["a"]: this line and those up to the next entry
      b: {type: Gain}       chunks["b"]
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

from runtime.document import SECTIONS
from runtime.language.items import YamlItem
from runtime.language.scan import scan

CUT = ("blocks", "wires")
# What concerns all of a graph.
WHOLE = ("without", "bypass", "from", "initial", "inputs", "outputs")
FOLLOWING = 3  # entries after an edit that a mistake in it can reach
_TOP = re.compile(r"^[^\s#][^\n]*", re.MULTILINE)
_HEADER = re.compile(r"[A-Za-z_]\w*:(?= |$)")
_BARE = re.compile(r"\w+: *(#.*)?")
_FIRST = re.compile(r"^( +)[A-Za-z_]", re.MULTILINE)
# Entries that read other files, or are parts, or take parameters of another block.
_ELSEWHERE = re.compile(
    r"\b(?:module|graph|part|file|repeat|share|blocks)\s*:|\bplant\s*:\s*[A-Za-z_]"
)
# Searched one by one, which is many times as fast as a pattern of all.
_ODD = ("\r", "\t", "\x85", "\u2028", "\u2029", "\ufeff", "&", " !", "<<:", "\n---", "\n...", "\n%")
_PARAM = re.compile(r"(?:: +|\[ *|, *)\$([A-Za-z_]\w*) *(?=[,\]}]|$)")


@dataclass(frozen=True)
class Region:
    """One entry of the top level: its name, and offsets of its first line and its end.

    begins : the offset of each entry, for a section that is cut; chunks : their texts by key.
    """

    name: str
    start: int
    header: str
    end: int
    begins: tuple[int, ...] = ()
    chunks: dict[str, str] | None = None


@dataclass(frozen=True)
class Cut:
    """A text in pieces."""

    source: str
    regions: tuple[Region, ...]

    @cached_property
    def sections(self) -> dict[str, Region]:
        return {region.name: region for region in self.regions if region.chunks is not None}

    def keys(self, section: str) -> list[str]:
        """The names of a section's entries, in the order of the file."""
        region = self.sections.get(section)
        return list(region.chunks or ()) if region is not None else []

    @property
    def rest(self) -> dict[str, str]:
        """The texts of the entries of the top level that are not cut."""
        return {r.name: self.source[r.start : r.end] for r in self.regions if r.chunks is None}

    def touched_since(self, before: Cut) -> set[str] | None:
        """The names whose entries differ; None if something else differs that concerns all."""
        now, then = self.rest, before.rest
        different = {name for name in {*now, *then} if now.get(name) != then.get(name)}
        different |= self.sections.keys() ^ before.sections.keys()
        if different - {"probes", "plots", "metrics"}:
            return None
        touched: set[str] = set()
        for name, region in self.sections.items():
            new, old = region.chunks or {}, before.sections[name].chunks or {}
            if new is old:
                continue
            touched |= {key for key, text in new.items() if old.get(key) != text}
            touched |= old.keys() - new.keys()
        return touched

    def following(self, names: Iterable[str]) -> set[str]:
        """The names of the entries that follow others."""
        wanted, found = set(names), set[str]()
        for name in self.sections:
            keys = self.keys(name)
            for i, key in enumerate(keys):
                if key in wanted:
                    found |= {*keys[i + 1 : i + 1 + FOLLOWING]}
        return found

    def reads_files(self, names: Iterable[str]) -> bool:
        """Whether entries may name files, or be parts."""
        wanted = set(names)
        return any(
            key in wanted and _ELSEWHERE.search(text)
            for region in self.sections.values()
            for key, text in (region.chunks or {}).items()
        )

    def params_beside(self, names: frozenset[str]) -> frozenset[str]:
        """The params that other entries use for certain."""
        if "$" not in self.source:
            return frozenset()
        return frozenset(
            param
            for region in self.sections.values()
            for key, chunk in (region.chunks or {}).items()
            if "$" in chunk and key not in names
            for line in chunk.split("\n")
            for param in _PARAM.findall(line.partition("#")[0])
        )

    def near(self, names: Iterable[str], lines: bool = True) -> str:
        """The text without the entries of other names; with ``lines``, all stay in their lines."""
        wanted, parts, position = set(names), list[str](), 0
        for region in self.regions:
            for i, key in enumerate(region.chunks or ()):
                if key not in wanted:
                    continue
                begin = region.begins[i]
                parts.append(self._between(region, position, begin, lines))
                position = begin + len((region.chunks or {})[key])
                parts.append(self.source[begin:position])
            if region.chunks is not None:
                parts.append(self._between(region, position, region.end, lines))
            else:
                parts.append(self.source[position : region.end])
            position = region.end
        return "".join(parts)

    def _between(self, region: Region, start: int, end: int, lines: bool) -> str:
        """What is left of the part of a section between two entries, or before the first."""
        first = region.begins[0]
        head = self.source[start : min(first, end)] if start < first else ""
        start = max(start, min(first, end))
        return head + "\n" * (self.source.count("\n", start, end) if lines else 0)

    def entry_at(self, offset: int) -> str:
        """The key of the entry at an offset; '' if there is none."""
        for region in self.sections.values():
            i = bisect_right(region.begins, offset) - 1
            if region.start <= offset < region.end and i >= 0:
                return self.keys(region.name)[i]
        return ""

    def items_at(self, offset: int) -> YamlItem | None:
        """The tolerant tree of the entry at an offset alone; None if there is none."""
        i = bisect_right([region.start for region in self.regions], offset) - 1
        if i < 0:
            return None
        region = self.regions[i]
        begin, end = region.start, region.end
        header = ""
        if region.chunks is not None:
            j = bisect_right(region.begins, offset) - 1
            if j < 0:
                return None
            begin = region.begins[j]
            end = region.begins[j + 1] if j + 1 < len(region.begins) else region.end
            header = f"{region.header}\n"
        return _moved(scan(header + self.source[begin:end]), len(header), region.start, begin)


def _moved(root: YamlItem, length: int, start: int, begin: int) -> YamlItem:
    """A tree with the offsets of the whole text: of its first characters, and of what follows."""

    def to(offset: int) -> int:
        return offset + start if offset < length else offset - length + begin

    for item in root.walk():
        item.start, item.end = to(item.start), to(item.end)
        if item.key_start >= 0:
            item.key_start, item.key_end = to(item.key_start), to(item.key_end)
        item.colon = to(item.colon) if item.colon >= 0 else -1
    return root


def cut(source: str) -> Cut | None:
    """The pieces of a text; None if it is to be read as a whole."""
    lines = list(_TOP.finditer(source))
    names = [line[0].partition(":")[0] for line in lines]
    if (
        any(each in source for each in _ODD)
        or len({*names}) < len(names)
        or not {"graph", "run"} & {*names}
    ):
        return None
    if not {*CUT[:1]} <= {*names} <= {*SECTIONS} - {*WHOLE} or lines[0].start() > 0:
        return None
    ends = [*(line.start() for line in lines[1:]), len(source)]
    regions = []
    for name, line, end in zip(names, lines, ends, strict=True):
        if not _HEADER.match(line[0]):
            return None
        if name not in CUT:
            text = line[0] if name == "world" else source[line.start() : end]
            if (name == "world" and not _BARE.fullmatch(text)) or "module" in text:
                return None
            regions.append(Region(name, line.start(), line[0], end))
            continue
        region = _entries(source, Region(name, line.start(), line[0], end), line.end())
        if region is None or not _BARE.fullmatch(line[0]):
            return None
        regions.append(region)
    return Cut(source, tuple(regions))


def _entries(source: str, region: Region, start: int) -> Region | None:
    """A section with its entries; None for forms that are read as a whole."""
    first = _FIRST.search(source, start, region.end)
    if first is None:
        return None
    found = _split(source, first.start(), region.end, len(first[1]))
    head = source[start : first.start()].split("\n")
    if any(line.strip() and not line.lstrip().startswith("#") for line in head):
        return None
    begins = tuple(begin for begin, _, _ in found)
    chunks = {key: text for _, key, text in found}
    if not 0 < len(chunks) == len(found) or begins[0] != first.start():
        return None
    return replace(region, begins=begins, chunks=chunks)


def _split(source: str, start: int, end: int, indentation: int) -> list[tuple[int, str, str]]:
    """The entries of a part of a section: offset, key, text."""
    entry = re.compile(rf"^ {{{indentation}}}([A-Za-z_]\w*) *:", re.MULTILINE)
    found = [(m.start(), m[1]) for m in entry.finditer(source, start, end)]
    ends = [*(begin for begin, _ in found[1:]), end][: len(found)]
    return [
        (begin, key, source[begin:stop]) for (begin, key), stop in zip(found, ends, strict=True)
    ]


def cut_again(source: str, before: Cut) -> Cut | None:
    """The pieces of a text after an edit inside a section; those of all of it for other edits."""
    old = before.source
    start = _common(old, source)
    end = len(old) - _common(old[: start - 1 : -1], source[: start - 1 : -1]) if start else len(old)
    moved = len(source) - len(old)
    number = bisect_right([region.start for region in before.regions], start) - 1
    region = before.regions[max(0, number)]
    # From the entry before the edit to the one after it: what begins a line may belong to either.
    i, j = bisect_left(region.begins, start) - 1, bisect_right(region.begins, end)
    stop = region.begins[j] if j < len(region.begins) else region.end
    if region.chunks is None or i < 0 or end >= region.end:
        return cut(source)
    begin = region.begins[i]
    middle = source[begin - 1 : stop + moved]
    if any(each in middle for each in _ODD) or _TOP.search(middle, 1):
        return cut(source)
    entry = next(iter(region.chunks.values()))
    indentation = len(entry) - len(entry.lstrip(" "))
    found = _split(source, begin, stop + moved, indentation)
    keys, texts = list(region.chunks), list(region.chunks.values())
    keys[i:j], texts[i:j] = [key for _, key, _ in found], [text for _, _, text in found]
    chunks = dict(zip(keys, texts, strict=True))
    if len(chunks) < len(keys) or not found or found[0][0] != begin:
        return cut(source)
    after = (offset + moved for offset in region.begins[j:])
    begins = (*region.begins[:i], *(offset for offset, _, _ in found), *after)
    regions = list(before.regions)
    regions[number] = replace(region, begins=begins, chunks=chunks, end=region.end + moved)
    if moved:
        for k, other in enumerate(regions[number + 1 :], number + 1):
            offsets = tuple(offset + moved for offset in other.begins)
            first, last = other.start + moved, other.end + moved
            regions[k] = replace(other, start=first, end=last, begins=offsets)
    return Cut(source, tuple(regions))


def _common(one: str, other: str) -> int:
    """How many characters two texts begin with in common."""
    low, high = 0, min(len(one), len(other))
    while low < high:
        middle = (low + high + 1) // 2
        if one[low:middle] == other[low:middle]:
            low = middle
        else:
            high = middle - 1
    return low
