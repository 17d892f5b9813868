import copy
import itertools
import json
import math
import random
import time
import tomllib

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from coordinator.base.errors import InputError
from coordinator.scenario_files.scenario_reader import (
    parse_scenario,
    read_scenario,
    scenario_to_json,
)
from protocol.keys import NAME

TOML = b"""
name = "good"
tau = 0.5
robots = [
  {id = "R1", start = [1, 1], goal = [9.0, 1.0, 1.5], radius = 0.2, max_speed = 0.5},
  {id = "R2", start = [1, 2], goal = [9, 2], via = [[5, 2]], radius = 0.3, max_speed = 0.6},
  {id = "R3", start = [1.0, 3.0], goal = [9.0, 3.0], radius = 0.2, max_speed = 1, max_accel = inf},
]
[workspace]
boundary = [[0, 0], [10, 0], [10, 10], [0, 10]]
obstacles = [[[4.0, 4.0], [6.0, 4.0], [6.0, 6.0], [4.0, 6.0], [4.0, 4.0]]]
"""
GOOD = tomllib.loads(TOML.decode())

# Fault | changes to the good scenario (no value: the key is dropped) | field | words of the line.
ONE_FAULT = r"""
an unknown key at the top | polcy = "safe" | polcy | nearest known one is policy
an unknown key of a robot | robots.1.colour = "red" | robots[1].colour | unknown key
a misspelled key | robots.1.radius = ; robots.1.raduis = 1 | robots[1].raduis | is radius
a misspelled outline | workspace.boundary = ; workspace.bound = 1 | workspace.bound | is bound
no workspace | workspace = | workspace | is missing
no robots key | robots = | robots | is missing
an empty list of robots | robots = [] | robots | at least one
a robot that is a string | robots.1 = "R2" | robots[1] | 'R2' is not a table
no outline | workspace.boundary = | workspace | bounds or boundary is missing
two outlines | workspace.bounds = [0, 0, 9, 9] | workspace | both given
a map that is not there | workspace.boundary = ; workspace.map = "a.yaml" | workspace.map | No such
a map of no kind | workspace.map = "a"; workspace.layer = "b" | workspace.map | a: no suffix is no
bounds turned round | BOUNDS = [9, 0, 0, 9] | workspace.bounds | x0 = 9 m is not below x1 = 0 m
three numbers | BOUNDS = [0, 0, 9] | workspace.bounds | a list of 3 is not [x0, y0, x1, y1]
two corners | workspace.boundary = [[0,0],[9,9],[0,0]] | workspace.boundary | 2 different
a crossed floor | workspace.boundary = [[0,0],[9,9],[9,0],[0,9]] | workspace.boundary | (4.5, 4.5) m
a bow tie | workspace.obstacles.0 = [[1,7],[3,9],[3,7],[1,9]] | workspace.obstacles[0] | at (2, 8) m
no area | workspace.obstacles.0 = [[4,4],[5,5],[6,6]] | workspace.obstacles[0] | needs an area
an endless corner | workspace.obstacles.0.1.1 = Infinity | workspace.obstacles[0][1][1] | inf is not
a start beyond float32 | robots.0.start.1 = -9e3 | robots[0].start[1] | is below -8000 m, where
a start of one number | robots.0.start = [1] | robots[0].start | [x, y] or [x, y, heading]
a heading that is NaN | robots.0.goal.2 = NaN | robots[0].goal[2] | nan is not a finite number
off the floor | robots.0.start.0 = -1 | robots[0].start | is 1 m outside the floor, radius +
a start at the edge | robots.0.start = [0.125, 1] | robots[0].start | is 0.125 m from the edge of
in an obstacle | robots.0.goal = [5, 5] | robots[0].goal | is inside workspace.obstacles[0], rad
a via near one | robots.1.via.0.1 = 3.75 | robots[1].via[0] | is 0.25 m from workspace.obst
close starts | robots.1.start.1 = 1.5 | robots[1].start | R2 is 0.5 m from the start of R1,
close goals | robots.2.goal.1 = 2.5 | robots[2].goal | their radii + margin need 0.55 m
nothing to drive | robots.1.goal = [5, 2] | robots[1].goal | nothing to drive
a goal next to the start | robots.0.goal = [1, 1.0001] | robots[0].goal | the same place as start
a turn at the start | robots.0.start = [9, 1, 0] | robots[0].goal | another heading than start
via points and no goal | robots.1.goal = | robots[1].goal | is missing; a robot with via points
a misspelled goal | robots.1.goal = ; robots.1.gaol = [9, 2] | robots[1].gaol | known one is goal
an idle robot off the floor | robots.0.goal = ; robots.0.start = [0, 1] | robots[0].start | is 0 m
a goal beside an idle one | robots.0.goal = ; robots.2.goal = [1, 1.4] | robots[2].goal | of R1,
idle beside a goal | robots.2.goal = ; robots.0.goal = [1, 2.6] | robots[2].start | the goal of R1
a turn rate of zero | robots.0.max_turn_rate = 0 | robots[0].max_turn_rate | below 0.001 rad/s
a home of one number | robots.0.home = [1] | robots[0].home | is not [x, y] or [x, y, heading]
a home in an obstacle | robots.0.home = [5, 5] | robots[0].home | is inside workspace.obstacles[0]
a via point on the start | robots.1.via.0 = [1, 2] | robots[1].via[0] | the same place as start
a negative radius | robots.2.radius = -0.1 | robots[2].radius | -0.1 m is below 0.001 m
a radius of zero | robots.0.radius = 0 | robots[0].radius | 0 m is below 0.001 m
a speed of nothing | robots.0.max_speed = 9e-4 | robots[0].max_speed | is below 0.001 m/s
a radius in quotes | robots.0.radius = "0.2" | robots[0].radius | '0.2' is not a number
a radius that is true | robots.0.radius = true | robots[0].radius | true is not a number
an endless radius | robots.0.radius = Infinity | robots[0].radius | inf is not a finite number
an endless speed | robots.0.max_speed = "inf" | robots[0].max_speed | 'inf' is not a number
a speed the wire refuses | robots.0.max_speed = 1e3 | robots[0].max_speed | above 999 m/s
an acceleration of zero | robots.0.max_accel = 0 | robots[0].max_accel | 0 m/s^2 is below 0.001
an acceleration in words | robots.0.max_accel = "fast" | robots[0].max_accel | not a number or "inf"
a lateral one below zero | robots.0.max_lateral_accel = -1 | robots[0].max_lateral_accel | is
a negative turning radius | robots.0.min_turn_radius = -1 | robots[0].min_turn_radius | is below 0
a priority and a half | robots.0.priority = 1.5 | robots[0].priority | 1.5 is not an integer
a priority that is true | robots.0.priority = true | robots[0].priority | true is not an integer
a margin of zero | margin = 0 | margin | 0 m is below 0.00595 m
a negative tau | tau = -0.5 | tau | -0.5 s is below 0
a tau of an hour | tau = 3600 | tau | 3600 s is above 60 s
a tau in words | tau = "atuo" | tau | 'atuo' is not a number or "auto"
a reserve of everything | speed_reserve = 1 | speed_reserve | 1 is not below 1
an unknown policy | policy = "bold" | policy | 'bold' is not one of safe, paper
an id twice | robots.2.id = "R1" | robots[2].id | 'R1' is already the id of robots[0]
an id with a slash | robots.0.id = "a/b" | robots[0].id | 'a/b' is not a name
an empty id | robots.0.id = "" | robots[0].id | '' is not a name
a name with a space | name = "my fleet" | name | 'my fleet' is not a name
"""


def changed(changes):
    """Return the good scenario with `path = JSON; path =` changes applied."""
    document = copy.deepcopy(GOOD)
    changes = changes.replace("BOUNDS", "workspace.boundary =; workspace.bounds")
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


def read(document, name="good.json"):
    return parse_scenario(json.dumps(document).encode(), name)


def problems_of(text, name="bad.json"):
    with pytest.raises(InputError) as caught:
        parse_scenario(text if isinstance(text, bytes) else json.dumps(text).encode(), name)
    assert all(problem.isprintable() for problem in caught.value.problems)
    return caught.value.problems


@pytest.mark.parametrize("row", ONE_FAULT.strip().splitlines(), ids=lambda row: row.split(" |")[0])
def test_one_fault_makes_one_line_that_names_its_field(row):
    _, changes, field, words = row.split(" | ")
    (problem,) = problems_of(changed(changes))
    assert problem.startswith(f"bad.json: {field}: ")
    assert words in problem


# Fault: (bytes, file name, words of the line).
UNREADABLE = {
    "an empty file": (b" \n", "bad.toml", "is empty"),
    "a file that is not UTF-8": (b"a = 1\nname = '\xff'", "bad.toml", "line 2: is not UTF-8"),
    "TOML with a syntax error": (b"a = 1\n= 2", "bad.toml", "line 2: Invalid"),
    "TOML that ends early": (b"a = 1\nb = [1,", "bad.toml", "line 2: "),
    "a TOML key that stands twice": (b"a = 1\na = 2", "bad.toml", "line 2: a: the key appears"),
    "JSON with a syntax error": (b'{"a": 1,\n,}', "bad.toml", "line 2: "),
    "a JSON key that stands twice": (b'{"a": 1, "a": 2}', "bad.json", "a: the key appears"),
    "JSON that is a list": (b"[]", "bad.json", "file: a list of 0 is not a table"),
    "lists in lists without end": (b"a = " + b"[" * 100_000, "bad.toml", "nested too deeply"),
    "an integer of 5000 digits": (b"a = 1" + b"0" * 5000, "bad.toml", "too many digits"),
}


@pytest.mark.parametrize("sentence", UNREADABLE)
def test_a_file_that_cannot_be_understood_makes_one_line(sentence):
    text, name, words = UNREADABLE[sentence]
    (problem,) = problems_of(text, name)
    assert problem.startswith(f"{name}: ")
    assert words in problem


def test_faults_too_large_or_too_many_to_print_are_told_in_few_words():
    text = TOML.replace(b"radius = 0.2", b"radius = 0x" + b"f" * 20_000, 1)
    (problem,) = problems_of(text, "bad.toml")
    assert problem == "bad.toml: robots[0].radius: about 1e24082 m is above 100000 m"
    (problem,) = problems_of(GOOD | {"robots": [{}] * 10_001})
    assert problem == "bad.json: robots: 10001 robots are more than 10000"
    *pairs, last = problems_of(fleet([[1, 1]] * 2000, [0.2] * 2000))
    assert len(pairs) == 1000
    assert "over 1000 pairs of starts" in last


@pytest.mark.parametrize("name", ["absent.toml", "", "bad\0name.toml"])
def test_a_path_that_is_no_readable_file_makes_one_line(tmp_path, name):
    with pytest.raises(InputError) as caught:
        read_scenario(tmp_path / name)
    (problem,) = caught.value.problems
    assert tmp_path.name in problem


def test_many_faults_are_all_listed_at_once():
    document = changed(
        'polcy = "safe"; margin = -1; robots.0.radius = "wide"; robots.0.start = [5, 5];'
        'robots.1.id = "R1"; robots.1.goal = [20, 2]; robots.2 = {};'
        "workspace.obstacles = [[[1, 7], [3, 9], [3, 7], [1, 9]], [[4, 4], [6, 4], [6, 6], [4, 6]]]"
    )
    fields = sorted(problem.split(": ")[1] for problem in problems_of(document))
    wrong = "0].radius 0].start 1].goal 1].id 2].id 2].max_speed 2].radius 2].start"
    wrong = [f"robots[{field}" for field in wrong.split()]
    assert fields == ["margin", "polcy", *wrong, "workspace.obstacles[0]"]


def test_no_fault_hides_another():
    document = changed(
        "robots.1.id = ; workspace.boundary = ; workspace.bounds = [0, 0, 10, 10];"
        'workspace.map = "absent.yaml"; workspace.cell = 0'
    )
    document["orders"] = [{"robot": "Z", "goal": [5, 9]}]
    document["demand"] = {"places": [[5, 8]]}
    fields = {problem.split(": ")[1] for problem in problems_of(document)}
    assert fields == {
        "robots[1].id",
        "orders[0].robot",
        "demand.places",
        "workspace.cell",
        "workspace.map",
    }


def test_faults_of_a_path_hide_neither_each_other_nor_those_of_other_paths():
    document = changed("margin = -1")
    few = {"degree": 3, "control_points": [[1, 1], [2, 2]], "weights": [1], "knots": [0, 1]}
    corner = {"degree": 1, "control_points": [[1, 2], [9, 2], [9, 3]]}
    rest = {"radius": 0.2, "max_speed": 0.5}
    document["robots"] = [
        {"id": "R1", "start": [1, 1], "path": few | {"rounding": -1}, **rest},
        {"id": "R2", "path": corner, **rest},
    ]
    assert [problem.split(": ", 1)[1].partition(" ")[0] for problem in problems_of(document)] == [
        "margin:",
        "robots[0].start:",
        "robots[0].path.rounding:",
        "robots[0].path.weights:",
        "robots[0].path.control_points:",
        "robots[0].path.knots:",
        "robots[1].path:",
    ]


def test_a_whole_number_that_no_float_comes_near_is_told():
    path = {"degree": 1, "control_points": [[1, 2], [9, 2]], "knots": [0, 0, 10**400, 1]}
    robot = {"id": "R1", "path": path, "radius": 0.2, "max_speed": 0.5}
    (problem,) = problems_of(GOOD | {"robots": [robot]})
    assert problem == "bad.json: robots[0].path.knots[2]: about 1e400 is too large"


def test_a_good_toml_file_is_read_with_its_defaults(tmp_path):
    (tmp_path / "two.toml").write_bytes(b"\xef\xbb\xbf" + TOML.replace(b"\n", b"\r\n"))
    scenario = read_scenario(tmp_path / "two.toml")
    first, second, third = scenario.robots
    assert (scenario.name, scenario.tau, scenario.margin) == ("good", 0.5, 0.05)
    assert (scenario.policy, scenario.stop_time, scenario.speed_reserve) == ("safe", 2.0, 0.05)
    assert scenario.workspace.boundary == ((0, 0), (10, 0), (10, 10), (0, 10))
    assert scenario.workspace.obstacles == (((4, 4), (6, 4), (6, 6), (4, 6)),)
    assert (first.start, first.goal, second.via) == ((1, 1), (9, 1, 1.5), ((5, 2),))
    assert first.max_accel == first.max_lateral_accel == first.max_speed == 0.5
    assert third.max_accel == third.max_lateral_accel == math.inf
    assert (first.priority, first.min_turn_radius) == (0, 0.0)
    assert isinstance(first.start[0], float)
    assert read(changed("tau =")).tau == "auto"


def test_a_missing_name_comes_from_the_file_and_fits_the_wire():
    paths = ["d/my fleet.json", "ä.json", "x" * 50, ""]
    names = [read(changed("name ="), path).name for path in paths]
    assert names == ["my-fleet", "-", "x" * 32, "scenario"]
    assert all(NAME.fullmatch(name) for name in names)


def test_every_outline_becomes_counter_clockwise_corners():
    clockwise = "workspace.boundary = [[0,0],[0,10],[10,10],[10,0],[0,0]]"
    for outline in (clockwise, "BOUNDS = [0, 0, 10, 10]"):
        corners = read(changed(outline)).workspace.boundary
        assert corners == ((0, 0), (10, 0), (10, 10), (0, 10))


def test_places_with_exactly_the_room_they_need_are_accepted():
    assert read(changed("robots.0.start = [0.25, 1]; robots.1.start = [0.35, 1.5408326913195984]"))


def test_json_reads_back_to_the_same_scenario():
    scenario = parse_scenario(TOML, "first")
    written = scenario_to_json(scenario)
    assert parse_scenario(written, "second.json") == scenario
    assert scenario_to_json(parse_scenario(written, "third")) == written
    assert json.loads(written)["robots"][2]["max_accel"] == "inf"


def fleet(starts, radii):
    """Return a scenario of robots that drive 200 m up, among no obstacles."""
    goals = [[2.0 + 2 * (i % 99), 202.0 + 2 * (i // 99)] for i in range(len(starts))]
    robots = [
        {"id": f"R{i}", "start": start, "goal": goals[i], "radius": radii[i], "max_speed": 1.0}
        for i, start in enumerate(starts)
    ]
    return {"workspace": {"bounds": [0, 0, 300, 400]}, "robots": robots}


def test_overlapping_starts_are_found_as_by_comparing_every_pair():
    draw = random.Random(2)
    starts = [[draw.uniform(2.0, 40.0), draw.uniform(2.0, 40.0)] for _ in range(400)]
    radii = [0.1 + 0.8 * (i % 17 == 0) + 0.02 * (i % 5) for i in range(400)]
    pairs = [
        (f"robots[{b}].start:", f"R{a},")
        for a, b in itertools.combinations(range(400), 2)
        if math.dist(starts[a], starts[b]) < radii[a] + radii[b] + 0.05
    ]
    lines = [problem.split() for problem in problems_of(fleet(starts, radii))]
    assert len(pairs) > 20
    assert sorted((line[1], line[10]) for line in lines) == sorted(pairs)


def test_a_thousand_robots_among_500_obstacles_are_checked_within_a_second():
    document = fleet([[2.0 + 2 * (i % 40), 2.0 + 2 * (i // 40)] for i in range(1000)], [0.3] * 1000)
    document["workspace"]["obstacles"] = [
        [[x, y], [x + 0.4, y], [x + 0.4, y + 0.4], [x, y + 0.4]]
        for x, y in ((2.8 + 2 * (i % 40), 2.8 + 2 * (i // 40)) for i in range(500))
    ]
    begin = time.process_time()
    assert len(read(document).robots) == 1000
    assert time.process_time() - begin < 1.0


def judge(text, name):
    """Fail unless the text is a Scenario that survives JSON or is refused in printable lines."""
    try:
        scenario = parse_scenario(text, name)
    except InputError:
        assert problems_of(text, name)
        return
    assert parse_scenario(scenario_to_json(scenario), "again.json") == scenario


SPECIAL = ["inf", "auto", "R1", None, True, 1e300, 10**400, 1e-300, [[0, 0]], {"a\nb": 1}]
LEAVES = st.sampled_from(SPECIAL) | st.integers() | st.floats() | st.floats(0, 9) | st.text()
JSONISH = st.recursive(LEAVES, lambda inner: st.lists(inner, max_size=4), max_leaves=6)
KEYS = st.text(max_size=6) | st.sampled_from(["bounds", "via", "margin", "priority", "map"])


def containers(value):
    if isinstance(value, dict | list):
        yield value
        for item in value.values() if isinstance(value, dict) else value:
            yield from containers(item)


@settings(derandomize=True, max_examples=300, deadline=None)
@given(data=st.data())
def test_a_scenario_with_anything_changed_is_read_or_refused(data):
    document = copy.deepcopy(GOOD)
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.sampled_from([c for c in containers(document) if c] or [{"": 0}]))
        keys = list(place) if isinstance(place, dict) else range(len(place))
        key = data.draw(st.sampled_from(keys))
        if data.draw(st.booleans()):
            del place[key]
        elif isinstance(place, list):
            place[key : key + data.draw(st.integers(0, 1))] = [data.draw(JSONISH)]
        else:
            place[data.draw(st.just(key) | KEYS)] = data.draw(JSONISH)
    judge(json.dumps(document).encode(), "mutated.json")


@settings(derandomize=True, max_examples=300, deadline=None)
@given(at=st.integers(0, len(TOML)), gone=st.integers(0, 9), put=st.binary(max_size=60))
def test_random_and_damaged_bytes_are_read_or_refused(at, gone, put):
    judge(put, "a\nb.json" if at % 2 else "a.toml")
    judge(TOML[:at] + put[:3] + TOML[at + gone :], "damaged.toml")


def test_keys_and_numbers_that_are_too_long_are_told_in_a_line_and_at_once():
    deep = b"[workspace]\n" + b".".join([b"a"] * 20_000) + b" = 1\n"
    begin = time.process_time()
    assert problems_of(deep, "deep.toml") == ("deep.toml: line 2: A key of over 30 parts",)
    assert time.process_time() - begin < 1.0
    quoted = b'"!".' * 20_000 + b"a = 1"
    assert problems_of(quoted, "q.toml") == ("q.toml: line 1: A key of over 30 parts",)
    for name, long in (("x.toml", b"tau = %s"), ("x.json", b'{"tau": %s}')):
        told = problems_of(long % (b"9" * 5_000), name)
        assert told == (f"{name}: a number has too many digits",)
