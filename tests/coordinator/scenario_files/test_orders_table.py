"""Orders, demand, homes and idle robots in scenario files."""

import copy
import json

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.errors import InputError
from coordinator.scenario.model import Demand, Order
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.scenario_files.toml_writer import scenario_to_toml
from tests.scenarios import a_robot, a_scenario, box
from tests.sweeps import are_whole

TOML = b"""
[workspace]
bounds = [0, 0, 10, 10]
obstacles = [[[4, 4], [6, 4], [6, 6], [4, 6]]]
[[robots]]
id = "R1"
start = [1, 1]
goal = [9, 1]
radius = 0.2
max_speed = 0.5
max_turn_rate = 2.0
home = [1, 9, 0.5]
[[robots]]
id = "R2"
start = [1, 3, 0.5]
radius = 0.4
max_speed = 0.5
[[orders]]
goal = [9, 9, 1.5]
via = [[5, 8]]
release = 12
dwell = 3
priority = 2
[[orders]]
id = "back"
robot = "R2"
after = "order-1"
goal = [1, 3]
[demand]
places = [[1, 5], [1, 7, 0.5], [9, 5]]
per_robot = 4
first_within = 30
dwell = 1.5
seed = 7
"""
GOOD = parse_scenario(TOML, "good.toml")
DOCUMENT = json.loads(scenario_to_json(GOOD))

# Fault | changes to the document (no value: the key is dropped) | field | words of the line.
ONE_FAULT = r"""
an id of the demand's | orders.0.id = "R1-4"; orders.1.after = "R1-4" | orders[0].id | of the demand
orders that are a table | orders = {} | orders | a table is not a list of tables
an order that is a string | orders.0 = "o1" | orders[0] | 'o1' is not a table
a misspelled key | orders.0.dwel = 1 | orders[0].dwel | unknown key, the nearest known one is dwell
a misspelled goal | orders.0.goal = ; orders.0.gaol = [9, 9] | orders[0].gaol | known one is goal
no goal | orders.0.goal = | orders[0].goal | is missing
an id with a slash | orders.0.id = "a/b" | orders[0].id | 'a/b' is not a name
an id twice | orders.1.id = "order-1"; orders.1.after = | orders[1].id | the id of orders[0]
an unknown robot | orders.1.robot = "R9" | orders[1].robot | 'R9' is no robot of the scenario
an empty robot | orders.1.robot = "" | orders[1].robot | '' is not a name
an unknown order | orders.1.after = "o9" | orders[1].after | 'o9' is no order of the scenario
an order after itself | orders.1.after = "back" | orders[1].after | 'back' would wait for itself
release and after | orders.1.release = 0 | orders[1].after | is given as well as release
a cycle | orders.0.release = ; orders.0.after = "back" | orders[0].after | itself, by way of 'back'
a release in the past | orders.0.release = -1 | orders[0].release | -1 s is below 0 s
a release without end | orders.0.release = Infinity | orders[0].release | inf is not a finite number
a dwell in words | orders.0.dwell = "long" | orders[0].dwell | 'long' is not a number
a priority and a half | orders.0.priority = 1.5 | orders[0].priority | 1.5 is not an integer from
a goal in an obstacle | orders.0.goal = [5, 5] | orders[0].goal | is inside workspace.obstacles[0]
a goal off the floor | orders.0.goal = [11, 5] | orders[0].goal | is 1 m outside the floor
no room for the robot | orders.1.goal = [0.3, 3] | orders[1].goal | radius + margin need 0.45 m
no room for the smallest | orders.0.goal = [0.2, 3] | orders[0].goal | radius + margin need 0.25 m
a via point at a wall | orders.0.via.0 = [5, 6.1] | orders[0].via[0] | 0.1 m from workspace.obst
a via point on the goal | orders.0.via.0 = [9, 9] | orders[0].goal | the same place as via[0]
a demand that is a list | demand = [] | demand | a list of 0 is not a table
an unknown key of demand | demand.sed = 1 | demand.sed | the nearest known one is seed
no places | demand.places = | demand.places | is missing
an empty list of places | demand.places = [] | demand.places | is empty
one place | demand.places = [[1, 5]] | demand.places | 1 of 1 are free at first, at least 2
places that are taken | demand.places = [[1, 3], [9, 1.4], [9, 9]] | demand.places | 1 of 3 are free
places side by side | demand.places.1 = [1, 5.8] | demand.places[1] | 0.8 m from places[0], two of
a place in a wall | demand.places.2 = [5, 5] | demand.places[2] | is inside workspace.obstacles[0]
a place without room | demand.places.2 = [9.8, 5] | demand.places[2] | is 0.2 m from the edge
a place of one number | demand.places.2 = [9] | demand.places[2] | is not [x, y] or [x, y, heading]
no orders for a robot | demand.per_robot = 0 | demand.per_robot | 0 is not an integer from 1 to
half an order | demand.per_robot = 1.5 | demand.per_robot | 1.5 is not an integer from 1 to
a seed below zero | demand.seed = -1 | demand.seed | -1 is not an integer from 0 to
a start in the past | demand.first_within = -1 | demand.first_within | -1 s is below 0 s
a dwell below zero | demand.dwell = -1 | demand.dwell | -1 s is below 0 s
"""


def changed(changes):
    """Return the good document with `path = JSON; path =` changes applied."""
    document = copy.deepcopy(DOCUMENT)
    for path, _, value in (change.partition("=") for change in changes.split(";")):
        *parents, last = [int(key) if key.isdigit() else key for key in path.strip().split(".")]
        place = document
        for key in parents:
            place = place[key]
        if value.strip():
            place[last] = json.loads(value)
        else:
            del place[last]
    return document


def problems_of(document):
    with pytest.raises(InputError) as caught:
        parse_scenario(json.dumps(document).encode(), "bad.json")
    return caught.value.problems


def with_orders(*orders):
    return DOCUMENT | {"orders": [{"goal": [9, 9]} | order for order in orders]}


@pytest.mark.parametrize("row", ONE_FAULT.strip().splitlines(), ids=lambda row: row.split(" |")[0])
def test_one_fault_makes_one_line_that_names_its_field(row):
    _, changes, field, words = row.split(" | ")
    (problem,) = problems_of(changed(changes))
    assert problem.startswith(f"bad.json: {field}: ")
    assert words in problem


def test_the_keys_become_the_fields_of_the_model():
    first, second = GOOD.robots
    assert (first.max_turn_rate, first.home, first.is_idle) == (2.0, (1.0, 9.0, 0.5), False)
    assert (second.max_turn_rate, second.home, second.is_idle) == (2.0, None, True)
    assert second.goal == second.start == (1.0, 3.0, 0.5)
    sent = Order(
        id="order-1", goal=(9.0, 9.0, 1.5), via=((5.0, 8.0),), release=12.0, dwell=3.0, priority=2
    )
    back = Order(id="back", robot="R2", after="order-1", goal=(1.0, 3.0))
    assert GOOD.orders == (sent, back)
    places = ((1.0, 5.0), (1.0, 7.0, 0.5), (9.0, 5.0))
    assert GOOD.demand == Demand(places=places, per_robot=4, first_within=30.0, dwell=1.5, seed=7)


def test_only_fields_that_are_set_are_written():
    assert DOCUMENT["orders"][1] == {
        "id": "back", "goal": [1.0, 3.0], "robot": "R2", "after": "order-1"
    }  # fmt: skip
    plain = a_scenario(
        [a_robot("R1", (1.0, 1.0), (9.0, 7.0)), a_robot("R2", (1.0, 4.0), (1.0, 4.0))]
    )
    document = json.loads(scenario_to_json(plain))
    assert not {"orders", "demand"} & document.keys()
    assert "home" not in document["robots"][0]
    text = scenario_to_toml(plain).decode()
    assert text.count("goal = ") == 1
    assert not any(key in text for key in ("orders", "demand", "home", "max_turn_rate"))


def test_the_text_is_for_people():
    text = scenario_to_toml(GOOD).decode()
    tail = """
[[orders]]
id = "order-1"
goal = [9.0, 9.0, 1.5]
release = 12.0
via = [[5.0, 8.0]]
dwell = 3.0
priority = 2

[[orders]]
id = "back"
goal = [1.0, 3.0]
robot = "R2"
after = "order-1"

[demand]
places = [[1.0, 5.0], [1.0, 7.0, 0.5], [9.0, 5.0]]
per_robot = 4
first_within = 30.0
dwell = 1.5
seed = 7
"""
    assert text.endswith(tail)


def test_orders_may_share_a_goal_and_one_may_wait_for_a_chain_of_others():
    chain = [{"id": "o0"}, *({"id": f"o{i + 1}", "after": f"o{i}"} for i in range(50))]
    document = with_orders(*chain, {"id": "beside", "after": "o9"})
    assert len(parse_scenario(json.dumps(document).encode(), "chain.json").orders) == 52


def test_each_cycle_is_told_once_and_a_long_one_is_counted():
    ring = [{"id": f"o{i}", "after": f"o{(i + 1) % 7}"} for i in range(7)]
    before = [{"id": "a", "after": "o3"}, {"id": "b", "after": "a"}]
    (problem,) = problems_of(with_orders(*before, *ring))
    assert problem == "bad.json: orders[5].after: 'o3' would wait for itself, by way of 6 others"


def test_an_invalid_id_is_not_also_told_where_others_name_it():
    document = changed('robots.0.id = "a b"; orders.1.robot = "R9"; orders.0.id = "x/y"')
    fields = [problem.split(": ")[1] for problem in problems_of(document)]
    assert fields == ["robots[0].id", "orders[0].id"]


def test_too_many_orders_or_places_are_told_in_one_line_each():
    crowd = with_orders(*[{}] * 100_001)
    crowd["demand"]["places"] = [[1, 5]] * 2_000
    few, *pairs, last = problems_of(crowd)
    assert few == "bad.json: orders: 100001 orders are more than 100000"
    assert len(pairs) == 1_000
    assert "over 1000 pairs are too near" in last


places = st.tuples(st.floats(1.0, 3.5), st.floats(1.0, 9.0))
poses = places | st.tuples(st.floats(1.0, 3.5), st.floats(1.0, 9.0), st.floats(-9.0, 9.0))
times = st.floats(0.0, 1e5)


@st.composite
def orders(draw, number):
    late = {"release": draw(times)}
    if number:
        late = draw(st.just(late) | st.just({"after": f"o{draw(st.integers(0, number - 1))}"}))
    return Order(
        id=f"o{number}",
        goal=draw(poses),
        robot=draw(st.sampled_from(["", "R1", "R2"])),
        via=tuple(draw(st.lists(st.tuples(st.floats(6.5, 9.0), st.just(5.0)), max_size=1))),
        dwell=draw(times),
        priority=draw(st.integers(-1000, 1000)),
        **late,
    )


@st.composite
def scenarios(draw):
    demand = Demand(
        places=((1.0, 1.0), (9.0, 5.0), (5.0, 9.0, draw(st.floats(-9.0, 9.0)))),
        per_robot=draw(st.integers(1, 1_000_000)),
        first_within=draw(times),
        dwell=draw(times),
        seed=draw(st.integers(0, 2**32 - 1)),
    )
    idle = draw(st.tuples(st.floats(7.0, 9.0), st.floats(7.0, 8.0)))
    start = draw(st.just(idle) | st.just((*idle, 0.5)))
    goal = draw(st.sampled_from([start, idle, (*idle, 0.5)]))
    rate, home = draw(st.floats(0.001, 1e5)), draw(st.none() | poses)
    return a_scenario(
        [
            a_robot("R1", start, goal, max_turn_rate=rate, home=home),
            a_robot("R2", (9.0, 1.0), (9.0, 1.0), via=draw(st.sampled_from([(), ((9.0, 2.0),)]))),
        ],
        size=(10.0, 10.0),
        obstacles=[box(4.0, 4.0, 6.0, 6.0)],
        orders=tuple(draw(orders(number)) for number in range(draw(st.integers(0, 3)))),
        demand=draw(st.none() | st.just(demand)),
    )


@settings(derandomize=True, max_examples=60, deadline=None)
@given(scenario=scenarios())
def test_any_orders_and_demand_read_back_equal_from_toml_and_json(scenario):
    assert parse_scenario(scenario_to_toml(scenario), "again.toml") == scenario
    assert parse_scenario(scenario_to_json(scenario), "again.json") == scenario


@settings(derandomize=True, max_examples=200 if are_whole() else 80, deadline=None)
@given(data=st.data())
def test_a_table_with_anything_in_it_is_read_or_refused(data):
    document = copy.deepcopy(DOCUMENT)
    anything = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=3)
    anything = anything | st.lists(anything, max_size=3) | st.just([[1.0, 1.0]]) | st.just({})
    tables = [*document["orders"], document["demand"], *document["robots"]]
    for _ in range(data.draw(st.integers(1, 3))):
        table = data.draw(st.sampled_from(tables))
        table[data.draw(st.sampled_from(sorted(table)))] = data.draw(anything)
    try:
        scenario = parse_scenario(json.dumps(document).encode(), "mutated.json")
    except InputError:
        assert all(problem.isprintable() for problem in problems_of(document))
        return
    assert parse_scenario(scenario_to_json(scenario), "again.json") == scenario
