import logging
import math
import sys

import ezdxf
import numpy as np
import pytest
import shapely
from ezdxf.math import BSpline
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.errors import InputError
from coordinator.scenario_files.maps.floor_map import MapOptions
from coordinator.scenario_files.maps.map_reader import read_map

WALLS = {"layer": "WALLS"}
UPSIDE_DOWN = {"layer": "WALLS", "extrusion": (0, 0, -1)}
HEART = [(0, 0), (3, 0), (4, 2), (2.5, 3), (2, 1.4), (1.5, 3), (0, 2.5), (0, 0)]


def drawn(path, *steps, units=6):
    """Write a drawing: each step is (method, arguments..., attributes)."""
    drawing = ezdxf.new("R2000")
    drawing.units = units
    paper = drawing.modelspace()
    for method, *arguments, attributes in steps:
        getattr(paper, f"add_{method}")(*arguments, **attributes)
    drawing.saveas(path)
    return path


@pytest.fixture
def read(tmp_path):
    def read_drawing(*steps, units=6, **options):
        return read_map(drawn(tmp_path / "a.dxf", *steps, units=units), MapOptions(**options))

    return read_drawing


def problems_of(read, *steps, **options):
    with pytest.raises(InputError) as caught:
        read(*steps, **options)
    assert all(problem.isprintable() for problem in caught.value.problems)
    return caught.value.problems


def attributes(**more):
    return {"dxfattribs": WALLS} | more


def arc_points(x, y, radius, start, end, count=4000):
    angles = np.linspace(start, end, count)
    return np.column_stack((x + radius * np.cos(angles), y + radius * np.sin(angles)))


def ellipse_points():
    angles = np.linspace(0, 2 * math.pi, 4000)[:, None]
    return (1, 2) + np.cos(angles) * (3, 1) + np.sin(angles) * (-0.4, 1.2)


def spline_points(weights=None):
    curve = BSpline(HEART, order=4, weights=weights)
    return np.array([(p.x, p.y) for p in curve.points(np.linspace(0, curve.max_t, 4000))])


HALF = arc_points(2, 0, 2, 0, math.pi)
RATIONAL = [1, 2, 0.5, 3, 1, 0.4, 2, 1]
# Shape: (the steps that draw it, dense points of its true outline).
CURVED = {
    "a circle": ([("circle", (1, 2), 3, attributes())], arc_points(1, 2, 3, 0, 2 * math.pi)),
    "an ellipse": ([("ellipse", (1, 2), (3, 1), 0.4, attributes())], ellipse_points()),
    "an outward bulge": (
        [("lwpolyline", [(0, 0, 0), (4, 0, 1)], attributes(format="xyb", close=True))],
        HALF,
    ),
    "an inward bulge": (
        [
            (
                "lwpolyline",
                [(0, 0, 0), (4, 0, 0), (4, 3, -1), (0, 3, 0)],
                attributes(format="xyb", close=True),
            )
        ],
        np.vstack(([(0, 0), (4, 0)], arc_points(2, 3, 2, 0, -math.pi))),
    ),
    "an old polyline": (
        [("polyline2d", [(0, 0, 0), (4, 0, 1)], attributes(format="xyb", close=True))],
        HALF,
    ),
    "an arc and a line": (
        [
            ("line", (4, 0), (0, 0), attributes()),
            ("arc", (2, 0), 2, 0, 180, attributes()),
        ],
        HALF,
    ),
    "a spline": ([("open_spline", HEART, attributes())], spline_points()),
    "a rational spline": (
        [("rational_spline", HEART, RATIONAL, attributes())],
        spline_points(RATIONAL),
    ),
    "a mirrored half disc": (
        [
            (
                "lwpolyline",
                [(0, 0, 0), (-4, 0, -1)],
                {"format": "xyb", "close": True, "dxfattribs": UPSIDE_DOWN},
            )
        ],
        HALF,
    ),
}


@pytest.mark.parametrize("name", CURVED)
@pytest.mark.parametrize("error", [None, 0.2, 0.0002])
def test_a_curved_outline_is_contained_with_bounded_error(read, name, error):
    steps, outline = CURVED[name]
    floor = read(*steps, map_error=error)
    (corners,) = floor.obstacles
    solid, true = shapely.Polygon(corners), shapely.Polygon(outline)
    assert solid.exterior.is_ccw
    assert solid.buffer(1e-6).covers(true)
    assert true.buffer((error or 0.005) + 1e-5).covers(solid)
    assert floor.note.endswith(f"nothing uncovered, at most {error or 0.005:g} m added")


def test_corners_are_few_for_their_error(read):
    floor = read(("circle", (0, 0), 1.0, attributes()), map_error=0.005)
    assert len(floor.obstacles[0]) <= 1.2 * math.pi / math.acos(1.0 / 1.005)


@pytest.mark.parametrize(
    ("units", "metres"), [(0, 1), (1, 0.0254), (2, 0.3048), (4, 1e-3), (5, 0.01)]
)
def test_units_are_those_of_the_drawing(read, units, metres):
    box = [(0, 0), (40, 0), (40, 30), (0, 30)]
    floor = read(("lwpolyline", box, attributes(close=True)), units=units)
    assert np.allclose(floor.obstacles, [[(x * metres, y * metres) for x, y in box]])
    assert np.allclose(sorted(floor.boundary), sorted(floor.obstacles[0]))
    assert floor.note.endswith("1 obstacles with 4 corners, nothing uncovered, none added")


def test_a_floor_of_its_own_layer_shrinks_where_it_is_round(read):
    floor = read(
        ("circle", (0, 0), 5, {"dxfattribs": {"layer": "Floor"}}),
        ("lwpolyline", [(0, 0), (1, 0), (1, 1)], attributes(close=True)),
        ("text", "a remark", {"dxfattribs": {"layer": "0"}}),
        boundary_layer="FLOOR",
    )
    assert len(floor.obstacles) == 1
    edge = np.hypot(*np.array(floor.boundary).T)
    assert 4.99 < edge.min() <= edge.max() <= 5.0 + 1e-9


def test_only_the_named_layer_is_read(read):
    other = ("hatch", {"dxfattribs": {"layer": "PAINT"}})
    square = ("lwpolyline", [(0, 0), (1, 0), (1, 1)], attributes(close=True))
    assert len(read(other, square, layer="walls").obstacles) == 1
    (problem,) = problems_of(read, other, square)
    assert (
        "on layer PAINT: is not read; outlines are made of LWPOLYLINE, POLYLINE, CIRCLE" in problem
    )


@settings(derandomize=True, max_examples=25, deadline=None)
@given(order=st.permutations(range(9)), turned=st.lists(st.booleans(), min_size=9, max_size=9))
def test_lines_in_any_order_and_direction_close_to_the_same_outline(
    tmp_path_factory, order, turned
):
    corners = [(3 * math.cos(0.7 * i), 2 * math.sin(0.7 * i)) for i in range(9)]
    edges = [(corners[i], corners[(i + 1) % 9]) for i in range(9)]
    edges = [edges[i][::-1] if back else edges[i] for i, back in zip(order, turned, strict=True)]
    steps = [("line", *edge, attributes()) for edge in edges]
    path = drawn(tmp_path_factory.getbasetemp() / "ring.dxf", *steps)
    (obstacle,) = read_map(path).obstacles
    assert shapely.Polygon(obstacle).equals(shapely.Polygon(corners))


def test_an_outline_that_nearly_touches_itself_is_followed_more_finely(read):
    step = ("arc", (0, 0), 1.0, 1, 359, attributes())
    inner = ("arc", (0, 0), 0.9, 1, 359, attributes())
    ends = [
        [(radius * math.cos(a), radius * math.sin(a)) for radius in (0.9, 1.0)]
        for a in (math.radians(1), math.radians(-1))
    ]
    lips = [("line", *end, attributes()) for end in ends]
    (corners,) = read(step, inner, *lips, map_error=0.1).obstacles
    assert not shapely.Polygon(corners).covers(shapely.Point(0.5, 0.0))


OPEN = {
    "an open polyline": (
        [("lwpolyline", [(0, 0), (1, 0), (1, 1)], attributes())],
        "LWPOLYLINE #2F on layer WALLS: open, so it encloses nothing; it ends at (0, 0) m",
    ),
    "a line alone": ([("line", (0, 0), (1, 0), attributes())], "LINE #2F on layer WALLS: open"),
    "an arc alone": ([("arc", (0, 0), 1, 0, 180, attributes())], "ARC #2F on layer WALLS: open"),
    "a fork": (
        [("line", (0, 0), end, attributes()) for end in ((1, 0), (0, 1), (1, 1))]
        + [("line", *ends, attributes()) for ends in (((1, 0), (0, 1)), ((0, 1), (1, 1)))],
        "LINE #2F on layer WALLS, LINE #30 on layer WALLS, LINE #31 on layer WALLS and 2 more:",
    ),
    "a bow tie": (
        [("lwpolyline", [(0, 0), (2, 2), (2, 0), (0, 2)], attributes(close=True))],
        "LWPOLYLINE #2F on layer WALLS: its outline crosses or touches itself at (1, 1) m",
    ),
    "a line drawn twice": (
        [("line", (0, 0), (1, 0), attributes())] * 2,
        "its outline comes nearer to itself",
    ),
    "a flat polyline": (
        [("lwpolyline", [(0, 0), (2, 2), (3, 3)], attributes(close=True))],
        "LWPOLYLINE #2F on layer WALLS: its corners lie on one line",
    ),
    "a circle of no size": (
        [("circle", (0, 0), 0, attributes())],
        "CIRCLE #2F on layer WALLS: has",
    ),
    "a point of a polyline": (
        [("lwpolyline", [(0, 0)], attributes(close=True))],
        "LWPOLYLINE #2F on layer WALLS: has no length",
    ),
    "a tilted circle": (
        [("circle", (0, 0), 1, {"dxfattribs": WALLS | {"extrusion": (1, 0, 1)}})],
        "does not lie in the plane of the drawing",
    ),
    "a mesh": ([("polymesh", attributes())], "POLYLINE #2F on layer WALLS: is a mesh"),
    "a spline with a bad weight": (
        [("rational_spline", HEART, [1, 1, -1, 1, 1, 1, 1, 1], attributes())],
        "SPLINE #2F on layer WALLS: its knots decrease or its weights are not positive",
    ),
    "a remark only": ([("text", "hello", attributes())], "encloses nothing"),
    "a far corner": (
        [("circle", (2e5, 0), 1, attributes())],
        "CIRCLE #2F on layer WALLS: reaches 200001 m",
    ),
}


@pytest.mark.parametrize("name", OPEN)
def test_what_encloses_nothing_is_named(read, name):
    steps, words = OPEN[name]
    (problem,) = problems_of(read, *steps)
    assert problem.startswith("a.dxf: ")
    assert words in problem


def test_every_open_polyline_is_listed_and_endless_ones_are_counted(read):
    steps = [("lwpolyline", [(i, 0), (i, 1), (i + 0.5, 1)], attributes()) for i in range(60)]
    assert len(problems_of(read, *steps[:9])) == 9
    *_, last = problems_of(read, *steps)
    assert last == "a.dxf: and 10 more"


SQUARE = ("lwpolyline", [(0, 0), (1, 0), (1, 1)], attributes(close=True))
# Fault: (options, units, words).
OPTIONS = {
    "an unknown layer": ({"layer": "WALL"}, 6, "nothing is drawn on layer 'WALL', the nearest are"),
    "an unknown floor": ({"boundary_layer": "FLOR"}, 6, "workspace.boundary_layer: nothing is"),
    "two roles": ({"layer": "walls", "boundary_layer": "WALLS"}, 6, "of the obstacles as well"),
    "a strange unit": ({}, 13, "$INSUNITS: 13 is not one of 0 no unit"),
    "no error at all": ({"map_error": 0.0}, 6, "curves need at least 1e-05 m"),
    "a size of cells": ({"cell": 1.0}, 6, "workspace.cell is not for maps of kind .dxf"),
}


@pytest.mark.parametrize("name", OPTIONS)
def test_options_that_do_not_fit_are_told(read, name):
    options, units, words = OPTIONS[name]
    (problem,) = problems_of(read, SQUARE, units=units, **options)
    assert words in problem


def test_without_ezdxf_the_message_says_what_to_install(read, monkeypatch):
    monkeypatch.setitem(sys.modules, "coordinator.scenario_files.maps.dxf", None)
    (problem,) = problems_of(read, SQUARE)
    assert problem == "a.dxf: reading .dxf needs the package ezdxf: pip install ezdxf"


@settings(derandomize=True, max_examples=25, deadline=None)
@given(at=st.floats(0.0, 1.0), gone=st.integers(0, 30), put=st.binary(max_size=12))
def test_damaged_bytes_are_read_or_refused(tmp_path_factory, at, gone, put):
    logging.getLogger("ezdxf").setLevel(logging.CRITICAL)
    folder = tmp_path_factory.getbasetemp()
    if not (folder / "whole.dxf").exists():
        drawn(folder / "whole.dxf", SQUARE, *CURVED["a spline"][0], *CURVED["an ellipse"][0])
    good = (folder / "whole.dxf").read_bytes()
    entities = good.index(b"ENTITIES")
    cut = entities + int(at * (len(good) - entities))
    problems = []
    for text in (good[:cut] + put + good[cut + gone :], good[:cut], put):
        (folder / "damaged.dxf").write_bytes(text)
        try:
            assert read_map(folder / "damaged.dxf").obstacles
        except InputError as error:
            problems += error.problems
    assert all(problem.isprintable() for problem in problems)
