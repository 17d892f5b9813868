import math
import string

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.scenario.margin import LEAST_MARGIN
from coordinator.scenario_files.scenario_reader import parse_scenario, read_scenario
from coordinator.scenario_files.toml_writer import WIDTH, scenario_to_toml
from tests.scenarios import a_robot, a_scenario, box, random_scenario
from tests.sweeps import seeds
from tests.test_readme import ROOT

SPEEDS = st.floats(0.001, 999.0)
LENGTHS = st.floats(0.0, 3.0)
NAMES = st.text(string.ascii_letters + string.digits + "_.-", min_size=1, max_size=32)


def again(scenario, comment=""):
    return parse_scenario(scenario_to_toml(scenario, comment), "again.toml")


@st.composite
def robots(draw):
    """A robot on the floor of `scenarios`, anywhere in the middle, with any limits."""
    number = draw(st.integers(0, 10**6))
    place = st.tuples(st.floats(10.0, 20.0), st.floats(10.0, 20.0))
    pose = place | st.tuples(st.floats(10.0, 20.0), st.floats(10.0, 20.0), st.floats(-9.0, 9.0))
    goal = draw(st.tuples(st.floats(30.0, 40.0), st.floats(30.0, 40.0)))
    accel = st.just(math.inf) | SPEEDS
    limits = {
        "max_speed": draw(SPEEDS),
        "max_accel": draw(accel),
        "max_lateral_accel": draw(accel),
        "min_turn_radius": draw(LENGTHS),
        "priority": draw(st.integers(-1000, 1000)),
    }
    kept = draw(st.sets(st.sampled_from(sorted(limits))))
    fields = {key: limits[key] for key in sorted(kept)}
    vias = draw(st.lists(st.tuples(st.floats(21.0, 29.0), st.just(5.0)), max_size=1))
    return a_robot(f"R{number}", draw(pose), goal, via=tuple(vias), radius=0.001, **fields)


@st.composite
def scenarios(draw):
    scenario = a_scenario([draw(robots())], size=(50.0, 50.0))
    corner = draw(st.tuples(st.floats(1.0, 8.0), st.floats(1.0, 8.0)))
    return msgspec.structs.replace(
        scenario,
        name=draw(NAMES),
        workspace=msgspec.structs.replace(
            scenario.workspace, obstacles=(box(*corner, 9.0, 9.0),) * draw(st.integers(0, 2))
        ),
        tau=draw(st.just("auto") | st.floats(0.0, 60.0)),
        margin=draw(st.floats(LEAST_MARGIN, 1.0)),
        policy=draw(st.sampled_from(["safe", "paper"])),
        stop_time=draw(st.floats(1e-9, 1e5)),
        speed_reserve=draw(st.floats(0.0, 0.99)),
    )


@settings(derandomize=True, max_examples=60, deadline=None)
@given(scenario=scenarios())
def test_any_scenario_reads_back_equal_to_the_last_bit(scenario):
    assert again(scenario) == scenario


@pytest.mark.parametrize("seed", seeds(10))
def test_cluttered_scenarios_read_back_equal_but_for_notes(seed):
    scenario = random_scenario(seed)
    read = again(scenario, "two\nlines")
    floor = msgspec.structs.replace(read.workspace, notes=())
    assert msgspec.structs.replace(read, workspace=floor) == scenario


@pytest.mark.parametrize("name", ["paper_five", "paper_five_real", "u_trap", "circle_swap"])
def test_the_examples_read_back_equal(name):
    scenario = read_scenario(ROOT / "examples" / f"{name}.toml")
    assert again(scenario) == scenario


def test_notes_about_a_map_become_comments():
    scenario = a_scenario([a_robot("R1", (1.0, 1.0), (9.0, 7.0))])
    floor = msgspec.structs.replace(scenario.workspace, notes=("read from a map", "twice"))
    noted = msgspec.structs.replace(scenario, workspace=floor)
    assert b"[workspace]\n# read from a map\n# twice\nbounds" in scenario_to_toml(noted)
    assert again(noted) == scenario


def test_the_text_is_for_people():
    scenario = a_scenario(
        [a_robot("R1", (1.0, 1.0, 0.5), (9.0, 7.0), via=((5.0, 2.0),), max_accel=math.inf)],
        obstacles=[box(4.0, 4.0, 5.0, 5.0)],
    )
    assert (
        scenario_to_toml(scenario, "Made by hand.\n\nTwice.").decode()
        == """\
# Made by hand.
#
# Twice.
name = "test"
tau = "auto"
margin = 0.05
policy = "safe"
stop_time = 2.0
speed_reserve = 0.05

[workspace]
bounds = [0.0, 0.0, 10.0, 8.0]
obstacles = [
  [[4.0, 4.0], [5.0, 4.0], [5.0, 5.0], [4.0, 5.0]],
]

[[robots]]
id = "R1"
start = [1.0, 1.0, 0.5]
goal = [9.0, 7.0]
via = [[5.0, 2.0]]
radius = 0.2
max_speed = 0.8
max_accel = inf
"""
    )


def test_an_outline_that_is_no_upright_box_is_listed_corner_by_corner():
    corners = tuple((20.0 + 15.0 * math.cos(i), 20.0 + 15.0 * math.sin(i)) for i in range(6))
    scenario = a_scenario([a_robot("R1", (18.0, 20.0), (22.0, 20.0))], size=(40.0, 40.0))
    floor = msgspec.structs.replace(scenario.workspace, boundary=corners)
    scenario = msgspec.structs.replace(scenario, workspace=floor)
    lines = scenario_to_toml(scenario).decode().splitlines()
    assert again(scenario) == scenario
    assert "boundary = [" in lines
    assert max(map(len, lines)) <= WIDTH
