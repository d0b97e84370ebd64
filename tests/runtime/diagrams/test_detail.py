"""What a diagram shows: probes, less detail; and the same picture as TikZ."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ET
from functools import cache

import pytest

import blocks
import runtime
from runtime.diagrams.formats import diagram
from runtime.diagrams.paint import draw
from runtime.diagrams.picture import DETAILS, Picture, picture_of
from runtime.diagrams.shapes import CurveShape, Dot, Rect, TextShape
from runtime.diagrams.sheet import lay_out
from runtime.diagrams.stored import read_picture, stored_picture
from runtime.diagrams.tikz import to_tikz
from runtime.errors import UsageError
from runtime.graph import Graph

SVG = "{http://www.w3.org/2000/svg}"


@cache
def case_a() -> Graph:
    return runtime.load("line_actuator_failure")


def texts_of(svg: object) -> list[str]:
    return [str(text.text) for text in ET.fromstring(str(svg)).iter(f"{SVG}text")]


def picture(detail: tuple[str, ...] = DETAILS) -> Picture:
    graph = case_a()
    return picture_of(graph.network, graph.observation.probes.values()).only(detail)


def test_recorded_outputs_are_marked_and_drawn_without_a_wire() -> None:
    recorded = {
        (signal.end.block, signal.end.port)
        for probe in case_a().observation.probes.values()
        for signal in probe.signals
        if not signal.is_state
    }
    boxes = picture().boxes
    assert {(name, port) for name, box in boxes.items() for port in box.probed} == recorded
    assert ("error", "lateral") in recorded  # which no wire takes
    assert "lateral" not in picture_of(case_a().network).boxes["error"].outputs
    sheet = lay_out(picture())
    assert set(boxes["error"].outputs) == set(sheet.boxes["error"].outputs)
    texts = texts_of(case_a().diagram())
    assert "lateral" in texts and "recorded" in texts
    assert "recorded" not in texts_of(diagram(case_a().network, "svg"))


def test_marks_are_kept_in_a_run_folder_and_checked() -> None:
    text = stored_picture(case_a().network, case_a().observation.probes.values()) or ""
    kept = read_picture(text)
    assert [box.probed for box in kept.boxes.values()] == [
        box.probed for box in picture().boxes.values()
    ]
    with pytest.raises(ValueError, match="probed among the outputs"):
        read_picture(text.replace('"lateral"', '"literal"', 1))


@pytest.mark.parametrize(
    ("detail", "word"),
    [
        *(("blocks", "Saturator"), ("types", "TrackingState"), ("rates", "1 kHz")),
        *(("ports", "feedforward"), ("probes", "recorded")),
    ],
)
def test_each_detail_can_be_left_out(detail: str, word: str) -> None:
    assert word in texts_of(case_a().diagram())
    rest = [each for each in DETAILS if each != detail]
    assert word not in texts_of(case_a().diagram(detail=rest))
    # A loop of wires and signs stays, whatever is left out.
    bare = texts_of(case_a().diagram(detail=[]))
    boxes = picture().boxes.values()
    names = [box.title for box in boxes] + ["+"] * sum(len(box.signs) for box in boxes)
    assert sorted(bare) == sorted([*names, "adaptive", "line_actuator_failure"])


def test_less_detail_takes_less_paper() -> None:
    full, bare = draw(picture(), 252.0), draw(picture(("blocks",)), 252.0)
    assert bare.height < 0.85 * full.height
    assert "TrackingState" not in texts_of(case_a().diagram("svg", 252.0))


def test_text_stays_inside_boxes_without_ports() -> None:
    for detail in ((), ("blocks",), ("values", "rates"), ("blocks", "values", "rates")):
        sheet = lay_out(picture(detail))
        for name, placement in sheet.boxes.items():
            ys = [*placement.inputs.values(), *placement.outputs.values()]
            assert all(placement.y < y < placement.y + placement.height for y in ys), name
        for group in draw(picture(detail)).groups:
            frame = next((s for s in group.shapes if isinstance(s, Rect)), None)
            if group.kind != "block" or frame is None or frame.width == frame.height:
                continue
            for text in (s for s in group.shapes if isinstance(s, TextShape)):
                assert frame.y + 10 < text.y < frame.y + frame.height - 3, (detail, text.text)


def test_a_detail_that_there_is_not() -> None:
    with pytest.raises(UsageError, match="no detail 'rate', did you mean 'rates'"):
        case_a().diagram(detail=["rate"])
    with pytest.raises(UsageError, match="another detail is drawn as svg, png, pdf, tikz"):
        case_a().diagram("mermaid", detail=["rates"])


def test_tikz_has_the_shapes_of_the_drawing() -> None:
    drawing = draw(picture_of(case_a().without("adaptive").network), 516.0)
    shapes = [shape for group in drawing.groups for shape in group.shapes]
    lines = to_tikz(drawing).splitlines()
    assert lines[0].startswith("%") and lines[-1] == r"\end{tikzpicture}"
    colours = dict(re.findall(r"\\definecolor\{(\w+)\}\{HTML\}\{(\w{6})\}", "\n".join(lines)))
    body = lines[3 + len(colours) : -1]
    assert len(body) == len(shapes)
    for line, shape in zip(body, shapes, strict=True):
        assert line.endswith(";") and line.count("{") == line.count("}")
        numbers = [
            float(n) for at in re.findall(r"\((-?[\d.]+,-?[\d.]+)\)", line) for n in at.split(",")
        ]
        ink = shape.stroke if isinstance(shape, CurveShape) and not shape.fill else shape.fill
        assert any(
            value == ink.lstrip("#").upper() and name in line for name, value in colours.items()
        )
        if isinstance(shape, CurveShape):
            assert numbers[:2] == pytest.approx(shape.commands[0][1][0], abs=0.006)
            ends = [points[-1] for _, points in shape.commands if points]
            assert numbers[-2:] == pytest.approx(ends[-1], abs=0.006)
        elif isinstance(shape, TextShape | Dot):
            assert numbers == pytest.approx((shape.x, shape.y), abs=0.006)
        else:
            moved = shape.radius if shape.width == shape.height == 2 * shape.radius else 0.0
            corner = shape.x + moved, shape.y + moved
            assert numbers[:2] == pytest.approx(corner, abs=0.006)


def test_tikz_curves_are_those_of_the_drawing() -> None:
    """A cubic curve with control points at two thirds is the quadratic one."""
    curve = next(
        shape
        for group in draw(picture()).groups
        for shape in group.shapes
        if isinstance(shape, CurveShape) and any(letter == "Q" for letter, _ in shape.commands)
    )
    drawing = draw(picture())
    drawing.groups[:] = [type(drawing.groups[0])("wire", "", "", [curve])]
    text = to_tikz(drawing)
    points = [tuple(map(float, at)) for at in re.findall(r"\((-?[\d.]+),(-?[\d.]+)\)", text)]
    k = next(i for i, (letter, _) in enumerate(curve.commands) if letter == "Q")
    (start,), (bend, end) = curve.commands[k - 1][1], curve.commands[k][1]
    at = points.index(start)
    first, second, last = points[at + 1 : at + 4]
    assert last == pytest.approx(end)
    for u in (0.25, 0.5, 0.75):
        for axis in (0, 1):
            quadratic = (
                (1 - u) ** 2 * start[axis] + 2 * u * (1 - u) * bend[axis] + u * u * end[axis]
            )
            cubic = (1 - u) ** 3 * start[axis] + 3 * u * (1 - u) ** 2 * first[axis]
            cubic += 3 * u * u * (1 - u) * second[axis] + u**3 * last[axis]
            assert cubic == pytest.approx(quadratic, abs=0.02)


def test_tikz_escapes_what_latex_reads() -> None:
    graph = runtime.Graph(r"50 % of {x_1} & #2 ~ ^ \ $ θΩ", dt=0.01, until=1.0)
    drawing = draw(picture_of(graph.add("u", blocks.Constant(value=-1.0)).network))
    text = to_tikz(drawing)
    title = next(line for line in text.splitlines() if line.startswith(r"\node") and "50" in line)
    assert title.endswith(
        r"{50 \% of \{x\_1\} \& \#2 \textasciitilde{} \textasciicircum{} \textbackslash{} "
        r"\$ $\theta$$\Omega$};"
    )
    assert r"{$-$1};" in text
