"""Plan files are read with care: every fault is told in a line, and the file agrees with itself."""

import copy
import functools
import json

import pytest
from msgspec.structs import replace
from rich.console import Console
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.plan_commands import commands
from coordinator.findings.plan_table import render_proof
from coordinator.fleet.log_records import ahead_key, ahead_record
from coordinator.log.records import Log, Record
from coordinator.plan.document import PlanDocument, Stop
from coordinator.plan.plan_file import from_json, to_json
from coordinator.plan.wire import drive, packed
from coordinator.planning.planner import plan_scenario
from coordinator.proof.verify import prove_document
from coordinator.scenario_files.scenario_reader import parse_scenario, scenario_to_json
from coordinator.service.replay import check_log
from protocol import keys
from sim.cli.run_commands import commands as sim_commands
from splinefleet import app
from tests.scenarios import a_robot, a_scenario, box


@functools.cache
def scenario():
    robots = [
        a_robot("R1", (1, 4), (9, 4)),
        a_robot("R2", (5, 1), (5, 7), max_speed=0.6, priority=1),
    ]
    return a_scenario(robots, obstacles=[box(7.5, 5.5, 8.5, 6.5)])


@functools.cache
def document() -> PlanDocument:
    return plan_scenario(scenario(), effort=3)


@functools.cache
def plain():
    return json.loads(to_json(document()))


def changed(changes):
    """Return the plan file with `path = JSON; path = JSON` changes applied."""
    plan = copy.deepcopy(plain())
    for path, _, value in (change.partition("=") for change in changes.split(";")):
        *parents, last = [
            int(key) if key.lstrip("-").isdigit() else key for key in path.strip().split(".")
        ]
        place = plan
        for key in parents:
            place = place[key]
        place[last] = json.loads(value)
    return json.dumps(plan).encode()


def problems_of(text):
    with pytest.raises(InputError) as caught:
        from_json(text, "bad.json")
    assert all(problem.isprintable() for problem in caught.value.problems)
    return caught.value.problems


# What is wrong | changes | field | words of the line.
ONE_FAULT = """
no robots | robots = [] | robots | is empty, must contain at least one robot
a tau of minutes | tau = 900 | tau | is 900 s, must be from 0 to 120 s
a negative margin | margin = -1 | margin | is -1 m, must be from 0 to 100000 m
a radius of zero | robots.0.radius = 0 | robots[R1].radius | is 0 m, must be from 0.001 to
an endless radius | robots.0.radius = 1e308 | robots[R1].radius | is 1e+308 m, must be
a start in days | robots.0.start_time = 9e5 | robots[R1].start_time | must be from 0 to 20000 s
an early finish | robots.0.finish_time = -1 | robots[R1].finish_time | is -1 s, must be at least 0
an id twice | robots.1.id = "R1" | robots[1].id | 'R1' is used twice
an id with a slash | robots.0.id = "a/b" | robots[0].id | is 'a/b', must be 1 to 32 of
no degree | robots.0.path.degree = 0 | robots[R1].path.degree | is 0, must be 1 to 7
a degree of eight | robots.0.path.degree = 8 | robots[R1].path.degree | is 8, must be 1 to 7
knots missing | robots.0.path.knots = [0, 1] | robots[R1].path.knots | has 2, must have control
no weights | robots.0.path.weights = [] | robots[R1].path.weights | has 0, must have one for
far away | robots.0.path.control_points.1.0 = 1e9 | robots[R1].path.control_points[1] | to 1000000
an endless weight | robots.0.path.weights.1 = 1e39 | robots[R1].path.weights[1] | above 0 to 1e+30
a weight of zero | robots.0.path.weights.1 = 0 | robots[R1].path.weights[1] | must be above 0
a loose start | robots.0.path.knots.0 = -1 | robots[R1].path.knots | first 4 are -1 to 0, must all
a loose end | robots.0.path.knots.-1 = 1e6 | robots[R1].path.knots | must be equal
equal knots | robots.0.path.knots = [0,0,0,0,0,0,0,0] | robots[R1].path.knots | are all the same
falling knots | robots.0.path.knots.-1 = 0 | robots[R1].path.knots[ | must not decrease
late profile | robots.0.profile.0.0 = 1e-6 | robots[R1].profile[0][0] | must be 0 m
a short profile | robots.0.profile.-1.0 = 7.99 | robots[R1].profile | ends at 7.99 m, must end
a negative speed | robots.0.profile.1.1 = -1 | robots[R1].profile[1][1] | is -1 m/s, must be
no profile | robots.0.profile = [] | robots[R1].profile | has 0 speed knots, must have 2 or more
a limit of zero | robots.0.limits.max_accel = 0 | robots[R1].limits.max_accel | must be at least 0
two corners | workspace.boundary = [[0, 0], [9, 9]] | workspace.boundary | has 2 corners, must have
a bow tie | workspace.boundary = [[0,0],[9,9],[9,0],[0,9]] | workspace.boundary | cross or touch
one corner | workspace.obstacles.0 = [[1, 1]] | workspace.obstacles[0] | has 1 corners, must have
a far corner | workspace.boundary.0.1 = 1e300 | workspace.boundary[0][1] | must be from -100000
all lost | link.loss = 1.0 | link.loss | is 1, must be from 0 to 0.5
less than none lost | link.loss = -0.1 | link.loss | is -0.1, must be from 0 to 0.5
a delay of an hour | link.delay = 3600 | link.delay | is 3600 s, must be from 0 to 5 s
a message from later | link.delay = -1 | link.delay | is -1 s, must be from 0 to 5 s
an epoch of zero | epoch = 0 | epoch | is 0, must be from 1 to 4294967295
a long message | robots.0.wire_bytes = 9000 | robots[R1].wire_bytes | is 9000, must be from 0 to
a weak brake | robots.0.limits.max_accel = 1e-9 | robots[R1].limits.max_accel | must be at least 0
a racing robot | robots.0.profile.1.1 = 5e3 | robots[R1].profile[1][1] | must be from 0 to 999 m/
waits for nobody | robots.0.start_yields_to = "R9" | robots[R1].start_yields_to | is 'R9', must be
waits for itself | robots.0.start_yields_to = "R1" | robots[R1].start_yields_to | is 'R1', must be
a stranger's wait | waits.0.robot = "R9" | waits[0].robot | is 'R9', must be a robot of the plan
a wait for itself | waits.0.yields_to = "R1" | waits[0].yields_to | is 'R1', must be another robo
a wait off the path | waits.0.s = 99 | waits[0].s | is 99 m, must be from 0 to 8.001 m
less than no wait | waits.0.wait = -1 | waits[0].wait | is -1 s, must be at least 0 s
a stranger's crossing | crossings.0.a = "R9" | crossings[0].a | is 'R9', must be a robot of the p
a crossing off the path | crossings.0.s_b = -4 | crossings[0].s_b | is -4 m, must be from 0 to 6.
a line | workspace.obstacles.0 = [[1,1],[2,2],[3,3]] | workspace.obstacles[0] | must not cross
"""
WAITS_FOR_IT = '{"s": 3, "arrive": 5, "depart": 6, "yields_to": "R1"}'
STOP = '{"s": 3, "arrive": 5, "depart": 6}'
STOPS = {
    "off the path": (STOP.replace("3", "30"), "robots[R1].stops[0].s: is 30 m"),
    "that twice is one": (f"{STOP}, {STOP}", "robots[R1].stops[1].s: is 3 m, must be above 3"),
    "left before it is reached": (STOP.replace("6", "4"), "stops[0].depart: is 4 s"),
    "that lasts for ages": (STOP.replace("6", "1e18"), "stops[0].depart: is 1e+18 s"),
    "for itself": (WAITS_FOR_IT, "robots[R1].stops[0].yields_to: is 'R1', must be another"),
    "before time begins": (STOP.replace("5", "-5"), "stops[0].arrive: is -5 s"),
}


@pytest.mark.parametrize("row", ONE_FAULT.strip().splitlines(), ids=lambda row: row.split(" |")[0])
def test_one_fault_makes_one_line_that_names_its_field(row):
    _, changes, field, words = row.split(" | ")
    (problem,) = problems_of(changed(changes))
    assert problem.startswith(f"bad.json: {field}")
    assert words in problem


@pytest.mark.parametrize("kind", STOPS)
def test_a_stop_that_cannot_be_makes_one_line(kind):
    stops, words = STOPS[kind]
    (problem,) = problems_of(changed(f"robots.0.stops = [{stops}]"))
    assert words in problem


def test_a_curve_that_falls_apart_at_a_knot_is_refused():
    path = {"degree": 1, "knots": [0, 0, 1, 1, 2, 2], "weights": [1] * 4}
    path["control_points"] = [[0, 0], [1, 0], [2, 0], [3, 0]]
    (problem,) = problems_of(changed(f"robots.0.path = {json.dumps(path)}"))
    assert "1 is 2 times an inner knot, may be 1 times" in problem


def test_all_faults_are_told_at_once():
    faults = 'tau = 900; margin = -1; robots.0.radius = 0; link.loss = 1; waits.0.robot = "R9"'
    assert len(problems_of(changed(faults))) == 5


def test_values_of_another_kind_are_told_at_once_beside_those_out_of_range():
    faults = (
        'tau = "long"; margin = -1; policy = "bold"; robots.0.radius = "wide";'
        "robots.1.length = -1;"
        "robots.0.path.knots.0 = null; robots.0.stops = {}; waits.0.wait = []; workspace = [];"
        'robots.0.profile.1 = [1]; crossings.0 = 7; timing = {"a": "b"}'
    )
    plan = json.loads(changed(faults))
    del plan["robots"][0]["wire_bytes"]
    assert set(problems_of(json.dumps(plan).encode())) == {
        "bad.json: tau: is 'long', must be a number",
        "bad.json: margin: is -1 m, must be from 0 to 100000 m",
        "bad.json: policy: is 'bold', must be 'safe' or 'paper'",
        "bad.json: robots[R1].radius: is 'wide', must be a number",
        "bad.json: robots[R1].path.knots[0]: is null, must be a number",
        "bad.json: robots[R1].stops: is a table, must be a list",
        "bad.json: robots[R1].profile[1]: is a list of 1, must be a list of 2 numbers",
        "bad.json: robots[R1].wire_bytes: is missing",
        "bad.json: robots[R2].length: is -1 m, must be above 0 m",
        "bad.json: robots[R2].profile: ends at 6 m, must end at the length, -1 m",
        "bad.json: waits[0].wait: is a list of 0, must be a number",
        "bad.json: crossings[0]: is 7, must be a table",
        "bad.json: workspace: is a list of 0, must be a table",
        "bad.json: timing: is a table, must be a table of numbers",
    }
    assert problems_of(b"[]") == ("bad.json: file: is a list of 0, must be a table",)
    assert "bad.json: robots: is missing" in problems_of(b"{}")


def test_a_number_that_is_not_finite_is_no_plan():
    assert problems_of(changed("tau = 1").replace(b'"tau": 1', b'"tau": 1e999'))
    assert problems_of(changed("tau = 1").replace(b'"tau": 1', b'"tau": NaN'))


@pytest.mark.parametrize("row", ONE_FAULT.strip().splitlines()[:6])
def test_verify_tells_bad_files_as_bad_input(row, tmp_path):
    (tmp_path / "plan.json").write_bytes(changed(row.split(" | ")[1]))
    result = CliRunner().invoke(commands, ["verify", str(tmp_path / "plan.json")])
    assert isinstance(result.exception, InputError)


def test_times_and_lengths_that_the_wire_does_not_give_are_failures():
    plan = document()
    robot = plan.robots[0]
    for fields, words in (
        (
            {"finish_time": 1.0},
            f"R1's finish_time is 1 s in the file, {robot.finish_time:.6g} s on",
        ),
        ({"length": robot.length + 0.01}, "R1's length is 8.01 m in the file, 8 m on the wire"),
    ):
        proof = prove_document(replace(plan, robots=[replace(robot, **fields), *plan.robots[1:]]))
        assert not proof.holds
        assert words in proof.failures[0]


@pytest.mark.parametrize("start", [0.0, 2.0])
def test_an_arrival_that_the_wire_does_not_give_is_a_failure(start):
    robot = replace(document().robots[0], limits=None, start_time=start)
    robot = replace(robot, stops=[Stop(s=3.0, arrive=1.0, depart=30.0)])
    line = drive(replace(document(), robots=[robot]))[0].timeline
    stop = replace(robot.stops[0], arrive=line.arrivals[-1])
    agreeing = replace(robot, finish_time=line.finish, stops=[stop])
    assert prove_document(replace(document(), robots=[agreeing])).holds
    early = replace(agreeing, stops=[replace(stop, arrive=stop.arrive - 0.02)])
    (failure,) = prove_document(replace(document(), robots=[early])).failures
    assert failure.startswith("R1's stops[0].arrive is ")


def test_a_motion_of_years_is_refused_before_it_is_proven():
    robot = document().robots[0]
    crawl = [(s, min(v, 1e-6)) for s, v in robot.profile]
    with pytest.raises(InputError, match=r"robots\[R1\]: lasts .* must be at most 20000 s"):
        prove_document(replace(document(), robots=[replace(robot, profile=crawl, stops=[])]))


def test_a_floor_that_does_not_tell_its_obstacles_is_refused():
    plan = json.loads(to_json(document()))
    del plan["workspace"]["obstacles"]
    with pytest.raises(InputError, match=r"workspace\.obstacles: is missing"):
        from_json(json.dumps(plan).encode())


def test_the_proof_says_what_it_could_not_prove():
    plan = document()
    assert prove_document(plan).unproven == []
    bare = replace(plan, workspace=None, robots=[replace(r, limits=None) for r in plan.robots])
    proof = prove_document(bare)
    assert proof.unproven == ["clearance", "limits"]
    assert prove_document(bare, scenario()).unproven == []
    console = Console(width=200)
    with console.capture() as shown:
        console.print(render_proof(proof))
    assert "not proven: clearance, limits" in shown.get()


@pytest.mark.parametrize("value", ["nan", "inf", "-inf"])
@pytest.mark.parametrize(
    ("command", "option"),
    [("plan", "--step"), ("plan", "--effort"), ("coordinator", "--speed"), ("replay", "--speed"),
     ("coordinator", "--wait"), ("run", "--speed")],
)  # fmt: skip
def test_an_option_that_is_no_finite_number_is_refused_by_name(command, option, value):
    groups = {"run": sim_commands, "replay": app}
    group = groups.get(command, commands)
    result = CliRunner().invoke(group, [command, "absent.toml", f"{option}={value}"])
    assert result.exit_code == 2
    assert option in result.output
    assert option == "--effort" or f"{value} is not a finite number from" in result.output


def test_a_picture_goes_into_a_folder_that_is_there_and_no_other_is_made(tmp_path):
    (tmp_path / "plan.json").write_bytes(to_json(document()))
    plot = ["plot", str(tmp_path / "plan.json"), "-o"]
    assert not CliRunner().invoke(commands, [*plot, str(tmp_path / "a.svg")]).exception
    assert (tmp_path / "a.svg").exists()
    for folder in ("new", "plan.json"):
        assert (
            CliRunner().invoke(commands, [*plot, str(tmp_path / folder / "a.svg")]).exit_code == 2
        )
    assert not (tmp_path / "new").exists()


def test_a_run_into_a_place_that_is_no_folder_makes_one_line(tmp_path):
    source = tmp_path / "scenario.json"
    source.write_bytes(scenario_to_json(scenario()))
    for place in (str(source), "/dev/null", str(source / "run")):
        result = CliRunner().invoke(sim_commands, ["run", str(source), "--out", place])
        assert isinstance(result.exception, InputError)
        (problem,) = result.exception.problems
        assert place in problem
    absent = CliRunner().invoke(
        sim_commands, ["run", str(tmp_path / "absent.toml"), "--out", str(tmp_path / "out")]
    )
    assert isinstance(absent.exception, InputError)
    assert not (tmp_path / "out").exists()


def a_log(**fields):
    told = {
        "metadata": {"boot": "9", "effort": "3"},
        "attachments": {
            "scenario.json": scenario_to_json(scenario()),
            "plan-1.json": to_json(document()),
        },
        "records": [],
        "complete": True,
        "damage": "",
    }
    return Log(**told | fields)


@pytest.mark.parametrize("plan", [b"[]", b"null", b"3", b"", b"\xff", b"[" * 100_000])
def test_an_attached_plan_that_is_none_is_a_difference(plan):
    attachments = a_log().attachments | {"plan-1.json": plan}
    assert "attachment plan-1.json" in check_log(a_log(attachments=attachments)).difference


def test_a_log_without_commands_is_a_difference_also_when_all_agrees():
    assert check_log(a_log()).difference == "the log holds no plan and no command"


def test_a_log_that_was_not_closed_is_told_and_agrees():
    from coordinator.mission.fleet_from_plan import muster

    fleet = muster(packed(document()), 9)
    ahead = ahead_record(fleet.needed_ms + 3_000)
    (sent,) = fleet.tick(10**9)
    assert sent.key == keys.command("test")
    said = [(ahead_key("test"), ahead), (sent.key, sent.payload)]
    records = [Record(key, payload, 10**9, 0, 0) for key, payload in said]
    early = "the log ends at HOLD, before the fleet had ended; all that it contains agrees"
    assert check_log(a_log(records=records)) == (0, 1, "", early)
    note = "the log was not closed; all that it contains agrees"
    assert check_log(a_log(records=records, complete=False)) == (0, 1, "", note)


def test_a_plan_in_place_of_a_scenario_is_named_as_such():
    text = b'{"format": "splinefleet.plan/1", "robots": []}'
    with pytest.raises(InputError, match=r"p\.json is a plan, not a scenario"):
        parse_scenario(text, "p.json")
