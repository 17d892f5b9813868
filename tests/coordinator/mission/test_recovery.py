"""Planning anew around the lost: who drives on, who stays, what stands where."""

from __future__ import annotations

import math

import numpy as np
import pytest
import shapely
from msgspec.structs import replace

from coordinator.base.errors import PlanError
from coordinator.fleet.rest_places import Standing
from coordinator.mission import recovery
from coordinator.mission.recovery import recover
from coordinator.mission.replanning_input import Site, next_site
from coordinator.plan.wire import drive
from coordinator.planning.planner import plan_fleet
from coordinator.scenario_files.scenario_reader import parse_scenario

CROSSING = b"""
name = "crossing"
[workspace]
bounds = [0.0, 0.0, 8.0, 8.0]
[[robots]]
id = "A"
start = [1.0, 4.0]
goal = [7.0, 4.0]
via = [[3.0, 4.5], [6.0, 4.0]]
radius = 0.2
max_speed = 0.5
[[robots]]
id = "B"
start = [4.0, 1.0]
goal = [4.0, 7.0]
radius = 0.2
max_speed = 0.5
[[robots]]
id = "C"
start = [1.0, 7.0]
goal = [7.0, 1.5]
radius = 0.3
max_speed = 0.5
"""


def plan(scenario, epoch):
    return plan_fleet(scenario, effort=3, epoch=epoch)


@pytest.fixture(scope="module")
def scenario():
    return parse_scenario(CROSSING, "crossing.toml")


@pytest.fixture(scope="module")
def documents(scenario):
    return {1: plan(scenario, 1).document}


def rests(robot, s, **fields):
    return Standing(robot=robot, state="rests", epoch=1, s=s, **fields)


def lost(robot, since, until):
    return Standing(robot=robot, state="lost", epoch=1, since=since, until=until)


def rides(documents):
    """The courses of these plans by robot, epoch and revision."""
    return {
        (one.id, epoch, 0): one for epoch, document in documents.items() for one in drive(document)
    }


def driven(documents, robot):
    return next(one for one in drive(documents[1]) if one.id == robot)


def recovered(scenario, documents, *told):
    return recover(Site(scenario), rides(documents), told, 2, plan)


def test_robots_start_where_they_rest_with_their_headings_and_the_vias_ahead(scenario, documents):
    ride = driven(documents, "A")
    s = 0.6 * ride.curve.length
    found = recovered(scenario, documents, rests("A", s), rests("B", 0.5), rests("C", 0.4))
    assert found.document is not None
    assert found.document.proof.holds
    again = {one.id: one for one in drive(found.document)}["A"].curve
    place, ahead = ride.curve.at_arc([s, s + 1e-4])
    assert again.at_arc([0.0])[0] == pytest.approx(place, abs=1e-5)
    way = again.at_arc([1e-3])[0] - again.at_arc([0.0])[0]
    turned = math.atan2(*(ahead - place)[::-1]) - math.atan2(*way[::-1])
    assert abs(math.remainder(turned, math.tau)) < 0.02
    (robot,) = (r for r in found.site.scenario.robots if r.id == "A")
    assert robot.via == ((6.0, 4.0),)


def test_a_lost_robot_is_an_obstacle_over_all_places_where_it_may_stand(scenario, documents):
    told = (rests("A", 0.3), rests("C", 0.4), lost("B", 4.0, 9.0))
    found = recovered(scenario, documents, *told)
    ride = driven(documents, "B")
    (aside,) = found.site.aside
    shape = shapely.Polygon(aside.disc())
    times = np.linspace(4.0, 9.0, 400)
    places = ride.curve.at_arc([ride.timeline.s_at(t) for t in times])
    discs = [shapely.Point(*p).buffer(0.2, quad_segs=64) for p in places]
    assert all(shape.buffer(1e-9).covers(disc) for disc in discs)
    assert shape.area < shapely.union_all(discs).area * 1.01
    for one in drive(found.document):
        line = shapely.LineString(one.curve.at_arc(np.linspace(0.0, one.curve.length, 2000)))
        assert line.distance(shape) >= one.radius + scenario.margin - 1e-3


def test_a_robot_at_its_goal_stays_there_and_is_driven_around(scenario, documents):
    told = (rests("A", 0.3), rests("C", 0.4), Standing(robot="B", state="arrived", epoch=1))
    found = recovered(scenario, documents, *told)
    assert [robot.id for robot in found.document.robots] == ["A", "C"]
    assert [(one.robot.id, one.why) for one in found.site.aside] == [("B", "arrived")]
    at_goal = replace(told[0], s=driven(documents, "A").curve.length)
    again = next_site(Site(scenario), rides(documents), (at_goal, *told[1:]))
    assert {one.robot.id: one.why for one in again.aside}["A"] == "arrived"


def test_a_robot_that_comes_back_is_planned_for_from_the_place_it_says_even_if_it_had_arrived(
    scenario, documents
):
    told = [Standing(robot="A", state="arrived", epoch=1), rests("B", 2.0), rests("C", 2.0)]
    before = next_site(Site(scenario), rides(documents), told)
    assert [one.robot.id for one in before.aside] == ["A"]
    (goal,) = (robot.goal for robot in scenario.robots if robot.id == "A")
    carried = (goal[0] - 1.0, goal[1], 0.5)
    back = Standing(robot="A", state="rests", epoch=1, place=carried)
    after = next_site(before, rides(documents), [back])
    assert {robot.id: robot.start for robot in after.scenario.robots}["A"] == carried
    assert after.aside == ()
    there = replace(back, place=(goal[0], goal[1] + 0.001, 0.5))
    assert [one.why for one in next_site(before, rides(documents), [there]).aside] == ["arrived"]


def test_robots_that_made_room_go_back_by_a_new_plan_wherever_they_are(scenario, documents):
    told = [Standing(robot="A", state="arrived", epoch=1), rests("B", 2.0), lost("C", 1.0, 2.0)]
    goals = {robot.id: robot.goal for robot in scenario.robots}
    homes = {"A": (1.0, 1.0), "B": (7.0, 1.0), "C": (5.0, 1.0)}
    found = recover(Site(scenario), rides(documents), told, 2, plan, homes=homes)
    assert {one.robot.id: one.why for one in found.site.aside} == {"C": "lost"}
    planned = {one.id: one for one in drive(found.document)}
    assert math.dist(planned["A"].curve.points[0], goals["A"]) < 1e-6
    for name, curve in ((name, planned[name].curve) for name in "AB"):
        assert math.dist(curve.points[-1], homes[name]) < 1e-6
    there = next_site(Site(scenario), rides(documents), told[:1], {"A": goals["A"]})
    assert [(one.robot.id, one.why) for one in there.aside] == [("A", "arrived")]


def test_a_robot_whose_goal_is_closed_off_stays_and_is_named_and_the_rest_go_on(scenario):
    closed = replace(scenario.robots[1], goal=(7.0, 4.4))
    scenario = replace(scenario, robots=(scenario.robots[0], closed, scenario.robots[2]))
    whole = replace(scenario, robots=(scenario.robots[0], scenario.robots[2]))
    documents = {1: plan(whole, 1).document}
    told = (Standing(robot="A", state="arrived", epoch=1), rests("C", 0.4))
    found = recover(Site(scenario), rides(documents), told, 2, plan)
    assert found.document is not None
    assert [robot.id for robot in found.document.robots] == ["C"]
    assert found.said[0] == f"B stays where it is: {found.stays['B']}"
    assert found.stays["B"].startswith("cannot be at (7.00, 4.40), which")
    assert found.stays["B"].endswith("to the place where A may stand")
    assert found.stays.keys() == {"B"}
    assert {one.robot.id: one.why for one in found.site.aside} == {"A": "arrived", "B": "closed in"}
    there = Standing(robot="C", state="arrived", epoch=1)
    later = next_site(found.site, rides(documents), (there,))
    assert [robot.id for robot in later.scenario.robots] == ["B"]


@pytest.mark.parametrize(("short", "there"), [(0.002, True), (0.015, True), (0.03, False)])
def test_a_robot_that_rests_millimetres_before_its_goal_is_not_sent_around_to_it(
    scenario, documents, short, there
):
    length = driven(documents, "A").curve.length
    found = recovered(
        scenario, documents, rests("A", length - short), rests("B", 0.5), rests("C", 0.4)
    )
    assert ("A" not in {robot.id for robot in found.document.robots}) == there


@pytest.mark.parametrize(
    ("place", "where"),
    [
        ((2.05, 3.9, 0.0), "(2.05, 3.90), where B stands"),
        ((-3.0, 1.0, 0.0), "(-3.00, 1.00), where there is no floor"),
        ((0.1, 1.0, 0.0), "(0.10, 1.00), where there is something solid"),
        ((2e6, -2e6, 0.0), "(2000000.00, -2000000.00), where there is no floor"),
    ],
)
def test_a_robot_that_cannot_stand_where_it_says_is_left_where_it_was(
    scenario, documents, place, where
):
    """Neither is it believed once whoever stands there is gone."""
    died = (lost("A", 1.0, 2.0), rests("B", 2.0), rests("C", 0.4))
    first = recovered(scenario, documents, *died)
    known = {1: documents[1], 2: first.document}
    (before,) = first.site.aside
    b = next(r for r in first.site.scenario.robots if r.id == "B").start
    if "B" in where:
        place = (b[0] + 0.05, b[1] - 0.1, 0.0)
        where = f"({place[0]:.2f}, {place[1]:.2f}), where B stands"
    back = Standing(robot="A", state="rests", epoch=0, place=place)
    told = (Standing(robot="B", state="rests", epoch=2, s=0.0), back)
    found = recover(first.site, rides(known), told, 3, plan)
    assert found.stays == {"A": f"it says that it stands at {where}"}
    assert found.doubted == ("A",)
    assert found.said == (f"A stays where it is: {found.stays['A']}",)
    assert {one.id for one in found.document.robots} == {"B", "C"}
    (aside,) = found.site.aside
    assert (aside.why, aside.places.tolist()) == ("lost", before.places.tolist())


def test_a_closed_in_robot_whose_place_is_not_believed_is_not_sent_on_its_way(scenario, documents):
    told = (rests("A", 0.3), rests("B", 2.0), rests("C", 0.4))
    site = next_site(Site(scenario), rides(documents), told).without("A")
    back = Standing(robot="A", state="rests", epoch=0, place=(-3.0, 1.0, 0.0))
    found = recover(site, rides(documents), (back, *told[1:]), 2, plan)
    assert [(one.robot.id, one.why) for one in found.site.aside] == [("A", "lost")]
    later = next_site(found.site, rides(documents), told[1:])
    assert [one.robot.id for one in later.aside] == ["A"]


def test_a_robot_that_came_back_and_died_is_left_where_it_said_that_it_stands(scenario, documents):
    told = (rests("A", 0.3), rests("B", 2.0), rests("C", 0.4))
    site = next_site(Site(scenario), rides(documents), told).without("A")
    dead = Standing(robot="A", state="lost", epoch=0, place=(1.5, 1.5, 0.0))
    (aside,) = next_site(site, rides(documents), (dead, *told[1:])).aside
    assert (aside.why, aside.places.tolist()) == ("lost", [[1.5, 1.5]])


def test_nobody_left_to_drive_is_no_plan(scenario, documents):
    told = tuple(Standing(robot=r.id, state="arrived", epoch=1) for r in scenario.robots)
    assert recovered(scenario, documents, *told).document is None


def test_a_robot_off_its_path_starts_from_where_it_is(scenario, documents):
    told = (rests("A", 0.3), rests("B", 0.5), rests("C", 0.4, off=0.12, turn=0.3))
    site = next_site(Site(scenario), rides(documents), told)
    ride = driven(documents, "C")
    place, ahead = ride.curve.at_arc([0.4, 0.4001])
    heading = math.atan2(*(ahead - place)[::-1])
    (robot,) = (r for r in site.scenario.robots if r.id == "C")
    assert robot.start[0] == pytest.approx(place[0] - 0.12 * math.sin(heading), abs=1e-4)
    assert robot.start[1] == pytest.approx(place[1] + 0.12 * math.cos(heading), abs=1e-4)
    assert robot.start[2] == pytest.approx(heading + 0.3, abs=1e-3)


@pytest.mark.parametrize(("end", "beyond"), [(0.0, -0.11), (1.0, 0.11)])
def test_a_robot_beyond_an_end_of_its_path_starts_from_where_it_is(
    scenario, documents, end, beyond
):
    ride = driven(documents, "C")
    s = end * ride.curve.length
    told = (rests("A", 0.3), rests("B", 0.5), rests("C", s, off=0.02, beyond=beyond))
    site = next_site(Site(scenario), rides(documents), told)
    near = abs(s - 1e-4)
    place, ahead = ride.curve.at_arc(sorted((s, near)))
    heading = math.atan2(*(ahead - place)[::-1])
    (robot,) = (r for r in site.scenario.robots if r.id == "C")
    away = np.array(robot.start[:2]) - ride.curve.at_arc([s])[0]
    forward, left = (math.cos(heading), math.sin(heading)), (-math.sin(heading), math.cos(heading))
    assert (away @ forward, away @ left) == pytest.approx((beyond, 0.02), abs=1e-4)


def test_the_same_standings_give_the_same_bytes(scenario, documents):
    told = (rests("A", 0.3), lost("B", 4.0, 9.0), rests("C", 0.4))
    found = [recovered(scenario, documents, *told).document for _ in range(2)]
    assert found[0] == found[1]


def test_robots_that_rest_anywhere_in_a_plan_can_go_on(scenario, documents):
    finish = max(robot.finish_time for robot in documents[1].robots)
    rides = drive(documents[1])
    for time in np.linspace(0.0, finish, 12):
        told = [rests(r.id, r.timeline.s_at(time)) for r in rides]
        found = recovered(scenario, documents, *told)
        near = 0.4 * scenario.margin + 1e-3
        left = [r.id for r in rides if r.curve.length - r.timeline.s_at(time) > near]
        assert [r.id for r in found.document.robots] == left if left else not found.document


ROOMS = b"""
name = "rooms"
[workspace]
bounds = [0.0, 0.0, 10.0, 4.0]
obstacles = [[[3, 0], [7, 0], [7, 1.6], [3, 1.6]], [[3, 2.4], [7, 2.4], [7, 4], [3, 4]]]
[[robots]]
id = "A"
start = [1.0, 2.0]
goal = [9.0, 3.2]
radius = 0.2
max_speed = 0.8
[[robots]]
id = "B"
start = [1.0, 0.7]
via = [[2.0, 1.0], [9.0, 1.0], [2.0, 3.0]]
goal = [1.0, 3.3]
radius = 0.2
max_speed = 0.8
"""


def test_via_points_behind_a_door_that_a_dead_robot_closes_are_dropped_when_nobody_else_goes():
    """Without them the robot has a way to its goal; one that has none keeps all of them.

    As long as others drive it stays, for who closes the door may be heard again.
    """
    scenario = parse_scenario(ROOMS, "rooms.toml")
    documents = {1: plan(scenario, 1).document}
    ride, robot_with_via = driven(documents, "A"), scenario.robots[1]
    inside = np.argmin(np.hypot(*(ride.curve.at_arc(np.arange(0.0, 9.0, 0.01)) - (5, 2)).T)) * 0.01
    stands = Standing(robot="A", state="unfit", epoch=1, s=float(inside))
    found = recovered(scenario, documents, stands, rests("B", 0.05))
    assert found.said == ("B does not pass (9.00, 1.00): no way there",)
    (robot,) = found.site.scenario.robots
    assert robot.via == ((2.0, 1.0), (2.0, 3.0))
    assert [one.id for one in found.document.robots] == ["B"]
    other = replace(scenario.robots[1], id="C", start=(2.4, 2.0), goal=(2.4, 3.5), via=())
    crowd = replace(scenario, robots=(*scenario.robots, other))
    found = recovered(crowd, documents, stands, rests("B", 0.05))
    assert [one.split(":")[0] for one in found.said] == ["B stays where it is"]
    assert [one.id for one in found.document.robots] == ["C"]
    lost_at_goal = replace(scenario.robots[0], goal=(9.0, 3.95))
    told = (rests("A", float(inside)), rests("B", 0.05))
    found = recovered(replace(scenario, robots=(lost_at_goal, robot_with_via)), documents, *told)
    assert [one.split(":")[0] for one in found.said] == [
        "A stays where it is",
        "B does not pass (9.00, 1.00)",
    ]
    assert [one.id for one in found.document.robots] == ["B"]
    beyond = replace(scenario.robots[1], goal=(9.0, 3.5))
    closed = replace(scenario, robots=(scenario.robots[0], beyond))
    found = recovered(closed, documents, stands, rests("B", 0.05))
    (said,) = found.said
    assert said.startswith("B stays where it is: has no way from (2.00, 1.00) to (9.00, 1.00)")


def test_of_via_points_that_only_together_have_no_way_as_few_of_the_last_are_left_out(monkeypatch):
    scenario = parse_scenario(ROOMS, "rooms.toml")
    robot = replace(scenario.robots[1], via=((2.0, 1.0), (2.0, 3.0), (1.0, 2.5)))
    scenario = replace(scenario, robots=(robot,))
    for most in range(4):
        monkeypatch.setattr(recovery, "_has_way", lambda _, one, most=most: len(one.via) <= most)
        assert recovery._closed_via(scenario, "B") == robot.via[most:]


def test_a_via_point_that_somebody_stands_on_is_dropped_and_told(scenario, documents):
    ride = driven(documents, "A")
    s = 0.5 * ride.curve.length
    x, y = ride.curve.at_arc([s])[0].tolist()
    through = replace(scenario.robots[1], via=((x, y),))
    scenario = replace(scenario, robots=(scenario.robots[0], through, scenario.robots[2]))
    stands = Standing(robot="A", state="unfit", epoch=1, s=s)
    found = recovered(scenario, documents, stands, rests("B", 0.5), rests("C", 0.4))
    assert found.said == (f"B does not pass ({x:.2f}, {y:.2f}): A stands there",)
    (robot,) = (r for r in found.site.scenario.robots if r.id == "B")
    assert robot.via == ()
    assert {robot.id for robot in found.document.robots} == {"B", "C"}


def test_robots_turn_on_the_spot_rather_than_take_needle_turns(scenario, documents):
    asked = []

    def fails(scenario, _epoch):
        asked.append({(len(one.start), one.min_turn_radius > 0.0) for one in scenario.robots})
        raise PlanError("C is in the way")

    told = [rests("A", 0.3), rests("B", 0.3), rests("C", 0.4)]
    recover(Site(scenario), rides(documents), told, 2, fails)
    assert asked[:4] == [{(3, True)}, {(2, True)}, {(3, False)}, {(2, False)}]


def test_the_robot_that_an_error_blames_stays_whatever_words_its_advice_has(scenario, documents):
    def without_c(asked, epoch):
        if any(robot.id == "C" for robot in asked.robots):
            raise PlanError("B and C block each other. A wider passage would help", "C")
        return plan(asked, epoch)

    told = tuple(rests(name, 0.4) for name in "ABC")
    assert recover(Site(scenario), rides(documents), told, 2, without_c).stays.keys() == {"C"}
