"""Block diagrams are complete, have no overlaps, and are reproducible."""

from __future__ import annotations

import io
import math
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from functools import cache
from itertools import combinations, pairwise
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given
from hypothesis import strategies as st

import blocks
import runtime
from runtime.diagrams.formats import FORMATS, diagram
from runtime.diagrams.layout import Cell, DiagramLayout, Link, arrange, find_feedback
from runtime.diagrams.layout.tracks import Track, assign_slots
from runtime.diagrams.paint import (
    CONSTANT_TINT,
    CONTINUOUS_TINT,
    FRAME_FILLS,
    INK,
    LEAST_TYPE,
    PORT_INK,
    SOFT,
    TINTS,
    TITLE_HEIGHT,
    draw,
    tint_of,
)
from runtime.diagrams.picture import picture_of
from runtime.diagrams.sheet import LABEL_SIZE, BoxPlacement, Sheet, lay_out
from runtime.document import rate_text
from runtime.errors import UsageError
from runtime.network.network import Network
from tests.examples import examples

ROOT = Path(__file__).parents[3]
SVG = "{http://www.w3.org/2000/svg}"
CASE_A = ROOT / "graphs" / "line_actuator_failure.yaml"

NESTED = {
    "graph": 'nested & "quoted" <parts>',
    "run": {"dt": 0.001},
    "blocks": {
        "end": {"type": "Constant", "value": 1.0},
        "robot": {
            "inputs": {"v": "Scalar"},
            "outputs": {"theta": "noise.measured.theta", "x": "plant.pose.x"},
            "blocks": {
                "mux": {"type": "Mux"},
                "plant": {"type": "DifferentialDrive"},
                "noise": {"type": "PoseNoise", "dt": 0.02},
            },
            "wires": {
                "mux": {"v": "inputs.v"},
                "plant": {"command": "mux.out"},
                "noise": {"pose": "plant.pose"},
            },
        },
        "control": {
            "inputs": {"theta": "Scalar", "goal": "Scalar"},
            "outputs": {"v": "inner.v"},
            "blocks": {
                "sum": {"type": "Sum"},
                "inner": {
                    "inputs": {"error": "Scalar"},
                    "outputs": {"v": "add.out"},
                    "blocks": {"add": {"type": "Sum"}, "delay": {"type": "UnitDelay"}},
                    "wires": {
                        "add": {"terms": ["inputs.error", "delay.out"]},
                        "delay": {"input": "add.out"},
                    },
                },
            },
            "wires": {
                "sum": {"terms": ["inputs.goal", "inputs.theta"]},
                "inner": {"error": "sum.out"},
            },
        },
        "gain": {"type": "Gain", "gain": 2.0},
    },
    "wires": {
        "robot": {"v": "gain.out"},
        "gain": {"input": "control.v"},
        "control": {"theta": "robot.theta", "goal": "end.value"},
    },
}


@cache
def chain(n: int) -> Network:
    blocks: dict[str, object] = {"b0": {"type": "Constant", "value": 1.0}}
    blocks |= {f"b{i}": {"type": "Gain", "gain": 1.0} for i in range(1, n)}
    first = {"b1": {"input": "b0.value"}} if n > 1 else {}
    wires = first | {f"b{i}": {"input": f"b{i - 1}.out"} for i in range(2, n)}
    return runtime.load({"graph": "chain", "blocks": blocks, "wires": wires}).network


@cache
def network(case: str) -> Network:
    graph = runtime.load(NESTED if case.startswith("nested") else CASE_A)
    changed = {
        "without": lambda: graph.without("adaptive"),
        "bypass": lambda: graph.bypass("limit"),
        "nested_out": lambda: graph.without("control.inner.delay").bypass("gain", "robot.noise"),
    }
    return changed.get(case, lambda: graph)().network


CASES = ("full", "without", "bypass", "nested", "nested_out")


def all_wires(net: Network) -> Counter[tuple[str, str, bool]]:
    """The wires of a network: source, target, whether it belongs to a removed block."""
    live = ((str(w.source), w.target, False) for w in net.wires)
    return Counter((*live, *((str(w.source), w.target, True) for w in net.removed_wires)))


def svg_groups(text: str) -> list[ET.Element]:
    return [g for g in ET.fromstring(text).iter(f"{SVG}g") if g.get("data-kind")]


def test_another_format_is_refused_by_name() -> None:
    with pytest.raises(UsageError) as caught:
        diagram(chain(1), "gif")
    assert all(name in str(caught.value) for name in ("gif", *FORMATS))


@pytest.mark.parametrize("case", CASES)
def test_svg_shows_every_block_and_every_wire(case: str) -> None:
    net = network(case)
    groups = svg_groups(str(diagram(net, "svg")))
    drawn = {g.get("data-name"): g for g in groups if "block" in str(g.get("data-kind"))}
    assert drawn.keys() == net.entries.keys() | net.removed_entries.keys()
    for name, entry in {**net.entries, **net.removed_entries}.items():
        texts = [t.text for t in drawn[name].iter(f"{SVG}text")]
        is_sum = entry.cls is blocks.Sum and len(texts) > 1
        assert texts[:2] == [entry.short, "+" if is_sum else entry.cls.__name__]
        assert (drawn[name].get("data-kind") == "removed block") == (name in net.removed)
    wires: Counter[tuple[str, str, bool]] = Counter()
    for group in groups:
        if "wire" in str(group.get("data-kind")):
            title = group.find(f"{SVG}title")
            ends = [line.split(" → ") for line in str(title.text).splitlines() if " → " in line]
            ghost = group.get("data-kind") == "removed wire"
            wires.update((source, target, ghost) for source, target in ends)
            heads = [p for p in group.iter(f"{SVG}path") if p.get("fill")]
            assert len(heads) == len(ends)
    assert wires == all_wires(net)


@pytest.mark.parametrize("case", CASES)
def test_dot_shows_every_block_and_every_wire(case: str) -> None:
    net = network(case)
    text = str(diagram(net, "dot"))
    found: Counter[tuple[str, str, bool]] = Counter()
    for line in text.splitlines():
        edge = re.match(r'\s*"(.+?)":"out_(.+?)":e -> "(.+?)":"in_(.+?)":w \[(.*)\]$', line)
        if edge:
            source, target = f"{edge[1]}.{edge[2]}", f"{edge[3]}.{edge[4]}"
            found[source, target, "style=dashed" in edge[5]] += 1
    assert found == all_wires(net)
    nodes = dict(re.findall(r'^\s*"([^"]+)" \[label=<(.*)>\]$', text, flags=re.MULTILINE))
    assert nodes.keys() == net.entries.keys() | net.removed_entries.keys()
    for name, table in nodes.items():
        ET.fromstring(table)
        assert ("DASHED" in table) == (name in net.removed)


@pytest.mark.parametrize("case", CASES)
def test_mermaid_shows_every_block_and_every_wire(case: str) -> None:
    net = network(case)
    text = str(diagram(net, "mermaid"))
    found: Counter[tuple[str, str, bool]] = Counter()
    edge = r'^\s*b_(\w+) (-\.->|-->)\|"(.+?) → (.+?)"\| b_(\w+)$'
    for source, arrow, out, into, target in re.findall(edge, text, flags=re.MULTILINE):
        ends = f"{source.replace('__', '.')}.{out}", f"{target.replace('__', '.')}.{into}"
        found[(*ends, arrow == "-.->")] += 1
    assert found == all_wires(net)
    names = re.findall(r'^\s*b_(\w+)\["<b>', text, flags=re.MULTILINE)
    assert {n.replace("__", ".") for n in names} == net.entries.keys() | net.removed_entries.keys()
    gone = re.findall(r"^\s*class (\S+) removed$", text, flags=re.MULTILINE)
    listed = {n[2:].replace("__", ".") for line in gone for n in line.split(",")}
    assert listed == net.removed.keys()
    opened = len(re.findall(r"^\s*subgraph ", text, flags=re.MULTILINE))
    assert opened == len(re.findall(r"^\s*end$", text, flags=re.MULTILINE))


@pytest.mark.parametrize("case", CASES)
def test_png_is_a_picture_of_the_same_form_as_the_svg(case: str) -> None:
    from matplotlib.image import imread

    net = network(case)
    data = diagram(net, "png")
    assert isinstance(data, bytes)
    pixels = imread(io.BytesIO(data))
    root = ET.fromstring(str(diagram(net, "svg")))
    assert pixels.shape[1] == pytest.approx(2 * float(str(root.get("width"))), abs=2)
    assert pixels.shape[0] == pytest.approx(2 * float(str(root.get("height"))), abs=2)
    assert (pixels[:16, :, :3] == 1.0).all()
    # The same geometry: where the svg has a box, the png has its border and its tint.
    shift = {"x": 16.0, "y": 16.0 + TITLE_HEIGHT, "width": 0.0}
    for rect in root.findall(f".//{SVG}g[@data-kind='block']/{SVG}rect"):
        x, y, width = (float(str(rect.get(key))) + by for key, by in shift.items())
        fill = [int(str(rect.get("fill"))[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        assert pixels[int(2 * y + 6), int(2 * x + width), :3] == pytest.approx(fill, abs=0.01)
        assert pixels[int(2 * y), int(2 * x + width), :3].mean() < 0.7


def test_svg_is_self_contained() -> None:
    text = str(diagram(network("nested"), "svg"))
    root = ET.fromstring(text)
    assert root.get("viewBox") == f"0 0 {root.get('width')} {root.get('height')}"
    title = root.find(f"{SVG}title")
    assert title is not None and title.text == NESTED["graph"]
    # Nothing is loaded, and no id or class clashes with those of a page around it.
    for word in ("href", "url(", "<style", "<script", " id=", " class="):
        assert word not in text
    shown = runtime.load(NESTED).diagram()._repr_svg_()
    assert shown == runtime.load(NESTED)._repr_svg_()
    assert shown.replace(' style="max-width: 100%; height: auto"', "") == text


def test_a_signal_type_is_written_once_per_output_that_changes_it() -> None:
    net = network("full")
    labels = [g for g in svg_groups(str(diagram(net, "svg"))) if g.get("data-kind") == "type"]
    written = Counter(str(g.get("data-name")) for g in labels)
    picture = picture_of(net)
    before: dict[str, set[str]] = {}
    for each in picture.nets:
        for name, _ in each.targets:
            before.setdefault(name, set()).add(each.type)
    changed = {
        ".".join(each.source)
        for each in picture.nets
        if each.type not in before.get(each.source[0], set())
    }
    assert written == Counter(changed)
    by_name = {g.get("data-name"): "".join(g.itertext()).strip() for g in labels}
    assert by_name["plant.pose"] == "Pose"
    assert by_name["error.position"] == "Scalar"
    assert "limit.limited" not in by_name  # a Twist as what goes in


def test_a_box_says_its_value() -> None:
    graph = runtime.Graph(dt=0.01, until=1.0)
    for name, block in {
        "three": blocks.Constant(value=3.0),
        "half": blocks.Gain(gain=-0.5),
        "plant": blocks.TransferFunction(numerator=[0.5], denominator=[2.0, 0.0, -1.0]),
        "sum": blocks.Integrator(),
        "long": blocks.Function(expression=" + ".join(["u"] * 30)),
        "root": blocks.Function(expression="sqrt(1 + u)"),
    }.items():
        graph = graph.add(name, block)
    names = ["three", "half", "plant", "sum", "root", "long"]
    outputs = {"three": "value", "half": "out", "plant": "out", "sum": "out", "root": "out"}
    inputs = {"root": "u", "long": "u"}
    for left, right in pairwise(names):
        graph = graph.connect(f"{left}.{outputs[left]}", f"{right}.{inputs.get(right, 'input')}")
    boxes = picture_of(graph.network).boxes
    values = {name: box.value for name, box in boxes.items()}
    assert values["three"] == "3" and values["half"] == "× −0.5" and values["sum"] == "1\ns"
    assert values["plant"] == "0.5\n2 s² − 1"
    assert values["root"] == "sqrt(1 + u)" and values["long"] == ""
    texts = [t.text for t in ET.fromstring(str(graph.diagram("svg"))).iter(f"{SVG}text")]
    assert {"3", "× −0.5", "2 s² − 1", "sqrt(1 + u)"} <= set(texts)


def test_text_on_boxes_can_be_read() -> None:
    """A contrast of 4.5 at least, as WCAG 2 asks for small text."""

    def luminance(colour: str) -> float:
        channels = [int(colour[i : i + 2], 16) / 255 for i in (1, 3, 5)]
        linear = [c / 12.92 if c <= 0.03928 else ((c + 0.055) / 1.055) ** 2.4 for c in channels]
        return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]

    for ink in (INK, SOFT, PORT_INK):
        for tint in (*TINTS, CONSTANT_TINT, CONTINUOUS_TINT, *FRAME_FILLS):
            low, high = sorted((luminance(ink), luminance(tint)))
            assert (high + 0.05) / (low + 0.05) >= 4.5, (ink, tint)


def test_removed_blocks_are_marked() -> None:
    boxes = picture_of(network("without")).boxes
    assert {n for n, box in boxes.items() if box.fate == "removed"} == {
        *("adaptive.snn_v", "adaptive.snn_omega", "adaptive.join")
    }
    assert "removed" in str(diagram(network("without"), "svg"))
    assert picture_of(network("bypass")).boxes["limit"].fate == "bypassed"
    root = ET.fromstring(str(diagram(network("bypass"), "svg")))
    groups = root.findall(f".//{SVG}g[@data-kind='removed block']")
    assert [g.get("data-name") for g in groups] == ["limit"]
    rect = groups[0].find(f"{SVG}rect")
    assert rect is not None and rect.get("stroke-dasharray")
    assert "bypassed" in [t.text for t in groups[0].iter(f"{SVG}text")]
    for group in root.findall(f".//{SVG}g[@data-kind='removed wire']"):
        lines = [p for p in group.findall(f"{SVG}path") if not p.get("fill")]
        assert lines and all(line.get("stroke-dasharray") for line in lines)


@pytest.mark.parametrize(
    ("period", "text"),
    [
        *((0.001, "1 kHz"), (0.01, "100 Hz"), (1.0, "1 Hz"), (4.0, "0.25 Hz")),
        *((1e-4, "10 kHz"), (0.003, "333.3 Hz"), (0.0004, "2.5 kHz")),
    ],
)
def test_rates_as_text(period: float, text: str) -> None:
    assert rate_text(period, "s") == text


def test_boxes_show_their_rate_and_differ_in_tint() -> None:
    root = ET.fromstring(str(diagram(network("full"), "svg")))
    seen: dict[str, set[str]] = {}
    for group in root.findall(f".//{SVG}g[@data-kind='block']"):
        texts = [str(t.text) for t in group.iter(f"{SVG}text")]
        rect = group.find(f"{SVG}rect")
        rate = next((t for t in texts if t.endswith("Hz") or t == "constant"), "")
        if not rate:
            continue  # a Sum
        seen.setdefault(rate, set()).add(str(rect.get("fill")) if rect is not None else "")
    assert seen.keys() == {"1 kHz", "100 Hz", "constant"}
    assert all(len(fills) == 1 for fills in seen.values())
    assert len(set.union(*seen.values())) == 3
    legend = root.find(f".//{SVG}g[@data-kind='legend']")
    assert legend is not None
    # The ensembles' input "learn" is not wired to anything.
    assert {t.text for t in legend.iter(f"{SVG}text")} == {*seen, "unconnected"}


USUAL = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0]


@given(others=st.sets(st.sampled_from(USUAL)), period=st.sampled_from(USUAL))
def test_a_usual_rate_has_the_same_tint_in_every_diagram(others: set[float], period: float) -> None:
    used: list[str] = []
    for other in sorted(others - {period}):
        used.append(tint_of(other, used))
    assert tint_of(period, used) == tint_of(period, [])


def test_tints_can_be_told_apart() -> None:
    """CIE 1976 distances: 2.3 is just noticeable, and boxes are not side by side."""
    tints = [(*rgb_to_lab(tint),) for tint in (*TINTS, CONSTANT_TINT, CONTINUOUS_TINT)]
    assert min(math.dist(a, b) for a, b in combinations(tints, 2)) > 8.0
    neighbours = [math.dist(a, b) for a, b in pairwise(tints[: len(TINTS)])]
    assert min(neighbours) > 20.0


def rgb_to_lab(colour: str) -> tuple[float, float, float]:
    """L*, a*, b* of an sRGB colour, D65 (IEC 61966-2-1, CIE 15)."""
    parts = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in parts]
    rows = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
    white = (0.95047, 1.0, 1.08883)
    ratios = [
        sum(k * c for k, c in zip(row, linear, strict=True)) / w
        for row, w in zip(rows, white, strict=True)
    ]
    x, y, z = (r ** (1 / 3) if r > 0.008856 else 7.787 * r + 16 / 116 for r in ratios)
    return 116 * y - 16, 500 * (x - y), 200 * (y - z)


def corners(place: BoxPlacement) -> tuple[float, float, float, float]:
    return place.x, place.y, place.x + place.width, place.y + place.height


def overlap(a: tuple[float, ...], b: tuple[float, ...], margin: float = 0.0) -> bool:
    across = a[0] < b[2] - margin and b[0] < a[2] - margin
    return across and a[1] < b[3] - margin and b[1] < a[3] - margin


def run_box(a: tuple[float, float], b: tuple[float, float]) -> tuple[float, float, float, float]:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[0], b[0]), max(a[1], b[1])


def sheet_of(case: str) -> Sheet:
    return lay_out(picture_of(network(case)))


@pytest.mark.parametrize("case", CASES)
def test_boxes_and_frames_stay_apart(case: str) -> None:
    sheet = sheet_of(case)
    boxes = {name: corners(place) for name, place in sheet.boxes.items()}
    frames = {name: corners(place) for name, place in sheet.frames.items()}
    for a, b in combinations(boxes.values(), 2):
        assert not overlap(a, b)
    for name, frame in frames.items():
        for other, box in {**boxes, **frames}.items():
            if other.startswith(f"{name}."):
                assert frame[0] < box[0] and frame[1] < box[1]
                assert frame[2] > box[2] and frame[3] > box[3]
            elif other != name and not name.startswith(f"{other}."):
                assert not overlap(frame, box)


@pytest.mark.parametrize("case", CASES)
def test_wires_join_their_ports_and_cross_no_box(case: str) -> None:
    sheet = sheet_of(case)
    obstacles = {n: corners(p) for n, p in {**sheet.boxes, **sheet.frames}.items()}
    for (i, target), line in sheet.lines.items():
        source = sheet.picture.nets[i].source
        start, end = sheet.boxes[source[0]], sheet.boxes[target[0]]
        assert line[0] == pytest.approx((start.x + start.width, start.outputs[source[1]]))
        assert line[-1] == pytest.approx((end.x, end.inputs[target[1]]))
        around = (source[0], target[0])
        for a, b in pairwise(line):
            assert a[0] == b[0] or a[1] == b[1]
            for name, place in obstacles.items():
                # A wire may be inside the frames of the parts that its ends belong to.
                if not any(end.startswith(f"{name}.") for end in around):
                    assert not overlap(run_box(a, b), place, margin=0.05), (source, target, name)


@pytest.mark.parametrize("case", ["full", "without", "bypass"])
def test_the_flow_reads_from_left_to_right(case: str) -> None:
    sheet = sheet_of(case)
    back = set()
    for (i, target), line in sheet.lines.items():
        if any(b[0] < a[0] for a, b in pairwise(line)):
            back.add((sheet.picture.nets[i].source, target))
            lowest = max(place.y + place.height for place in sheet.boxes.values())
            assert max(y for _, y in line) > lowest
        else:
            source = sheet.boxes[sheet.picture.nets[i].source[0]]
            assert source.x + source.width < sheet.boxes[target[0]].x
    assert back == {(("plant", "pose"), (name, "pose")) for name in ("match", "error")}


def test_a_loop_through_a_part_is_opened_at_an_output_without_feedthrough() -> None:
    sheet = sheet_of("nested")
    back = {
        (sheet.picture.nets[i].source, target)
        for (i, target), line in sheet.lines.items()
        if any(b[0] < a[0] for a, b in pairwise(line))
    }
    assert back == {
        (("robot.noise", "measured.theta"), ("control.sum", "terms[1]")),
        (("control.inner.delay", "out"), ("control.inner.add", "terms[1]")),
    }


def test_case_a_has_few_crossings() -> None:
    """Ports in their declared order cost three more than ports in the best order would."""
    sheet = sheet_of("full")
    runs = [(i, *run_box(a, b)) for (i, _), line in sheet.lines.items() for a, b in pairwise(line)]
    crossings = {
        (i, k, h[0], v[1])
        for (i, *v), (k, *h) in combinations([*runs, *runs[::-1]], 2)
        if i != k and v[0] == v[2] and h[1] == h[3]
        if h[0] < v[0] < h[2] and v[1] < h[1] < v[3]
    }
    assert len({frozenset((i, k)) for i, k, *_ in crossings}) <= 5


def test_ports_keep_their_order_and_signs() -> None:
    """Inputs are drawn as declared or written, whatever the wires; a Sum shows its signs."""
    for name, signs in (("plain", None), ("signed", [1.0, -1.0, 1.0])):
        graph = runtime.load("starters/adaptive")
        if signs is not None:
            graph = graph.set("total.signs", signs)
        picture = picture_of(graph.network)
        shown = list(picture.boxes["total"].signs.values())
        assert shown == ["+", "−" if name == "signed" else "+", "+"]
        sheet = lay_out(picture)
        for box, place in sheet.boxes.items():
            for ports in (place.inputs, place.outputs):
                assert list(ports.values()) == sorted(ports.values()), box
            spec = graph.network.entries[box].cls.spec
            written = [port.partition("[")[0] for port in place.inputs]
            assert sorted(written, key=list(spec.inputs).index) == written


def test_a_rate_has_one_colour_in_all_diagrams() -> None:
    found: dict[str, set[str]] = {}
    for dts in ((0.001, 0.01, 0.1), (0.01,), (0.1, 0.01)):
        made = runtime.Graph(dt=min(dts))
        for i, dt in enumerate(dts):
            made = made.add(f"b{i}", blocks.UnitDelay(signal="Scalar"), dt=dt)
            made = made.add(f"c{i}", blocks.Constant(value=1.0)).connect(
                f"c{i}.value", f"b{i}.input"
            )
        root = ET.fromstring(str(made.diagram("svg")))
        for group in root.findall(f".//{SVG}g[@data-kind='block']"):
            texts = [str(t.text) for t in group.iter(f"{SVG}text")]
            rate = next(t for t in texts if t.endswith("Hz") or t == "constant")
            rect = group.find(f"{SVG}rect")
            assert rect is not None
            found.setdefault(rate, set()).add(str(rect.get("fill")))
    assert all(len(colours) == 1 for colours in found.values())
    assert len(found) == 4


def test_a_pdf_has_its_text(tmp_path: Path) -> None:
    first, again = (diagram(chain(2), "pdf") for _ in range(2))
    assert isinstance(first, bytes)
    assert first.startswith(b"%PDF-") and first == again


@st.composite
def graphs(draw: st.DrawFn) -> tuple[list[Cell], list[Link]]:
    cells = []
    for i in range(draw(st.integers(1, 14))):
        ins, outs = draw(st.integers(0, 3)), draw(st.integers(1, 3))
        rows = max(ins, outs)
        cell = Cell(f"c{i}", draw(st.integers(60, 140)), 40 + 16 * rows)
        cell.inputs, cell.outputs = [f"i{k}" for k in range(ins)], [f"o{k}" for k in range(outs)]
        cell.input_ys = [30.0 + (rows - ins) * 8 + 16 * k for k in range(ins)]
        cell.output_ys = [30.0 + (rows - outs) * 8 + 16 * k for k in range(outs)]
        cell.fixed, cell.stretch = draw(st.booleans()), draw(st.booleans())
        cells.append(cell)
    ends = [(cell.name, pin) for cell in cells for pin in cell.outputs]
    wires: dict[tuple[str, str], list[tuple[str, str]]] = {}
    for cell in cells:
        for pin in cell.inputs:
            if draw(st.integers(0, 4)):
                wires.setdefault(draw(st.sampled_from(ends)), []).append((cell.name, pin))
    links = [
        Link(
            source, tuple(targets), breaks_loop=draw(st.booleans()), label=draw(st.integers(0, 60))
        )
        for source, targets in wires.items()
    ]
    return cells, links


def cell_boxes(
    cells: list[Cell], layout: DiagramLayout
) -> dict[str, tuple[float, float, float, float]]:
    found = {}
    for cell in cells:
        x, y = layout.positions[cell.name]
        found[cell.name] = x, y, x + cell.width, y + cell.height
    return found


SLOW = examples(60, suppress_health_check=[HealthCheck.too_slow])


@SLOW
@given(graphs())
def test_any_layout_keeps_boxes_and_wires_apart(graph: tuple[list[Cell], list[Link]]) -> None:
    cells, links = graph
    layout = arrange(cells, links)
    boxes = cell_boxes(cells, layout)
    by_name = {cell.name: cell for cell in cells}
    for a, b in combinations(boxes.values(), 2):
        assert not overlap(a, b)
    for (i, (name, pin)), line in layout.routes.items():
        source, out = links[i].source
        start, end = boxes[source], boxes[name]
        assert line[0] == pytest.approx((start[2], start[1] + by_name[source].output_y(out)))
        assert line[-1] == pytest.approx((end[0], end[1] + by_name[name].input_y(pin)))
        forward = (i, (name, pin)) not in layout.feedback
        assert not forward or start[2] < end[0]
        for a, b in pairwise(line):
            assert a[0] == b[0] or a[1] == b[1]
            assert not forward or a[0] <= b[0]
            run = run_box(a, b)
            assert run[0] >= 0 and run[2] <= layout.width + 0.01 and run[3] <= layout.height + 0.01
            for box in boxes.values():
                assert not overlap(run, box, margin=0.05)


@SLOW
@given(graphs())
def test_wires_of_different_outputs_never_lie_on_each_other(
    graph: tuple[list[Cell], list[Link]],
) -> None:
    layout = arrange(*graph)
    runs = [(i, run_box(*ab)) for (i, _), line in layout.routes.items() for ab in pairwise(line)]
    for (i, a), (k, b) in combinations(runs, 2):
        for along, across in ((0, 1), (1, 0)):
            flat = a[across] == a[across + 2] and b[across] == b[across + 2]
            if i != k and flat and abs(a[across] - b[across]) < 2.0:
                shared = min(a[along + 2], b[along + 2]) - max(a[along], b[along])
                assert shared < 1.0


@SLOW
@given(graphs())
def test_without_the_feedback_there_is_no_loop(graph: tuple[list[Cell], list[Link]]) -> None:
    import networkx as nx

    cells, links = graph
    back = find_feedback([cell.name for cell in cells], links)
    wires = [(link.source[0], name, i) for i, link in enumerate(links) for name, _ in link.targets]
    forward = nx.DiGraph([(u, v) for u, v, i in wires if (i, v) not in back])
    assert nx.is_directed_acyclic_graph(forward)
    for i, name in back:
        # Each of them closes a loop, so that none is reversed needlessly.
        source = links[i].source[0]
        assert source == name or nx.has_path(forward, name, source)


def pin_cell(name: str, ins: int, outs: int) -> Cell:
    ys = [[20.0 + 16 * k for k in range(n)] for n in (ins, outs)]
    pins = [f"i{k}" for k in range(ins)], [f"o{k}" for k in range(outs)]
    return Cell(name, 80, 80, *pins, *ys)


def test_a_loop_is_opened_at_an_output_without_feedthrough() -> None:
    names = ["plant", "sensor", "law"]
    wires = [("plant", "sensor"), ("sensor", "law"), ("law", "plant")]
    for remembers in range(3):
        links = [
            Link((u, "o"), ((v, "i"),), breaks_loop=k == remembers)
            for k, (u, v) in enumerate(wires)
        ]
        assert find_feedback(names, links) == {(remembers, wires[remembers][1])}


def test_ports_are_ordered_so_that_parallel_wires_do_not_cross() -> None:
    left, right = pin_cell("left", 0, 3), pin_cell("right", 3, 0)
    links = [Link(("left", f"o{k}"), (("right", f"i{2 - k}"),)) for k in range(3)]
    layout = arrange([left, right], links)
    assert all(len(line) == 2 for line in layout.routes.values())
    fixed = pin_cell("left", 0, 3), pin_cell("right", 3, 0)
    for cell in fixed:
        cell.fixed = True
    layout = arrange(list(fixed), links)
    assert fixed[0].outputs == ["o0", "o1", "o2"] and fixed[1].inputs == ["i0", "i1", "i2"]
    assert sorted(len(line) for line in layout.routes.values())[-1] > 2


def test_boxes_are_ordered_so_that_trees_do_not_cross() -> None:
    cells = [pin_cell("root", 0, 1), *(pin_cell(f"m{k}", 1, 1) for k in range(3))]
    cells += [pin_cell(f"leaf{k}", 1, 0) for k in range(6)]
    links = [Link(("root", "o0"), tuple((f"m{k}", "i0") for k in range(3)))]
    links += [Link((f"m{k}", "o0"), ((f"leaf{k}", "i0"), (f"leaf{5 - k}", "i0"))) for k in range(3)]
    layout = arrange(cells, links)
    heights = {name: y for name, (_, y) in layout.positions.items()}
    parents = sorted(range(3), key=lambda k: heights[f"m{k}"])
    leaves = sorted(range(6), key=lambda k: heights[f"leaf{k}"])
    assert [min(k, 5 - k) for k in leaves] == [k for k in parents for _ in range(2)]


def test_wires_that_exchange_heights_take_a_detour() -> None:
    one, other = Track([10.0], [50.0]), Track([50.0], [10.0])
    assert assign_slots([one, other]) == 3
    (detour,) = [track for track in (one, other) if track.then is not None]
    assert detour.then is not None
    straight = other if detour is one else one
    assert detour.slot < straight.slot < detour.then.slot
    assert 10.0 < detour.rights[0] < 50.0


def test_a_block_may_feed_itself() -> None:
    cell = pin_cell("alone", 1, 1)
    layout = arrange([cell], [Link(("alone", "o0"), (("alone", "i0"),))])
    (line,) = layout.routes.values()
    assert layout.feedback == {(0, ("alone", "i0"))}
    assert max(y for _, y in line) > layout.positions["alone"][1] + cell.height


def test_long_wires_are_straight() -> None:
    cells = [pin_cell("a", 0, 2), *(pin_cell(f"b{k}", 1, 1) for k in range(4)), pin_cell("c", 2, 0)]
    links = [Link(("a", "o0"), (("b0", "i0"),)), Link(("b3", "o0"), (("c", "i0"),))]
    links += [Link((f"b{k}", "o0"), ((f"b{k + 1}", "i0"),)) for k in range(3)]
    links.append(Link(("a", "o1"), (("c", "i1"),)))
    layout = arrange(cells, links)
    long = layout.routes[len(links) - 1, ("c", "i1")]
    assert len(long) <= 6
    xs = [layout.positions[name][0] for name in ("a", "b0", "b1", "b2", "b3", "c")]
    assert xs == sorted(xs)


def test_one_block_alone() -> None:
    net = chain(1)
    assert [g.get("data-kind") for g in svg_groups(str(diagram(net, "svg")))] == ["block", "title"]
    for name in FORMATS:
        assert diagram(net, name)


@pytest.mark.parametrize("n", [2, 200, pytest.param(2000, marks=pytest.mark.slow)])
def test_a_chain_is_one_straight_line(n: int) -> None:
    net = chain(n)
    sheet = lay_out(picture_of(net))
    assert len({line[0][1] for line in sheet.lines.values()}) == 1
    assert all(len(line) == 2 for line in sheet.lines.values())
    xs = [sheet.boxes[f"b{i}"].x for i in range(n)]
    assert xs == sorted(set(xs))
    for name in ("svg", "dot", "mermaid"):
        assert str(diagram(net, name)).count("Gain") >= n - 1


@pytest.mark.parametrize("n", [60, pytest.param(2000, marks=pytest.mark.slow)])
def test_a_long_chain_as_png(n: int) -> None:
    assert bytes(diagram(chain(n), "png")).startswith(b"\x89PNG")  # type: ignore[arg-type]


@pytest.mark.slow
def test_the_same_graph_gives_the_same_bytes_in_every_process() -> None:
    code = (
        "import hashlib, sys, runtime\n"
        f"for name in ({str(CASE_A)!r}, {NESTED!r}):\n"
        "    for format in ('svg', 'png', 'dot', 'mermaid'):\n"
        "        made = runtime.load(name).diagram(format)\n"
        "        made = made if isinstance(made, bytes) else made.encode()\n"
        "        print(hashlib.sha256(made).hexdigest())\n"
    )
    started = [
        subprocess.Popen(
            [sys.executable, "-c", code],
            cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": seed},
            stdout=subprocess.PIPE,
            text=True,
        )
        for seed in ("1", "2")
    ]
    runs = [process.communicate()[0] for process in started]
    assert [process.returncode for process in started] == [0, 0]
    assert runs[0] == runs[1]
    assert len(set(runs[0].split())) == 8


@pytest.mark.skipif(shutil.which("dot") is None, reason="Graphviz is not installed")
@pytest.mark.parametrize("case", CASES)
def test_graphviz_reads_the_dot(case: str) -> None:
    net = network(case)
    done = subprocess.run(
        ["dot", "-Tplain"],
        input=str(diagram(net, "dot")),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    nodes = [line for line in done.stdout.splitlines() if line.startswith("node ")]
    assert len(nodes) == len(net.entries) + len(net.removed_entries)


def long_chain(n: int) -> Network:
    graph = runtime.Graph(dt=0.01, until=1.0).add("b0", blocks.Constant(value=1.0))
    for i in range(1, n):
        graph = graph.add(f"b{i}", blocks.Gain(gain=2.0))
        source = "value" if i == 1 else "out"
        graph = graph.connect(f"b{i - 1}.{source}", f"b{i}.input")
    return graph.network


@pytest.mark.parametrize("paper", [252.0, 516.0])
@pytest.mark.parametrize("case", ["chain", "full", "nested"])
def test_on_paper_a_diagram_is_in_rows_whose_wires_stay_apart(case: str, paper: float) -> None:
    net = long_chain(30) if case == "chain" else network(case)
    drawing = draw(picture_of(net), paper)
    assert drawing.width <= paper * (1.0 + 1e-9)
    sheet = lay_out(picture_of(net), paper * LABEL_SIZE / LEAST_TYPE)
    flat = lay_out(picture_of(net))
    is_wide = flat.width > paper * LABEL_SIZE / LEAST_TYPE
    assert is_wide == (sheet.height > flat.height) == (sheet.width < flat.width)
    boxes = list(sheet.boxes.values())
    for one, other in combinations(boxes, 2):
        apart_x = one.x + one.width <= other.x or other.x + other.width <= one.x
        apart_y = one.y + one.height <= other.y or other.y + other.height <= one.y
        assert apart_x or apart_y
    for (i, (name, port)), line in sheet.lines.items():
        source, out = sheet.picture.nets[i].source
        box = sheet.boxes[source]
        assert line[0] == pytest.approx((box.x + box.width, box.outputs[out]))
        assert line[-1] == pytest.approx((sheet.boxes[name].x, sheet.boxes[name].inputs[port]))
        for (x, y), (to, below) in pairwise(line):
            assert x == pytest.approx(to) or y == pytest.approx(below)
            assert min(x, to) >= -1e-9 and max(x, to) <= sheet.width + 1e-9
            for each in boxes:
                inside_x = each.x + 0.1 < max(x, to) and min(x, to) < each.x + each.width - 0.1
                inside_y = each.y + 0.1 < max(y, below)
                inside_y = inside_y and min(y, below) < each.y + each.height - 0.1
                assert not (inside_x and inside_y), (case, name)
    no_overlap(sheet)


def no_overlap(sheet: Sheet) -> None:
    """Wires of different outputs share no stretch of a line."""
    runs: dict[tuple[bool, float], list[tuple[float, float, int]]] = {}
    for (i, _), line in sheet.lines.items():
        for (x, y), (to, below) in pairwise(line):
            flat = abs(y - below) < 1e-9
            ends = sorted((x, to) if flat else (y, below))
            runs.setdefault((flat, round(y if flat else x, 3)), []).append((*ends, i))  # type: ignore[arg-type]
    for place, found in runs.items():
        for one, other in combinations(found, 2):
            if one[2] != other[2]:
                assert min(one[1], other[1]) - max(one[0], other[0]) < 0.1, (place, one, other)


def test_a_drawing_on_paper_has_its_size_and_its_type() -> None:
    svg = ET.fromstring(str(diagram(long_chain(12), "svg", 252.0)))
    assert str(svg.get("width")).endswith("pt") and float(str(svg.get("width"))[:-2]) <= 252.0
    sizes = [float(str(text.get("font-size"))) for text in svg.iter(f"{SVG}text")]
    assert min(sizes) >= 6.99
    with pytest.raises(UsageError, match="drawn as svg, png, pdf, tikz, not as dot"):
        diagram(long_chain(2), "dot", 252.0)
