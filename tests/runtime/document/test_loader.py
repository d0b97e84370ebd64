"""From files to one document: extends, parts, paths, and what cannot be read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import runtime
from runtime.document.loader import SHIPPED, merge, read_graph
from runtime.document.node import from_python
from runtime.errors import GraphError
from tests.runtime.broken import PART, SOUND, changed, problems, with_part


def loaded(folder: Path, files: dict[str, str], name: str = "g.yaml") -> dict[str, Any]:
    for file, text in files.items():
        (folder / file).parent.mkdir(parents=True, exist_ok=True)
        (folder / file).write_text(text, encoding="utf-8")
    plain: dict[str, Any] = read_graph(folder / name)[0].plain()
    return plain


def merged(base: Any, top: Any) -> Any:
    return merge(from_python(base), from_python(top)).plain()


MERGES = [
    ({"a": 1}, {"b": 2}, {"a": 1, "b": 2}),
    ({"a": {"x": 1, "y": 2}}, {"a": {"y": 3}}, {"a": {"x": 1, "y": 3}}),
    ({"a": [1, 2]}, {"a": [3]}, {"a": [3]}),
    ({"a": {"x": 1}}, {"a": 3}, {"a": 3}),
    ({"a": 3}, {"a": {"x": 1}}, {"a": {"x": 1}}),
    ({"a": 1, "b": 2}, {"a": None}, {"b": 2}),
    ({"a": {"x": 1, "y": 2}}, {"a": {"x": None}}, {"a": {"y": 2}}),
    ({"a": None}, {"a": 1}, {"a": 1}),
    # A null that deletes nothing stays, to be reported where it is read.
    ({"a": 1}, {"b": None}, {"a": 1, "b": None}),
    # Another type, kind or part replaces the whole entry: its parameters mean something else.
    (
        {"blocks": {"b": {"type": "LinePath", "y": 1}}},
        {"blocks": {"b": {"type": "SinePath", "amplitude": 2}}},
        {"blocks": {"b": {"type": "SinePath", "amplitude": 2}}},
    ),
    (
        {"blocks": {"b": {"type": "LinePath", "y": 1}}},
        {"blocks": {"b": {"type": "LinePath", "x_end": 2}}},
        {"blocks": {"b": {"type": "LinePath", "y": 1, "x_end": 2}}},
    ),
    (
        {"blocks": {"b": {"type": "LinePath", "y": 1}}},
        {"blocks": {"b": {"y": 2}}},
        {"blocks": {"b": {"type": "LinePath", "y": 2}}},
    ),
    (
        {"plots": {"p": {"kind": "raster", "of": "a"}}},
        {"plots": {"p": {"kind": "heatmap"}}},
        {"plots": {"p": {"kind": "heatmap"}}},
    ),
    (
        {"blocks": {"b": {"part": "x", "blocks": {"c": {"type": "Sum"}}}}},
        {"blocks": {"b": {"type": "Sum"}}},
        {"blocks": {"b": {"type": "Sum"}}},
    ),
    (
        {"blocks": {"b": {"part": "x", "blocks": {"c": {"type": "Sum", "signs": [1]}}}}},
        {"blocks": {"b": {"blocks": {"c": {"type": "Mux"}}}}},
        {"blocks": {"b": {"part": "x", "blocks": {"c": {"type": "Mux"}}}}},
    ),
    # Elsewhere these are names like any other: of a param, of a block.
    (
        {"params": {"type": 1, "kind": 2, "a": 3}},
        {"params": {"type": 4}},
        {"params": {"type": 4, "kind": 2, "a": 3}},
    ),
    (
        {"blocks": {"part": {"type": "Sum"}, "b": {"type": "Sum"}}},
        {"blocks": {"part": {"type": "Mux"}}},
        {"blocks": {"part": {"type": "Mux"}, "b": {"type": "Sum"}}},
    ),
]


@pytest.mark.parametrize(("base", "top", "result"), MERGES)
def test_merge(base: Any, top: Any, result: Any) -> None:
    assert merged(base, top) == result


PLAIN = st.recursive(
    st.integers() | st.text(max_size=3) | st.lists(st.integers(), max_size=2),
    lambda inner: st.dictionaries(st.sampled_from("abcd"), inner, max_size=4),
    max_leaves=12,
)
MAPPING = st.dictionaries(st.sampled_from("abcd"), PLAIN, max_size=4)


@given(MAPPING, MAPPING)
def test_merging_keeps_the_top_and_what_it_leaves_alone(a: Any, b: Any) -> None:
    both = merged(a, b)
    assert merged(a, {}) == merged({}, a) == merged(a, a) == a
    assert merged(both, b) == both
    assert both.keys() == a.keys() | b.keys()
    for key, value in both.items():
        if key not in b:
            assert value == a[key]
        elif not isinstance(b[key], dict):
            assert value == b[key]
        elif isinstance(a.get(key), dict):
            assert value == merged(a[key], b[key])


def test_extends_is_relative_to_the_file_it_stands_in(tmp_path: Path) -> None:
    plain = loaded(
        tmp_path,
        {
            "g.yaml": "extends: deep/a.yaml\nrun: {seed: 3}\n",
            "deep/a.yaml": "extends: b\nrun: {dt: 0.02, seed: 2}\n",
            "deep/b.yaml": "extends: ../base.yaml\nrun: {until: 1.0, seed: 1}\n",
            "base.yaml": SOUND,
        },
    )
    assert plain["run"] == {"dt": 0.02, "until": 1.0, "seed": 3}
    assert plain["blocks"]["track"] == {"type": "LinePath"}
    assert "extends" not in plain


def test_later_ones_of_a_list_lie_on_top(tmp_path: Path) -> None:
    files = {"g.yaml": "extends: [a, b]\nz: 0\n", "a.yaml": "x: 1\ny: 1\n", "b.yaml": "y: 2\n"}
    assert loaded(tmp_path, files) == {"x": 1, "y": 2, "z": 0}


def test_a_shipped_graph_by_name_from_anywhere(tmp_path: Path) -> None:
    plain = loaded(tmp_path, {"g.yaml": "extends: line_actuator_failure\ngraph: mine\n"})
    assert plain["graph"] == "mine"
    assert plain["blocks"]["adaptive"]["part"] == "parts/adaptive_snn.yaml"
    assert Path(read_graph("line_actuator_failure")[0].where.file) == (
        SHIPPED / "line_actuator_failure.yaml"
    )


def test_ones_own_file_goes_before_a_shipped_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "line_actuator_failure.yaml").write_text("graph: own\n", encoding="utf-8")
    assert read_graph("line_actuator_failure")[0].plain() == {"graph": "own"}


def test_a_part_is_inlined_and_what_stands_in_its_entry_lies_on_top(tmp_path: Path) -> None:
    entry = "{graph: sub/p.yaml, params: {k: 5}, blocks: {s: {signs: [1, 1]}, g: {gain: 3}}}"
    plain = loaded(tmp_path, {"g.yaml": with_part(("{graph: p.yaml}", entry)), "sub/p.yaml": PART})
    part = plain["blocks"]["p"]
    assert part["part"] == "sub/p.yaml"
    assert "graph" not in part
    assert part["params"] == {"k": 5}
    assert part["blocks"]["g"] == {"type": "Gain", "gain": 3}
    assert part["blocks"]["s"] == {"type": "Sum", "signs": [1, 1]}
    assert part["inputs"]["a"] == "Twist"


def test_params_of_a_part_reach_its_blocks_and_no_others(tmp_path: Path) -> None:
    text = with_part(("{graph: p.yaml}", "{graph: p.yaml, params: {k: $k}}"), "params: {k: 7}\n")
    assert problems(tmp_path, {"g.yaml": text, "p.yaml": PART}) == []
    network = runtime.load(tmp_path / "g.yaml").network
    assert network.entries["p.g"].block.value("gain") == 7.0


@pytest.mark.parametrize("name", ["part", "blocks", "params", "graph", "type", "wires"])
def test_a_block_may_be_named_like_a_section(name: str, tmp_path: Path) -> None:
    text = changed(
        SOUND,
        ("  track: {type: LinePath}", f"  {name}: {{type: LinePath, y: $y}}"),
        ("track.path", f"{name}.path"),
        "params: {y: 2.0}\n",
    )
    assert problems(tmp_path, {"g.yaml": text}) == []
    assert runtime.load(tmp_path / "g.yaml").network.entries[name].block.value("y") == 2.0


def test_null_takes_out_an_inner_block(tmp_path: Path) -> None:
    entry = "{graph: p.yaml, blocks: {g: null}, params: {k: null}, wires: {g: null, s: null}}"
    text = with_part(("{graph: p.yaml}", entry))
    assert problems(tmp_path, {"g.yaml": text, "p.yaml": PART}) == []
    assert "p.g" not in runtime.load(tmp_path / "g.yaml").network.entries


def test_files_of_modules_are_relative_to_the_file_that_names_them(tmp_path: Path) -> None:
    files = {"g.yaml": "extends: a/b.yaml\n", "a/b.yaml": "blocks: {x: {type: X, module: m.py}}\n"}
    plain = loaded(tmp_path, files)
    assert plain["blocks"]["x"]["module"] == str(tmp_path / "a" / "m.py")


NO_GRAPHS = "shipped graphs: " + ", ".join(sorted(path.stem for path in SHIPPED.glob("*.yaml")))
REFUSED: dict[str, tuple[dict[str, str | bytes], list[str]]] = {
    "misspelt": (
        {"g.yaml": "extends: bas.yaml\n", "base.yaml": SOUND},
        ["g.yaml:1:10: extends: 'bas.yaml': no such graph, did you mean 'base.yaml'?"],
    ),
    "missing": (
        {"g.yaml": "extends: nowhere\n"},
        [f"g.yaml:1:10: extends: 'nowhere': no such graph; {NO_GRAPHS}"],
    ),
    "misspelt, and shipped": (
        {"g.yaml": "extends: [conditions/turn_los, lorenz, gallery/pendulm]\n"},
        [
            "g.yaml:1:11: extends: 'conditions/turn_los': no such graph, did you mean "
            "'conditions/turn_loss_35' or 'conditions/turn_loss_50'?",
            "g.yaml:1:32: extends: 'lorenz': no such graph, did you mean "
            "'gallery/published/lorenz'?",
            "g.yaml:1:40: extends: 'gallery/pendulm': no such graph, did you mean "
            "'gallery/pendulum'?",
        ],
    ),
    "all that are missing": (
        {
            "g.yaml": "extends: [qqqqq, b.yaml]\nblocks: {p: {graph: 3}, q: {graph: zzzzz.yaml}}\n",
            "b.yaml": "a: [",
        },
        [
            "b.yaml:1:5: not valid YAML: expected a value here",
            f"g.yaml:1:11: extends: 'qqqqq': no such graph; {NO_GRAPHS}",
            "g.yaml:2:21: blocks.p.graph: expected the file of a part, got 3",
            f"g.yaml:2:36: blocks.q.graph: 'zzzzz.yaml': no such graph; {NO_GRAPHS}",
        ],
    ),
    "misspelt in a folder": (
        {"g.yaml": "extends: sub/bas.yaml\n", "sub/base.yaml": SOUND},
        ["g.yaml:1:10: extends: 'sub/bas.yaml': no such graph, did you mean 'sub/base.yaml'?"],
    ),
    "world without its folder": (
        {"g.yaml": changed(SOUND, "world: paper_room.yaml\n")},
        [
            "g.yaml:18:8: world: 'paper_room.yaml': no such world, did you mean "
            "'worlds/paper_room.yaml'?"
        ],
    ),
    "world that is broken": (
        {"g.yaml": changed(SOUND, "world: w.yaml\n"), "w.yaml": "circles: [[1, 2, r]]\n"},
        ["w.yaml:1:11: world.circles[0]: expected 3 numbers [x, y, r] in m, got [1, 2, 'r']"],
    ),
    "a number": (
        {"g.yaml": "extends: 3\n"},
        ["g.yaml:1:10: extends: expected a graph's file or name, got 3"],
    ),
    "a param": (
        {"g.yaml": "extends: $base\n"},
        ["g.yaml:1:10: extends: expected a graph's file or name, got the string '$base'"],
    ),
    "itself": (
        {"g.yaml": "extends: g.yaml\n"},
        ["g.yaml:1:10: extends: graphs refer to each other in a circle: g.yaml ▸ g.yaml"],
    ),
    "in a circle": (
        {"g.yaml": "extends: a\n", "a.yaml": "extends: b\n", "b.yaml": "extends: a\n"},
        [
            "b.yaml:1:10: extends: graphs refer to each other in a circle: g.yaml ▸ a.yaml ▸ "
            "b.yaml ▸ a.yaml"
        ],
    ),
    "a part of itself": (
        {
            "g.yaml": with_part(),
            "p.yaml": changed(PART, ("{type: Gain, gain: $k}", "{graph: p.yaml}")),
        },
        [
            "p.yaml:5:37: blocks.g.graph: graphs refer to each other in a circle: g.yaml ▸ p.yaml "
            "▸ p.yaml"
        ],
    ),
    "a folder": (
        {"g.yaml": "extends: d\n", "d/x.yaml": ""},
        [f"g.yaml:1:10: extends: 'd': is a folder; {NO_GRAPHS}"],
    ),
    "too long": (
        {"g.yaml": f"extends: {'a' * 5000}\n"},
        [f"g.yaml:1:10: extends: '{'a' * 60}': File name too long"],
    ),
    "no mapping": (
        {"g.yaml": "extends: b\n", "b.yaml": "- 1\n"},
        ["b.yaml:1:1: expected a mapping with blocks and wires, got [1]"],
    ),
    "empty": ({"g.yaml": "extends: b\n", "b.yaml": ""}, ["b.yaml: the file is empty"]),
    "not UTF-8": (
        {"g.yaml": "graph: a\n# Größe\n".encode("latin-1")},
        ["g.yaml:2:5: byte 0xF6 is not UTF-8; save the file as UTF-8"],
    ),
    "deleting nothing": (
        {"g.yaml": "extends: b\nblocks: {trak: null}\n", "b.yaml": SOUND},
        [
            "g.yaml:2:16: blocks.trak: expected {type: ...}, got nothing (null), did you mean "
            "'track'?"
        ],
    ),
    "in the base": (
        {"g.yaml": "extends: b\n", "b.yaml": changed(SOUND, ("LinePath", "LinePth"))},
        [
            "b.yaml:4:17: blocks.track.type: no block type 'LinePth', did you mean 'LinePath'?",
        ],
    ),
    "on top": (
        {"g.yaml": "extends: b\nblocks: {track: {yy: 3}}\n", "b.yaml": SOUND},
        ["g.yaml:2:18: blocks.track.yy: unknown parameter, did you mean 'y'?"],
    ),
}


@pytest.mark.parametrize("case", REFUSED.values(), ids=REFUSED.keys())
def test_what_cannot_be_read_is_told(
    case: tuple[dict[str, str | bytes], list[str]], tmp_path: Path
) -> None:
    files, messages = case
    assert problems(tmp_path, files) == messages


def test_a_byte_order_mark_and_crlf_move_no_place(tmp_path: Path) -> None:
    text = changed(SOUND, ("LinePath", "LinePth")).replace("\n", "\r\n")
    found = problems(tmp_path, {"g.yaml": b"\xef\xbb\xbf" + text.encode()})
    assert [line.split(": ")[0] for line in found] == ["g.yaml:4:17"]


def test_a_name_that_is_no_file(tmp_path: Path) -> None:
    for name in ("nowhere", "", "a\0b", "x" * 5000):
        with pytest.raises(GraphError):
            read_graph(tmp_path / name if name else name)
