"""What is different between two scenarios."""

import pytest
from msgspec.structs import replace

from coordinator.scenario.changes import Change, changes
from coordinator.scenario.model import Demand, Order
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.scenario_files.toml_writer import scenario_to_toml
from tests.scenarios import a_robot, a_scenario

BOX = ((4.0, 4.0), (5.0, 4.0), (5.0, 5.0))
SHELF = ((7.0, 1.0), (8.0, 1.0), (8.0, 2.0))
ROBOTS = [a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (9.0, 1.0), (1.0, 7.0))]
HALL = a_scenario(ROBOTS, obstacles=[BOX, SHELF])


def with_robot(**fields):
    return replace(HALL, robots=(replace(ROBOTS[0], **fields), ROBOTS[1]))


def with_obstacles(*polygons):
    return replace(HALL, workspace=replace(HALL.workspace, obstacles=polygons))


@pytest.mark.parametrize("write", [scenario_to_json, scenario_to_toml])
def test_a_scenario_that_was_written_and_read_again_is_the_same(write):
    suffix = "json" if write is scenario_to_json else "toml"
    assert changes(HALL, parse_scenario(write(HALL), f"hall.{suffix}")) == []


def test_the_order_of_robots_and_of_obstacles_means_nothing():
    other = replace(with_obstacles(SHELF, BOX), robots=HALL.robots[::-1])
    assert changes(HALL, other) == []


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        (replace(HALL, tau=0.5), Change("tau", '"auto"', "0.5")),
        (with_robot(radius=0.31), Change("robots[R1].radius", str(ROBOTS[0].radius), "0.31")),
        (with_robot(via=((5.0, 7.0),)), Change("robots[R1].via", "[]", "[[5.0,7.0]]")),
        (with_robot(goal=(9.0, 6.0)), Change("robots[R1].goal", "[9.0,7.0]", "[9.0,6.0]")),
        (
            with_obstacles(BOX),
            Change("workspace.obstacles", "[[7.0,1.0],[8.0,1.0],[8.0,2.0]]", None),
        ),
        (
            with_obstacles(BOX, SHELF, BOX),
            Change("workspace.obstacles", None, "[[4.0,4.0],[5.0,4.0],[5.0,5.0]]"),
        ),
    ],
)
def test_a_field_that_differs_is_named_with_both_values(after, expected):
    assert changes(HALL, after) == [expected]


def test_a_robot_that_is_new_is_told_whole_and_cut_where_it_is_long():
    third = a_robot("R3", (2.0, 2.0), (8.0, 3.0))
    (change,) = changes(HALL, replace(HALL, robots=(*HALL.robots, third)))
    assert (change.field, change.before) == ("robots[R3]", None)
    assert change.after.startswith('{"id":"R3"')
    assert len(change.after) <= 60


def test_orders_are_compared_by_their_ids_and_a_demand_field_by_field():
    first, second = Order(id="a", goal=(5.0, 7.0)), Order(id="b", goal=(5.0, 1.0))
    demand = Demand(places=((1.0, 4.0), (9.0, 4.0)), seed=1)
    before = replace(HALL, orders=(first, second), demand=demand)
    assert changes(before, replace(before, orders=(second, first))) == []
    after = replace(before, orders=(first,), demand=replace(demand, seed=2))
    gone, seed = changes(before, after)
    assert (gone.field, gone.after) == ("orders[b]", None)
    assert seed == Change("demand.seed", "1", "2")
    (dwell,) = changes(before, replace(before, orders=(replace(first, dwell=3.0), second)))
    assert dwell == Change("orders[a].dwell", "0.0", "3.0")
    (come,) = changes(HALL, replace(HALL, demand=demand))
    assert (come.field, come.before) == ("demand", None)


def test_of_many_obstacles_that_came_five_are_told_and_all_are_counted():
    more = [((x, 6.0), (x + 0.1, 6.0), (x, 6.1)) for x in range(1, 10)]
    told = changes(HALL, a_scenario(ROBOTS, obstacles=[BOX, SHELF, *more]))
    assert len(told) == 6
    assert told[-1] == Change("workspace.obstacles", "2 in all", "11 in all")
