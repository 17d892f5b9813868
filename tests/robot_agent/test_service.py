"""The shell on the in-memory link, with a hand-made coordinator, in virtual time."""

from __future__ import annotations

import csv
import errno
import math
from random import Random

import numpy as np
import pytest

from protocol import keys
from protocol.codec import decode, encode
from protocol.curve import Curve
from protocol.messages import MOST_NUMBER, Clock, Command, Hello, Plan, Refusal, Report
from protocol.phases import (
    ARMED,
    BRAKING,
    DONE,
    DRIVER_ERROR,
    FREEZE,
    FROZEN,
    GO,
    HOLD,
    MOVING,
    OVER,
)
from protocol.plan_bytes import pack_floats, pack_points, pack_profile, pack_stops
from robot_agent.blackbox import HEADER, BlackBox
from robot_agent.driver import DriverError
from robot_agent.service import RefusedError, Robot, run_robot
from robot_agent.words import ANEW
from sim.judging.blackbox import read_blackbox
from sim.world.body import SimulatedBody
from sim.world.memory_transport import MemoryNetwork
from sim.world.robot_clock import RobotClock
from tests.robot_agent.core.rides import (
    COORDINATOR,
    ME,
    MS,
    NUMBER,
    SECOND,
    TERM,
    motion_along,
    place_at,
    winding_path,
)

FLEET = "hall"
PATH = winding_path("fff")
LENGTH = Curve(*PATH).length
FINISH = LENGTH / 0.475
AHEAD = 0.4
"""How long [s] before its plan begins a robot hears GO."""


def plan_message(**changes) -> Plan:
    degree, knots, xs, ys, _ = PATH
    s, v, *_ = motion_along(LENGTH, 0.475, math.inf)
    speeds, profile = pack_profile(list(zip(s, v, strict=True)))
    fields = {
        "epoch": 1,
        "boot": COORDINATOR,
        "robot": ME,
        "number": NUMBER,
        "revision": 0,
        "begin_ms": 0,
        "tau_ns": SECOND,
        "track_mm": 10,
        "brake_mmps2": 0,
        "clock_ms": 10,
        "degree": degree,
        "points": pack_points(list(zip(xs, ys, strict=True))),
        "knots": pack_floats(knots[degree + 1 : -degree]),
        "weights": b"",
        "speeds": speeds,
        "profile": profile,
        "stops": pack_stops([]),
    }
    return Plan(**{**fields, **changes})


class Hall:
    """A hall with a network, a clock that only `sleep` moves, and a coordinator's side."""

    def __init__(self, **network) -> None:
        self.network = MemoryNetwork(**network)
        self.link = self.network.session("coordinator")
        self.robot_link = self.network.session("robot")
        self.body = SimulatedBody()
        self.phase = HOLD
        self.start_ns = 0
        self.sequence = 0
        self.plans = [plan_message()]
        self.heard: list[Hello | Report | Clock] = []
        self.reactions = {}
        self.silent = False
        self.wrong_ns = 0
        self.headroom_ms = 2_000
        self.held = ()
        self.range = (0, MOST_NUMBER)
        self.run_id = 1
        for kind in (keys.hello, keys.report, keys.clock):
            self.link.subscribe(kind(FLEET, ME), self.hear)

    def clock(self) -> int:
        return self.network.now_ns

    def sleep(self, ns: int) -> None:
        before = self.clock()
        assert before < 600 * SECOND, "the robot does not come to an end"
        self.network.advance(before + ns)
        if before // (100 * MS) != self.clock() // (100 * MS) and not self.silent:
            self.command()
        self.react()

    def command(self) -> None:
        self.sequence += 1
        said_ns = self.clock() + 10**12
        who = (COORDINATOR, TERM, self.sequence, 1, self.phase, self.start_ns, said_ns)
        command = Command(*who, self.headroom_ms, self.held, *self.range, run=self.run_id)
        self.link.put(keys.command(FLEET), encode(command))

    def hear(self, key: str, payload: bytes, _sent_ns: int | None) -> None:
        message = decode(key.split("/")[2], payload)
        self.heard.append(message)
        if isinstance(message, Hello):
            for plan in self.plans:
                self.link.put(keys.plan(FLEET, ME), encode(plan))
        elif isinstance(message, Clock):
            now = self.clock() + 10**12 + self.wrong_ns
            answer = Clock(message.boot, message.sent_ns, now, now, COORDINATOR)
            self.link.put(keys.clock(FLEET, ME), encode(answer))

    def react(self) -> None:
        """Say GO when the robot is armed and OVER when it is done; then whatever a test adds."""
        last = next((m for m in reversed(self.heard) if isinstance(m, Report)), None)
        if last is None:
            return
        if last.phase == ARMED and self.phase == HOLD:
            self.phase, self.start_ns = GO, self.clock() + 10**12 + round(AHEAD * SECOND)
        if last.phase == DONE and self.phase == GO:
            self.phase = OVER
        if last.phase in self.reactions:
            self.reactions.pop(last.phase)()

    def reports(self) -> list[Report]:
        return [m for m in self.heard if isinstance(m, Report)]

    def run(self, **options) -> int:
        options = {"fleet": FLEET, "clock": self.clock, "sleep": self.sleep, **options}
        robot = Robot(ME, 0.15, 0.5, math.inf)
        return run_robot(robot, self.robot_link, self.body, **options)


def raise_interrupt() -> None:
    raise KeyboardInterrupt


@pytest.mark.parametrize("fleet", [FLEET, None])
def test_a_robot_joins_drives_arrives_and_leaves(fleet):
    hall = Hall()
    assert hall.run(fleet=fleet) == 0
    assert [r.phase for r in hall.reports()][-1] == DONE
    assert math.dist((hall.body.x, hall.body.y), goal_of_hall()) < 0.002
    assert next(m for m in hall.heard if isinstance(m, Hello)).radius_m == 0.15


def test_a_robot_on_a_bad_link_arrives_too():
    hall = Hall(seed=4, loss=0.2, doubling=0.2, reordering=0.2, delay_ns=(MS, 6 * MS))
    assert hall.run() == 0
    assert [r.phase for r in hall.reports()][-1] == DONE


def test_a_robot_whose_own_clock_is_wrong_and_drifts_arrives_in_time(tmp_path):
    hall = Hall(delay_ns=(MS, 3 * MS))
    own = RobotClock(hall.clock, -987_654_321, 45)
    box = tmp_path / "R1.csv"
    assert hall.run(clock=own, blackbox=box) == 0
    rows = list(csv.DictReader(box.read_text().splitlines()))
    assert 0.0 <= float(rows[0]["t"]) < 0.02
    assert {row["phase"] for row in rows} == {"moving", "done"}
    done = next(float(row["t"]) for row in rows if row["phase"] == "done")
    assert done == pytest.approx(FINISH, abs=0.05)
    for row in rows:
        if row["phase"] == "moving":
            assert float(row["s"]) == pytest.approx(0.475 * float(row["t"]), abs=0.01)


def test_a_robot_that_is_told_a_wrong_time_is_early_in_its_black_box(tmp_path, monkeypatch):
    """A stranger answers its questions about the time; its coordinator runs on its machine."""
    monkeypatch.setattr("robot_agent.blackbox.shares_clock", lambda boot: boot == COORDINATOR)
    hall, box = Hall(), tmp_path / "R1.csv"
    hall.wrong_ns = 300 * MS
    assert hall.run(host_clock=lambda: hall.clock() + 10**12, blackbox=box) == 0
    rows = list(csv.DictReader(box.read_text().splitlines()))
    moving = [row for row in rows if row["phase"] == "moving"]
    assert len(moving) > 100
    for row in moving:
        assert float(row["t"]) - float(row["estimate"]) == pytest.approx(-0.3, abs=0.01)
        assert float(row["s"]) == pytest.approx(max(0.475 * float(row["estimate"]), 0), abs=0.01)


def test_a_tick_that_takes_long_does_not_count_as_an_error_of_the_clock(tmp_path, monkeypatch):
    monkeypatch.setattr("robot_agent.blackbox.shares_clock", lambda boot: boot == COORDINATOR)
    hall, box = Hall(), tmp_path / "R1.csv"
    step = hall.body.step

    def step_slowly(now_ns: int) -> None:
        step(now_ns)
        hall.network.advance(hall.clock() + 9 * MS)

    hall.body.step = step_slowly
    assert hall.run(host_clock=lambda: hall.clock() + 10**12, blackbox=box) == 0
    rows = list(csv.DictReader(box.read_text().splitlines()))
    assert len(rows) > 100
    for row in rows:
        assert float(row["t"]) == pytest.approx(float(row["estimate"]), abs=0.005)


def test_a_program_that_loses_the_processor_between_two_readings_stamps_its_rows_right(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("robot_agent.blackbox.shares_clock", lambda boot: boot == COORDINATOR)
    hall, box, dice = Hall(), tmp_path / "R1.csv", Random(1)

    def host_clock() -> int:
        now_ns = hall.clock() + 10**12
        if dice.random() < 0.3:
            hall.network.advance(hall.clock() + 6 * MS)
        return now_ns

    assert hall.run(host_clock=host_clock, blackbox=box) == 0
    found = read_blackbox(box)
    assert len(found.t) > 100
    assert (np.diff(found.t) > 0.001).all()
    assert found.clock_error() < 0.005


def test_between_go_and_arrival_a_robot_sends_at_most_120_bytes_a_second():
    hall = Hall()
    hall.run()
    moving = [r.sequence for r in hall.reports() if r.phase == MOVING]
    first = next(i for i, m in enumerate(hall.heard) if getattr(m, "sequence", 0) == moving[0])
    size = sum(
        len(encode(m))
        for m in hall.heard[first:]
        if isinstance(m, Clock | Hello) or (isinstance(m, Report) and m.phase == MOVING)
    )
    assert size / (AHEAD + FINISH) <= 120.0
    assert all(r.rest is None for r in hall.reports())


def test_a_robot_stops_its_motors_even_when_its_black_box_cannot_be_closed(monkeypatch, tmp_path):
    close = BlackBox.close

    def fail(box: BlackBox) -> None:
        close(box)
        raise OSError(errno.ENOSPC, "no space left")

    def interrupt() -> None:
        hall.body.stop = lambda: stopped.append(True)
        raise_interrupt()

    hall, stopped = Hall(), []
    hall.reactions[MOVING] = interrupt
    monkeypatch.setattr(BlackBox, "close", fail)
    with pytest.raises(OSError, match="no space left"):
        hall.run(blackbox=tmp_path / "box.csv")
    assert stopped


def test_a_refusal_ends_the_robot_with_its_reason():
    hall = Hall()
    hall.plans = []

    def refuse() -> None:
        boot = hall.heard[0].boot
        for message in (Refusal(boot ^ 1, "for another"), Refusal(boot, "R1 is not known")):
            hall.link.put(keys.plan(FLEET, ME), encode(message))

    hall.reactions[0] = refuse
    with pytest.raises(RefusedError, match="R1 is not known"):
        hall.run()


def goal_of_hall():
    return place_at(PATH, LENGTH)


def stands_at(hall):
    """Return how far [m] the robot is from its goal, and whether it stands."""
    return math.dist((hall.body.x, hall.body.y), goal_of_hall()), hall.body.speed < 1e-4


def test_a_robot_drives_as_far_as_the_held_entry_with_its_number_says_and_then_on():
    hall = Hall()
    hall.held = ((NUMBER - 1, 100), (NUMBER, 700))
    seen, react = [], hall.react

    def watch():
        react()
        if hall.phase == GO and hall.clock() > 6 * SECOND and not seen:
            seen.append(stands_at(hall))
            hall.held = ((NUMBER - 1, 100),)

    hall.react = watch
    assert hall.run() == 0
    assert seen == [(pytest.approx(LENGTH - 0.7 * 0.475, abs=3e-3), True)]
    assert hall.reports()[-1].phase == DONE


def test_a_robot_whose_number_a_command_does_not_speak_for_is_granted_nothing_by_it():
    hall = Hall()
    hall.range = (NUMBER + 1, MOST_NUMBER)
    seen, react = [], hall.react

    def watch():
        react()
        if hall.phase == GO and hall.clock() > 6 * SECOND and not seen:
            seen.append((hall.reports()[-1].phase, *stands_at(hall)))
            hall.range = (0, NUMBER)

    hall.react = watch
    assert hall.run() == 0
    assert seen == [(MOVING, pytest.approx(LENGTH, abs=1e-3), True)]
    assert hall.reports()[-1].phase == DONE


def test_a_robot_that_hears_no_command_stands_at_its_authority_and_goes_on_when_it_hears_one():
    hall = Hall()
    hall.headroom_ms = 600
    seen, react = [], hall.react

    def watch():
        react()
        if hall.phase == GO and (hall.clock() + 10**12 - hall.start_ns) > 200 * MS and not seen:
            hall.silent = True
        if hall.silent and hall.clock() > 6 * SECOND:
            seen.append((hall.reports()[-1].phase, *stands_at(hall)))
            hall.silent = False

    hall.react = watch
    assert hall.run() == 0
    ((phase, left, stood),) = seen
    assert (phase, stood) == (MOVING, True)
    assert LENGTH - 0.8 * 0.475 - 3e-3 <= left <= LENGTH - 0.6 * 0.475
    assert hall.reports()[-1].phase == DONE


def test_reports_state_stamp_lateness_and_revision():
    hall = Hall()
    hall.plans = [plan_message(revision=5)]
    assert hall.run() == 0
    reports = hall.reports()
    for report in reports:
        assert (report.stamp_ms is not None) == (report.phase in (MOVING, DONE))
        assert report.late == 0
    under_way = [report for report in reports if report.phase == MOVING]
    assert {report.revision for report in under_way} == {5}
    stamps = [report.stamp_ms for report in under_way]
    assert stamps == sorted(stamps)
    assert stamps[0] == pytest.approx(-1000 * AHEAD, abs=110)


def test_a_robot_that_gives_up_says_so():
    hall, told = Hall(), []
    hall.silent = True
    assert hall.run(give_up_ns=3 * SECOND, tell=told.append) == 1
    assert told[-1] == f"{ME}: gave up, heard no coordinator for 3 s"


def test_bytes_that_mean_nothing_and_plans_for_others_do_no_harm():
    hall = Hall()
    good = encode(plan_message())
    hall.plans = [plan_message(robot="R2"), plan_message(boot=1), plan_message()]

    def vandalise() -> None:
        for payload in (b"", b"\xc1" * 50, good[:-1], good[:20] + b"x" + good[21:]):
            for key in (keys.plan(FLEET, ME), keys.command(FLEET), keys.clock(FLEET, ME)):
                hall.link.put(key, payload)

    hall.reactions[ARMED] = vandalise
    assert hall.run() == 0


def test_a_robot_at_its_goal_waits_for_its_coordinator_as_long_as_one_under_way():
    hall, told = Hall(), []

    def fall_silent() -> None:
        hall.silent = True

    hall.reactions[DONE] = fall_silent
    assert hall.run(tell=told.append, give_up_ns=30 * SECOND) == 1
    assert told[-1] == f"{ME}: gave up, heard no coordinator for 30 s"


def test_a_robot_at_its_goal_that_hears_the_coordinator_of_another_run_says_what_to_do():
    hall, told = Hall(), []

    def begin_anew() -> None:
        hall.run_id, hall.phase = 2, HOLD

    hall.reactions[DONE] = begin_anew
    assert hall.run(tell=told.append, give_up_ns=30 * SECOND) == 1
    assert told.count(f"{ME}: {ANEW}") == 1


def test_an_interrupted_robot_stops_its_motors_closes_and_says_130(tmp_path):
    hall = Hall()
    hall.reactions[MOVING] = raise_interrupt
    assert hall.run(blackbox=tmp_path / "box.csv") == 130
    assert hall.body.speed == 0.0
    heard = len(hall.heard)
    hall.robot_link.put(keys.hello(FLEET, ME), b"late")
    hall.network.advance(hall.clock() + SECOND)
    assert len(hall.heard) <= heard + 1


def test_a_broken_driver_stops_the_motors_and_is_reported():
    hall = Hall()

    def broken() -> None:
        raise DriverError("no encoder")

    def break_driver() -> None:
        hall.body.pose = broken

    def mend() -> None:
        del hall.body.pose

    hall.reactions[MOVING] = break_driver
    hall.reactions[BRAKING] = mend
    hall.reactions[FROZEN] = raise_interrupt
    assert hall.run() == 130
    assert hall.reports()[-1].fault == DRIVER_ERROR
    assert hall.reports()[-1].rest is not None
    assert hall.body.speed == 0.0


def test_a_base_that_loses_its_place_on_the_way_is_stopped_and_not_placed_at_its_start():
    hall = Hall()
    placed: list[tuple[float, float, float]] = []

    def lose_place() -> None:
        hall.body.pose = lambda: None
        hall.body.place = lambda *pose: placed.append(pose)

    def find_place() -> None:
        del hall.body.pose

    hall.reactions[MOVING] = lose_place
    hall.reactions[BRAKING] = find_place
    hall.reactions[FROZEN] = raise_interrupt
    assert hall.run() == 130
    assert placed == []
    assert hall.reports()[-1].fault == DRIVER_ERROR
    assert hall.body.speed == 0.0


def test_a_black_box_of_a_robot_that_never_heard_go_has_only_its_header(tmp_path):
    hall = Hall()
    hall.reactions[ARMED] = raise_interrupt
    assert hall.run(blackbox=tmp_path / "box.csv") == 130
    assert (tmp_path / "box.csv").read_text() == HEADER


def test_a_frozen_robot_stays_for_the_next_epoch():
    hall = Hall()

    def freeze() -> None:
        hall.phase = FREEZE

    def wait_and_leave() -> None:
        hall.silent = True
        hall.network.advance(hall.clock() + 10 * SECOND)
        hall.reactions[FROZEN] = raise_interrupt

    hall.reactions[MOVING] = freeze
    hall.reactions[FROZEN] = wait_and_leave
    assert hall.run() == 130
    assert next(r.rest is not None for r in hall.reports() if r.phase == FROZEN)


def test_a_robot_that_is_started_again_and_hears_no_go_any_more_keeps_its_black_box(tmp_path):
    box = tmp_path / "R1.csv"
    assert Hall().run(blackbox=box) == 0
    before = box.read_text()
    hall = Hall()
    hall.phase = OVER
    assert hall.run(blackbox=box) == 0
    assert box.read_text() == before
