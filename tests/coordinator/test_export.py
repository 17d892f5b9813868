"""Motions for other tools, held against the robot's own arithmetic and Foxglove's fields."""

import csv
import io
import json
import math
import random
from pathlib import Path

import msgspec
import numpy as np
import pytest
import shapely
from mcap.reader import make_reader
from typer.testing import CliRunner

from coordinator import trajectory
from coordinator.errors import PlanError
from coordinator.export import csv_lines, story_of_log, story_of_plan
from coordinator.export_foxglove import write_scene
from coordinator.export_scene import floor_entities
from coordinator.export_schema import (
    FrameTransforms,
    SceneUpdate,
    Time,
    json_schema,
    schema_name,
)
from coordinator.export_schema import Log as LogLine
from coordinator.log_commands import commands
from coordinator.logbook import read_log
from coordinator.plan import Floor, to_json
from coordinator.planner import plan_scenario
from coordinator.recorder import Attachment, Recorder
from coordinator.wire import pack
from protocol import keys, phases
from protocol.codec import decode, encode
from protocol.curve import Curve
from protocol.messages import Command, Hello, Report, Rest
from protocol.plan_parts import unpack_plan
from protocol.timeline import Timeline
from tests.json_schema import problems
from tests.scenarios import a_robot, a_scenario, box

SECOND = 1_000_000_000
WALL = 1_700_000_000 * SECOND
BEGIN = 50 * SECOND
FIELDS = json.loads((Path(__file__).parents[1] / "golden" / "foxglove.json").read_text())

CROSS = a_scenario(
    [a_robot("R1", (1.0, 4.0), (9.0, 4.0)), a_robot("R2", (5.0, 1.0), (5.0, 7.0))],
    obstacles=[box(1.0, 1.0, 2.0, 2.0), ((7, 1), (9, 1), (9, 3), (8.9, 3), (8.9, 1.1), (7, 1.1))],
)
GO_1, FREEZE_1, GO_2 = 1.0, 4.0, 7.0


@pytest.fixture(scope="module")
def document():
    return plan_scenario(CROSS, effort=0)


class RobotsOwn:
    """A robot's own curve and time-table, made of the bytes that it gets."""

    def __init__(self, payload):
        parts = unpack_plan(decode("plan", payload))
        self.curve, self.line = Curve(*parts.path), Timeline(*parts.motion)
        self.rate = decode("plan", payload).brake_mmps2 / 1000.0

    def at(self, t):
        s = self.line.s_at(t)
        self.curve.place(s)
        c = self.curve
        return c.x, c.y, math.atan2(c.dy, c.dx), s, self.line.v_at(t)

    def rest(self, t):
        """Arc length of the rest and how long it takes, of a robot that brakes at a time."""
        s, v = self.line.s_at(t), self.line.v_at(t)
        return s + v * v / (2.0 * self.rate), v / self.rate


@pytest.fixture(scope="module")
def second(document):
    """The plan of epoch 2, from where R1 rests; R2 is lost."""
    own = RobotsOwn(pack(document, document.robot("R1")))
    own.curve.place(own.rest(FREEZE_1 - GO_1)[0])
    start = (own.curve.x, own.curve.y)
    robot = a_robot("R1", start, (9.0, 4.0))
    return plan_scenario(
        a_scenario([robot], obstacles=CROSS.workspace.obstacles), effort=0, epoch=2
    )


def records(document, second, rest):
    """What went by in two epochs: R2 is killed at 3.5 s, the fleet freezes half a second later."""
    command, number = keys.command("test"), iter(range(1000))

    def say(epoch, phase, start=0.0):
        start_ns = BEGIN + round(start * SECOND) if start else 0
        return encode(Command(9, next(number), epoch, phase, start_ns))

    yield 0.0, command, say(1, phases.HOLD)
    for robot in document.robots:
        yield 0.1, keys.hello("test", robot.id), encode(Hello(1, 5, 0.2))
        yield 0.2, keys.plan("test", robot.id), pack(document, robot, 9)
    yield 0.5, command, say(1, phases.GO, GO_1)
    for i in range(5):
        yield 1.5 + 0.5 * i, keys.report("test", "R2"), encode(Report(5, i, 1, phases.MOVING))
    yield FREEZE_1, command, say(1, phases.FREEZE, GO_1)
    stopped = Report(5, 9, 1, phases.FROZEN, 0, Rest(rest, 1))
    yield 5.5, keys.report("test", "R1"), encode(stopped)
    yield 6.0, command, say(2, phases.HOLD)
    yield 6.1, keys.plan("test", "R1"), pack(second, second.robots[0], 9)
    yield 6.5, command, say(2, phases.GO, GO_2)
    yield 30.0, keys.report("test", "R1"), encode(Report(5, 10, 2, phases.DONE))
    yield 30.1, command, say(2, phases.OVER)


def log_of(path, document, second, *, attached=True):
    plans = [document, second] if attached else []
    attachments = [
        Attachment(f"plan-{plan.epoch}.json", "application/json", to_json(plan)) for plan in plans
    ]
    own = RobotsOwn(pack(document, document.robot("R1")))
    with Recorder(
        path, metadata={"fleet": "test"}, wall_offset_ns=WALL, attachments=attachments
    ) as log:
        for t, key, payload in records(document, second, own.rest(FREEZE_1 - GO_1)[0]):
            log.record(key, payload, BEGIN + round(t * SECOND))
    return path


@pytest.fixture
def story(tmp_path, document, second):
    return story_of_log(read_log(log_of(tmp_path / "run.mcap", document, second)))


def rows_of(lines):
    return [
        (row["robot"], *(float(row[name]) for name in ("t", "x", "y", "heading", "s", "v")))
        for row in csv.DictReader(io.StringIO("\n".join(lines)))
    ]


def messages_of(data):
    """Return (topic, schema name, schema, log time, message) of every message in a file."""
    found = make_reader(io.BytesIO(data), validate_crcs=True).iter_messages(log_time_order=False)
    return [
        (c.topic, s.name, json.loads(s.data), m.log_time, json.loads(m.data)) for s, c, m in found
    ]


def test_a_plans_csv_is_that_of_the_plan_command(document):
    expected = list(trajectory.csv_rows(document, 0.05))
    assert list(csv_lines(story_of_plan(document), 0.05)) == expected


def test_every_row_of_a_plan_is_where_the_robot_itself_would_be(document):
    own = {robot.id: RobotsOwn(pack(document, robot)) for robot in document.robots}
    for robot, t, *seen in rows_of(csv_lines(story_of_plan(document), 0.1)):
        assert seen == pytest.approx(own[robot].at(t), abs=3e-4)


def test_a_log_is_told_over_all_its_epochs_through_braking_and_rest(story, document, second):
    first = {robot.id: RobotsOwn(pack(document, robot)) for robot in document.robots}
    later = RobotsOwn(pack(second, second.robots[0]))
    frozen = FREEZE_1 - GO_1
    rest, slowing = first["R1"].rest(frozen)
    found = rows_of(csv_lines(story, 0.05))
    ones = [row[1:] for row in found if row[0] == "R1"]
    for t, *seen in ones:
        if t <= frozen:
            assert seen == pytest.approx(first["R1"].at(t), abs=1e-3)
        elif t < GO_2 - GO_1:
            assert t <= frozen + slowing + 1e-6
            left = frozen + slowing - t
            assert seen[3] == pytest.approx(rest - 0.5 * first["R1"].rate * left**2, abs=1e-3)
            assert seen[4] == pytest.approx(first["R1"].rate * left, abs=1e-3)
        else:
            assert seen == pytest.approx(later.at(t - (GO_2 - GO_1)), abs=1e-3)
    times = [t for t, *_ in ones]
    assert times == sorted(times)
    assert times[-1] == pytest.approx(GO_2 - GO_1 + later.line.finish)
    two = [row for row in found if row[0] == "R2"]
    assert two[-1][1] == pytest.approx(3.5 - GO_1)  # when it was last heard
    assert two[-1][6] == pytest.approx(first["R2"].line.v_at(2.5), abs=1e-3)


def test_a_log_without_plans_attached_is_told_from_the_messages(tmp_path, story, document, second):
    path = log_of(tmp_path / "bare.mcap", document, second, attached=False)
    bare = story_of_log(read_log(path))
    assert list(csv_lines(bare, 0.05)) == list(csv_lines(story, 0.05))
    assert {leg.driven.radius for leg in bare.legs} == {0.2}


def test_a_log_that_goes_on_from_another_finds_the_plans_inside_that(tmp_path, document, second):
    inner = Attachment(
        "resumed.mcap",
        "application/x",
        log_of(tmp_path / "inner.mcap", document, second).read_bytes(),
    )
    path = tmp_path / "outer.mcap"
    with Recorder(
        path, metadata={"fleet": "test"}, wall_offset_ns=WALL, attachments=[inner]
    ) as log:
        go = Command(10, 1, 2, phases.GO, BEGIN)
        log.record(keys.command("test"), encode(go), BEGIN)
    (leg,) = story_of_log(read_log(path)).legs
    assert (leg.epoch, leg.driven.id) == (2, "R1")


def test_what_is_written_for_foxglove_has_exactly_its_fields():
    def compare(schema, name):
        assert set(schema["properties"]) == set(schema["required"]) == set(FIELDS[name])
        for field, wanted in FIELDS[name].items():
            found = schema["properties"][field]
            if isinstance(wanted, list):
                assert found["type"] == "array", (name, field)
                found, (wanted,) = found["items"], wanted
            if wanted in ("time", "duration"):
                assert (found["title"], set(found["properties"])) == (wanted, {"sec", "nsec"})
            elif wanted.startswith("foxglove."):
                assert found["title"] == wanted
                compare(found, wanted)
            else:
                assert found["type"] == wanted, (name, field)

    for kind in (SceneUpdate, FrameTransforms, LogLine):
        schema = msgspec.json.decode(json_schema(kind))
        assert "$ref" not in json_schema(kind).decode()
        compare(schema, schema_name(kind))


def test_every_message_fits_its_schema_and_stands_in_order(story, document):
    for told in (story, story_of_plan(document)):
        found = messages_of(write_scene(told, 0.05))
        for topic, name, schema, at, message in found:
            assert name == schema["title"]
            assert list(problems(schema, message)) == [], topic
            stamps = [*message.get("entities", []), *message.get("transforms", []), message]
            for stamp in (one["timestamp"] for one in stamps if "timestamp" in one):
                assert stamp["sec"] * SECOND + stamp["nsec"] == at
        times = [at for *_, at, _ in found]
        assert times == sorted(times)
        assert {topic for topic, *_ in found} >= {"/tf", "/floor", "/robots", "/paths", "/zones"}


def test_the_frames_are_where_the_csv_has_the_robots_twenty_times_a_second(story):
    found = [one for one in messages_of(write_scene(story, 0.05)) if one[0] == "/tf"]
    assert len(found) == pytest.approx(30.1 * 20, abs=2)
    rows = [row for row in rows_of(csv_lines(story, 0.001)) if row[0] == "R1"]
    times, places = np.array([row[1] for row in rows]), np.array([row[2:5] for row in rows])
    for *_, at, message in found:
        (one,) = (each for each in message["transforms"] if each["child_frame_id"] == "robot/R1")
        t = (at - WALL - BEGIN) / SECOND - GO_1
        x, y, heading = places[max(np.searchsorted(times, t + 1e-9) - 1, 0)]
        assert one["parent_frame_id"] == "floor"
        assert one["translation"]["x"] == pytest.approx(x, abs=2e-3)
        assert one["translation"]["y"] == pytest.approx(y, abs=2e-3)
        turn = one["rotation"]
        assert 2.0 * math.atan2(turn["z"], turn["w"]) == pytest.approx(heading, abs=5e-3)


def test_paths_go_when_their_epoch_is_over_and_zones_light_up_while_somebody_waits(story, document):
    found = messages_of(write_scene(story, 0.5))
    first, later = [message for topic, *_, message in found if topic == "/paths"]
    assert {each["id"] for each in first["entities"]} == {"path/R1", "path/R2"}
    assert [each["id"] for each in later["deletions"]] == ["path/R2"]
    (reason,) = document.waits
    zones = messages_of(write_scene(story_of_plan(document), 0.5))
    lit = [(at / SECOND, m["entities"][0]) for topic, *_, at, m in zones if topic == "/zones"]
    assert [bool(entity["texts"]) for _, entity in lit] == [False, True, False]
    assert lit[1][1]["texts"][0]["text"] == f"{reason.robot} waits for {reason.yields_to}"
    assert lit[2][0] - lit[1][0] == pytest.approx(reason.wait, abs=1e-6)


def test_what_happened_is_in_the_log_of_the_viewer(story):
    found = messages_of(write_scene(story, 0.5))
    lines = [(at - WALL - BEGIN, m["level"], m["message"]) for t, *_, at, m in found if t == "/log"]
    assert (round(FREEZE_1 * SECOND), 3, "the fleet was told to freeze") in lines
    assert any(text == "R1 has arrived" and level == 2 for _, level, text in lines)


def test_obstacles_of_any_shape_are_filled_exactly():
    chance = random.Random(3)
    for _ in range(20):
        angles = sorted(chance.uniform(0.0, math.tau) for _ in range(9))
        corners = [
            (r * math.cos(a), r * math.sin(a)) for a in angles for r in (chance.uniform(0.5, 3.0),)
        ]
        if not shapely.Polygon(corners).is_valid:
            continue
        floor = Floor(boundary=[(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], obstacles=[corners])
        points = floor_entities(floor, Time(0, 0))[1].triangles[0].points
        flat = [(point.x, point.y) for point in points]
        parts = [shapely.Polygon(flat[i : i + 3]) for i in range(0, len(flat), 3)]
        whole = shapely.union_all(parts)
        assert whole.symmetric_difference(shapely.Polygon(corners)).area < 1e-9
        assert sum(part.area for part in parts) == pytest.approx(whole.area)


def test_the_command_writes_both_from_both(tmp_path, document, second):
    log_of(tmp_path / "run.mcap", document, second)
    (tmp_path / "plan.json").write_bytes(to_json(document))
    for source in ("run.mcap", "plan.json"):
        for kind, name in (("csv", "a.csv"), ("foxglove", "a.mcap")):
            arguments = ["export", source, "--to", kind, "-o", name]
            arguments[1], arguments[5] = str(tmp_path / source), str(tmp_path / name)
            assert CliRunner().invoke(commands, arguments).exit_code == 0
        assert (tmp_path / "a.csv").read_text().startswith("robot,t,x,y,heading,s,v\n")
        assert messages_of((tmp_path / "a.mcap").read_bytes())


def test_a_log_in_which_nobody_was_sent_off_has_nothing_to_export(tmp_path):
    path = tmp_path / "run.mcap"
    with Recorder(path, metadata={"fleet": "test"}, wall_offset_ns=WALL) as log:
        log.record(keys.command("test"), encode(Command(9, 1, 1, phases.HOLD, 0)), BEGIN)
    arguments = ["export", str(path), "--to", "csv", "-o", str(tmp_path / "a.csv")]
    with pytest.raises(PlanError, match="no robot was sent on its way"):
        commands(arguments, standalone_mode=False)
