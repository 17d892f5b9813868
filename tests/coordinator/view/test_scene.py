"""The scene against what `drive` makes of the same bytes, read back without the code under test."""

import bisect
import math
import random
from functools import cache
from pathlib import Path

import msgspec
import numpy as np
import pytest

from coordinator.base.errors import InputError
from coordinator.findings.info import summarise
from coordinator.fleet.log_records import Request, adoption_key, adoption_record
from coordinator.fleet.rest_places import Standing
from coordinator.log.records import Log, Record
from coordinator.plan.plan_file import from_json, to_json
from coordinator.plan.wire import drive, pack
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.view.figure_left_behind import left_behind
from coordinator.view.scene_log import scene_of_logs
from coordinator.view.scene_plan import scene_of_plan
from coordinator.view.true_tracks import read_ghosts
from protocol import keys
from protocol.codec import encode
from protocol.messages import Clock, Command, Hello, Report, Rest
from protocol.phases import DONE, DRIVER_ERROR, FREEZE, FROZEN, GO, HOLD, MOVING, OFF_PATH, OVER
from protocol.timing import SECOND

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
NEAR = 0.002


@cache
def planned(name):
    return plan_scenario(read_scenario(EXAMPLES / f"{name}.toml"), effort=0)


def place_in(ride, t):
    """Where a ride has its robot at a plan time, by the words of scene.py."""
    s = ride.legs[0][2]
    for t0, t1, s0, s1, v0, v1 in ride.legs:
        if t > t0:
            part = min((t - t0) / (t1 - t0), 1.0)
            s = s0 + (t1 - t0) * part * (v0 + 0.5 * (v1 - v0) * part)
            if part == 1.0:
                s = s1
    arcs, xs, ys = ride.path
    return np.interp(s, arcs, xs), np.interp(s, arcs, ys)


@pytest.mark.parametrize("name", ["paper_five", "paper_five_real", "u_trap", "circle_swap"])
def test_robots_are_where_the_robots_own_code_has_them(name):
    document = planned(name)
    scene = scene_of_plan(document)
    chance = random.Random(1)
    for ride, one in zip(scene.epochs[0].rides, drive(document), strict=True):
        assert scene.robots[ride.robot].id == one.id
        for _ in range(200):
            t = chance.uniform(-1.0, one.timeline.finish + 1.0)
            true = one.curve.at_arc([one.timeline.s_at(t)])[0]
            assert math.dist(place_in(ride, t), true) < NEAR, (one.id, t)


def test_polylines_are_within_a_millimetre_of_the_curves_and_no_longer_than_needed():
    document = planned("paper_five_real")
    for ride, one in zip(scene_of_plan(document).epochs[0].rides, drive(document), strict=True):
        arcs, xs, ys = ride.path
        s = np.linspace(0.0, one.curve.length, 5000)
        found = np.column_stack((np.interp(s, arcs, xs), np.interp(s, arcs, ys)))
        assert np.hypot(*(found - one.curve.at_arc(s)).T).max() < 0.001
        assert len(arcs) < 40 + 30 * one.curve.length


def test_waits_and_zones_are_those_of_the_plan():
    document = planned("paper_five")
    scene = scene_of_plan(document)
    epoch = scene.epochs[0]
    names = [robot.id for robot in scene.robots]
    told = [
        (names[ride.robot], names[wait.lets], pytest.approx(wait.until, abs=1e-3))
        for ride in epoch.rides
        for wait in ride.waits
    ]
    assert told == [
        (robot.id, stop.yields_to, stop.depart) for robot in document.robots for stop in robot.stops
    ]
    forced = [zone for zone in epoch.zones if zone.forces]
    assert [(names[z.a], names[z.b]) for z in forced] == [
        (reason.robot, reason.yields_to) for reason in document.waits
    ]
    assert len(epoch.zones) <= len(document.waits) + len(document.crossings)
    for zone in epoch.zones:
        lengths = [document.robots[i].length for i in (zone.a, zone.b)]
        for (low, high), length in zip((zone.on_a, zone.on_b), lengths, strict=True):
            assert 0.0 <= low <= high <= length + 1e-3


class Telling:
    """A log made message by message; times in seconds after the first GO."""

    def __init__(self, document):
        self.document = document
        self.zero = 5 * SECOND
        self.attachments = {f"plan-{document.epoch}.json": to_json(document)}
        self.records = []
        self.fleet = document.scenario

    def say(self, t, key, payload):
        self.records.append(Record(key, payload, self.zero + round(t * SECOND), 0, 0))

    def command(self, t, epoch, phase, start=0.0):
        said = Command(1, 1, 1, epoch, phase, self.zero + round(start * SECOND), 0)
        self.say(t, keys.command(self.fleet), encode(said))

    def report(self, t, robot, epoch, phase, rest=None, fault=0):
        said = Report(1, 1, epoch, phase, fault, rest)
        self.say(t, keys.report(self.fleet, robot), encode(said))

    def scene(self):
        log = Log({"fleet": self.fleet}, self.attachments, self.records, True, "")
        return scene_of_logs([("run.mcap", log)])


def two_epochs():
    """R3 is lost at 4 s, the others go on with a plan of their own."""
    first = planned("paper_five")
    others = [robot for robot in first.robots if robot.id != "R3"]
    second = msgspec.structs.replace(first, epoch=2, robots=others, crossings=[], waits=[])
    told = Telling(first)
    told.attachments["plan-2.json"] = to_json(second)
    told.command(-0.5, 1, HOLD)
    told.command(-0.4, 1, GO)
    for robot in first.robots:
        told.report(3.8, robot.id, 1, MOVING)
    told.command(4.0, 1, FREEZE)
    rests = {}
    for robot, one in zip(first.robots, drive(first), strict=True):
        if robot.id != "R3":
            rests[robot.id] = one.timeline.s_at(4.0) + 0.05
            told.report(4.4, robot.id, 1, FROZEN, Rest(rests[robot.id], 1))
    standing = [Standing(robot="R3", state="lost", epoch=1, since=3.3, until=4.5)]
    standing += [Standing(robot=n, state="rests", epoch=1, s=s) for n, s in rests.items()]
    told.say(4.8, adoption_key(told.fleet), adoption_record(Request(2, tuple(standing))))
    told.command(4.8, 2, HOLD)
    told.command(5.0, 2, GO, start=5.4)
    told.report(30.0, "R1", 2, DONE)
    told.command(31.0, 3, OVER)
    return told, rests


def test_a_log_tells_its_epochs_its_faults_and_who_stays_behind():
    told, rests = two_epochs()
    scene = told.scene()
    first, second = scene.epochs
    assert (first.epoch, first.start, first.frozen) == (1, 0.0, 4.0)
    assert (second.epoch, second.begin, second.start) == (2, 4.8, 5.4)
    assert second.frozen is None
    names = [robot.id for robot in scene.robots]
    assert [(names[one.robot], one.why) for one in second.aside] == [("R3", "lost")]
    halts = {names[ride.robot]: ride.halt for ride in first.rides}
    lines = {one.id: one.timeline for one in drive(told.document)}
    for name, rest in rests.items():
        t0, t1, s0, s1 = halts[name]
        assert s0 == pytest.approx(lines[name].s_at(t0), abs=1e-3)
        assert s1 == pytest.approx(rest, abs=1e-3)
        assert 4.0 < t0 <= t1 < 5.0
    assert halts["R3"][0] == pytest.approx(3.8, abs=1e-3)
    assert halts["R3"][3] == pytest.approx(lines["R3"].s_at(3.8), abs=1e-3)
    assert all(ride.halt is None for ride in second.rides)
    kinds = [(mark.t, mark.kind) for mark in scene.marks]
    assert kinds == [(0.0, "go"), (4.0, "freeze"), (5.4, "go"), (31.0, "over")]
    assert scene.end == pytest.approx(31.0)


def test_a_picture_names_who_stayed_behind_where_its_plan_had_it_last():
    told, _ = two_epochs()
    (left,) = left_behind(told.scene())
    driven = next(one for one in drive(told.document) if one.id == "R3")
    place = driven.curve.at_arc([driven.timeline.s_at(3.8)])[0]
    assert (left.id, left.why, left.radius) == ("R3", "lost", driven.radius)
    assert math.dist(left.place, place) < NEAR


def test_the_freeze_after_the_last_arrival_is_told_as_the_end_without_the_lost():
    told, _ = two_epochs()
    told.records.pop()
    for robot in ("R2", "R4", "R5"):
        told.report(30.1, robot, 2, DONE)
    told.command(31.0, 2, FREEZE)
    told.command(31.3, 3, OVER)
    scene = told.scene()
    assert [epoch.arrived for epoch in scene.epochs] == [False, True]
    ends = [(mark.t, mark.kind, mark.text) for mark in scene.marks[-2:]]
    text = "all robots on their way have arrived, without R3"
    assert ends == [(31.0, "over", text), (31.3, "over", "over")]
    assert [mark.kind for mark in scene.marks].count("freeze") == 1


def test_a_robot_that_stopped_by_itself_stands_from_when_the_plan_had_it_there():
    document = planned("paper_five")
    told = Telling(document)
    told.command(0.0, 1, GO)
    line = drive(document)[1].timeline
    rest = line.s_at(2.0)
    told.report(2.6, "R2", 1, FROZEN, Rest(rest, 1), fault=OFF_PATH)
    told.command(2.7, 1, FREEZE)
    scene = told.scene()
    t0, t1, s0, s1 = scene.epochs[0].rides[1].halt
    assert (t0, t1) == (pytest.approx(2.0, abs=0.01),) * 2
    assert (s0, s1) == (pytest.approx(rest, abs=1e-3),) * 2
    assert [mark.text for mark in scene.marks if mark.kind == "fault"] == ["R2 off its path"]


def test_the_marks_are_the_faults_that_info_tells():
    told, _ = two_epochs()
    told.report(20.0, "R2", 2, FROZEN, fault=DRIVER_ERROR)
    told.records.sort(key=lambda record: record.log_ns)
    log = Log({"fleet": told.fleet}, told.attachments, told.records, True, "")
    said = [(f["robot"], f["fault"]) for f in summarise(log)["faults"] if f["kind"] != "freeze"]
    marks = [mark.text for mark in told.scene().marks if mark.kind == "fault"]
    assert marks == [f"{robot} {fault}" for robot, fault in said]
    assert marks


def test_a_fleet_that_never_got_a_go_does_not_move():
    told = Telling(planned("paper_five"))
    told.command(0.0, 1, HOLD)
    told.command(9.0, 1, HOLD)
    scene = told.scene()
    assert [epoch.started for epoch in scene.epochs] == [False]
    assert scene.marks == []


def test_a_coordinator_that_goes_on_freezes_the_epoch_before():
    told = Telling(planned("paper_five"))
    told.attachments["plan-2.json"] = to_json(msgspec.structs.replace(told.document, epoch=2))
    told.command(0.0, 1, GO)
    told.command(6.0, 2, FREEZE)
    told.command(6.5, 2, HOLD)
    told.command(7.0, 2, GO, start=7.5)
    first, second = told.scene().epochs
    assert (first.frozen, second.begin, second.start, second.frozen) == (6.0, 6.5, 7.5, None)


def test_logs_that_went_on_from_each_other_make_one_scene():
    told, _ = two_epochs()
    before = [record for record in told.records if record.log_ns < told.zero + 4.5 * SECOND]
    after = told.records[len(before) :]
    names = {"plan-1.json": before, "plan-2.json": after}
    logs = [
        (name, Log({"fleet": told.fleet}, {name: told.attachments[name]}, records, True, ""))
        for name, records in names.items()
    ]
    assert scene_of_logs(logs) == told.scene()


def test_a_log_from_beside_is_drawn_from_its_messages():
    told, _ = two_epochs()
    ahead = 1000 * SECOND
    heard = list(told.records)
    for number in (1, 2):
        document = from_json(told.attachments[f"plan-{number}.json"])
        for robot in document.robots:
            key = keys.hello(told.fleet, robot.id)
            hello = encode(Hello(version=1, boot=1, radius_m=robot.radius))
            said = pack(document, robot, 0)
            for k, payload in ((key, hello), (keys.plan(told.fleet, robot.id), said)):
                heard.insert(0, Record(k, payload, told.zero - SECOND, 0, 0))
    clock = encode(Clock(1, 1, told.zero - SECOND, told.zero - SECOND))
    heard.insert(0, Record(keys.clock(told.fleet, "R1"), clock, told.zero - SECOND, 0, 0))
    heard = [Record(r.key, r.payload, r.log_ns + ahead, 0, 0) for r in heard]
    metadata = {"fleet": told.fleet, "passive": "yes"}
    found = scene_of_logs([("beside.mcap", Log(metadata, {}, heard, True, ""))])
    wanted = told.scene()
    assert found.marks == wanted.marks
    assert found.robots == wanted.robots
    assert found.end == wanted.end
    for mine, theirs in zip(found.epochs, wanted.epochs, strict=True):
        assert [ride.path for ride in mine.rides] == [ride.path for ride in theirs.rides]
        assert [ride.legs for ride in mine.rides] == [ride.legs for ride in theirs.rides]
        assert (mine.begin, mine.start, mine.frozen) == (theirs.begin, theirs.start, theirs.frozen)
    assert (found.boundary, found.proven) == ([], None)
    assert len(found.notes) == 2
    late = [record for record in heard if record.key != keys.plan(told.fleet, "R2")]
    scene = scene_of_logs([("beside.mcap", Log(metadata, {}, late, True, ""))])
    assert "epoch 1: R2 cannot be drawn: plan not heard" in scene.notes


def test_ghosts_are_thinned_to_two_millimetres(tmp_path):
    rows = ["t,x,y,heading,s,phase"]
    for i in range(1000):
        t = 0.01 * i
        x, y = (math.cos(t), math.sin(t)) if t < 5.0 else (math.cos(5.0), math.sin(5.0))
        rows.append(f"{t:.6f},{x:.6f},{y:.6f},0,0,moving")
    (tmp_path / "R2.csv").write_text("\n".join(rows) + "\n9.9,1.0")
    scene = scene_of_plan(planned("paper_five"))
    (ghost,) = read_ghosts(tmp_path, scene.robots)
    assert scene.robots[ghost.robot].id == "R2"
    assert len(ghost.t) < 80
    for row in rows[1:]:
        t, x, y = (float(value) for value in row.split(",")[:3])
        at = min(max(bisect.bisect_right(ghost.t, t) - 1, 0), len(ghost.t) - 1)
        assert ghost.t[at] <= t + 1e-9
        found = np.interp(t, ghost.t, ghost.x), np.interp(t, ghost.t, ghost.y)
        assert math.dist(found, (x, y)) < 0.0035


def test_a_file_that_is_no_black_box_is_named(tmp_path):
    (tmp_path / "R1.csv").write_text("a,b\n1,2\n")
    scene = scene_of_plan(planned("paper_five"))
    with pytest.raises(InputError, match=r"R1\.csv: line 1") as caught:
        read_ghosts(tmp_path, scene.robots)
    assert len(caught.value.problems) == 1
