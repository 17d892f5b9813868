import math

import msgspec
import numpy as np
import pytest
import shapely
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from coordinator.base.errors import InputError
from coordinator.curves.nurbs import nurbs
from coordinator.plan.document import Crossing, Floor, PlanDocument
from coordinator.view.figure import draw_plan
from coordinator.view.figure_curvature_comb import Bends, draw_comb, sharpest_bend
from coordinator.view.figure_floor import draw_floor
from coordinator.view.figure_ground import draw_ground, reaches
from coordinator.view.figure_robots import picture_robots
from coordinator.view.figure_selection import View
from tests.coordinator.view.test_figure import EAST, straight, words

HALVES = [
    [(2.0, 2.0), (4.0, 2.0), (4.0, 6.0), (2.0, 6.0)],
    [(4.0, 2.0), (6.0, 2.0), (6.0, 6.0), (4.0, 6.0)],
]
FLOOR = Floor(boundary=[(0.0, 0.0), (12.0, 0.0), (12.0, 8.0), (0.0, 8.0)], obstacles=HALVES)
ARC = nurbs(2, [0, 0, 0, 1, 1, 1], [(2, 0), (2, 2), (0, 2)], [1, math.sqrt(0.5), 1])
"""A quarter of the circle of radius 2 around the origin, driven to the left."""


def fleet(count, **changes):
    robots = [straight(f"R{i}", (1.0, 0.5 + 0.1 * i), (11.0, 0.5 + 0.1 * i)) for i in range(count)]
    plan = {"scenario": "s", "epoch": 1, "policy": "safe", "tau": 1.0, "margin": 0.05}
    document = PlanDocument(**plan, robots=robots, workspace=FLOOR)
    return msgspec.structs.replace(document, **changes)


def bent():
    """A robot on a quarter of a circle of radius 4 around the origin, as a cubic."""
    robot = straight("bent", (4.0, 0.0), (0.0, 4.0))
    middle = math.sqrt(0.5)
    weight, side = (1.0 + 2.0 * middle) / 3.0, 4.0 * 2.0 * middle / (1.0 + 2.0 * middle)
    points = [(4.0, 0.0), (4.0, side), (side, 4.0), (0.0, 4.0)]
    weights = [1.0, weight, weight, 1.0]
    length = 2.0 * math.pi
    path = msgspec.structs.replace(robot.path, control_points=points, weights=weights)
    profile = [(0.0, 0.5), (length, 0.5)]
    return msgspec.structs.replace(robot, path=path, length=length, profile=profile)


def empty_axes():
    axes = Figure(figsize=(6, 4)).add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 12.0), ylim=(0.0, 8.0))
    return axes


def drawn(document, view=None):
    """The floor's axes and the words of its legend."""
    axes = empty_axes()
    keys = draw_floor(axes, document, picture_robots(document, view))
    return axes, [text for _, text in keys]


def patches(axes, gid):
    return [patch for patch in axes.patches if patch.get_gid() == gid]


def lines(axes, gid):
    return [line for line in axes.lines if line.get_gid() == gid]


def combs(axes):
    return [each for each in axes.collections if isinstance(each, LineCollection)]


def test_obstacles_that_share_a_seam_are_drawn_as_one_ring_without_it():
    axes = empty_axes()
    draw_ground(axes, FLOOR, [0.25])
    (obstacles,) = patches(axes, "obstacles")
    (ring,) = obstacles.get_path().to_polygons()
    shape = shapely.Polygon(ring)
    assert shape.equals(shapely.box(2.0, 2.0, 6.0, 6.0))
    assert shape.exterior.length == pytest.approx(16.0)


def test_a_courtyard_stays_open():
    wall = [(2, 2), (6, 2), (6, 6), (2, 6), (2, 4.1), (3, 4.1), (3, 5), (5, 5), (5, 3), (3, 3)]
    door = [(2.0, 3.9), (3.0, 3.9), (3.0, 4.1), (2.0, 4.1)]
    ring = Floor(boundary=FLOOR.boundary, obstacles=[[*wall, (3, 3.9), (2, 3.9)], door])
    axes = empty_axes()
    draw_ground(axes, ring, [])
    (obstacles,) = patches(axes, "obstacles")
    outer, court = (shapely.Polygon(each) for each in obstacles.get_path().to_polygons())
    assert outer.equals(shapely.box(2.0, 2.0, 6.0, 6.0))
    assert court.equals(shapely.box(3.0, 3.0, 5.0, 5.0))
    # Renderers fill what is wound around an odd number of times, or a number other than nought.
    assert outer.exterior.is_ccw != court.exterior.is_ccw


def test_the_grown_outline_is_as_far_as_told_from_obstacles_and_from_the_floors_edge():
    axes = empty_axes()
    draw_ground(axes, FLOOR, [0.25])
    (grown,) = patches(axes, "grown")
    box, edge = shapely.box(2.0, 2.0, 6.0, 6.0), shapely.Polygon(FLOOR.boundary).exterior
    for ring in grown.get_path().to_polygons():
        points = shapely.points(ring)
        away = np.minimum(shapely.distance(points, box), shapely.distance(points, edge))
        assert away == pytest.approx(0.25, abs=1e-3)


def test_one_outline_for_each_radius_at_most_three():
    assert reaches([0.2, 0.3, 0.2], 0.05) == pytest.approx([0.25, 0.35])
    assert reaches([0.5, 0.1, 0.2, 0.3, 0.4], 0.0) == pytest.approx([0.1, 0.3, 0.5])
    mixed = [straight(f"R{i}", (1.0, 7.0), (9.0, 7.0), radius=0.1 * (i + 1)) for i in range(5)]
    axes, told = drawn(fleet(0, robots=mixed))
    assert len(patches(axes, "grown")) == 3
    assert "grown by 0.15 m (radius + margin, 3 of 5): no centre inside" in told
    assert {"by 0.35 m", "by 0.55 m"} <= set(told)


def test_teeth_stand_on_the_outer_side_as_long_as_the_arc_is_bent():
    axes = empty_axes()
    bends = Bends.of(ARC)
    assert bends.sharpest == pytest.approx(0.5)
    draw_comb(axes, bends, "k", side=10.0, sharpest=1.0)
    (comb,) = combs(axes)
    for foot, tip in comb.get_segments():
        assert math.hypot(*foot) == pytest.approx(2.0)
        assert tip == pytest.approx(foot * 2.3 / 2.0)


def test_a_comb_changes_sides_where_its_bend_does():
    curve = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [(0, 0), (1, 2), (2, -2), (3, 0)])
    axes = empty_axes()
    draw_comb(axes, Bends.of(curve), "k", side=3.0, sharpest=4.0)
    (comb,) = combs(axes)
    for foot, tip in comb.get_segments():
        assert (tip[1] - foot[1]) * (1.5 - foot[0]) > 0.0


def test_straight_paths_have_no_comb():
    line = nurbs(3, [0, 0, 0, 0, 1, 1, 1, 1], [(0, 0), (1, 0), (2, 0), (3, 0)])
    assert sharpest_bend([Bends.of(line)], 10.0) is None
    axes, told = drawn(fleet(3))
    assert combs(axes) == []
    assert not any(text.startswith("comb") for text in told)


def test_the_note_tells_curvature_and_radius_of_the_longest_tooth(tmp_path):
    draw_plan(fleet(0, robots=[bent(), EAST]), tmp_path / "plan.svg")
    assert "comb: longest tooth = curvature 0.25 1/m, radius 4 m" in words(tmp_path / "plan.svg")


def test_a_few_robots_show_control_polygons_and_many_do_not():
    few, told = drawn(fleet(8))
    assert len(lines(few, "control")) == 8
    assert "control polygon" in told
    many, told = drawn(fleet(9))
    assert lines(many, "control") == []
    assert "control polygon" not in told


@pytest.mark.parametrize(("count", "detail"), [(9, True), (3, False)])
def test_detail_can_be_asked_for_and_refused(count, detail):
    axes, _ = drawn(fleet(count), View(detail=detail))
    assert len(lines(axes, "control")) == (count if detail else 0)


def test_a_control_polygon_runs_through_the_points_of_the_plan():
    axes, _ = drawn(fleet(0, robots=[bent()]))
    (polygon,) = lines(axes, "control")
    assert polygon.get_xydata() == pytest.approx(np.array(bent().path.control_points), abs=1e-6)


def test_chosen_robots_are_drawn_in_full_and_the_others_faintly():
    axes, _ = drawn(fleet(12), View(robots=("R3", "R7")))
    assert len(lines(axes, "control")) == 2
    assert {text.get_text() for text in axes.texts if text.get_text()} == {
        "R3",
        "R3 goal",
        "R7",
        "R7 goal",
    }
    faint = [line for line in axes.lines if line.get_alpha() == 0.35]
    assert len(faint) == 10


def test_names_that_are_no_robots_are_refused_one_line_each(tmp_path):
    with pytest.raises(InputError) as caught:
        draw_plan(fleet(3), tmp_path / "plan.svg", View(robots=("R1", "R22", "x")))
    assert len(caught.value.problems) == 2
    assert "no robot 'R22'; the nearest name is 'R2'" in caught.value.problems[0]
    assert caught.value.problems[1].endswith("no robot 'x'; it has R0, R1, R2")
    assert not (tmp_path / "plan.svg").exists()


def test_a_wait_at_several_crossings_is_told_once():
    meets = {"a": "R0", "b": "R1", "s_a": 1.0, "s_b": 1.0, "t_a": 1.0, "t_b": 1.0}
    crossings = [
        Crossing(x=x, y=4.0, verdict="R1 stops 2.0 s", **meets) for x in (7.0, 8.0, 9.0, 10.0)
    ]
    axes, told = drawn(fleet(2, crossings=crossings))
    assert [text.get_text() for text in axes.texts].count("R1 stops 2.0 s") == 1
    assert "crossing" in told
