"""Bodies that fail on request; an unharmed SimulatedBody is what they are measured against."""

import math
import time

import pytest

from robot_agent.driver import DriverError
from sim.processes.scripted_body import LOOK_PERIOD, SCRIPT, FaultyBody
from sim.world.body import SimulatedBody
from sim.world.failing_body import SKID_TIME

TICK = 10_000_000


@pytest.fixture
def script(tmp_path):
    return tmp_path / "R1.txt"


def strike(script, line):
    with script.open("a") as file:
        file.write(line)


def started(script, heading=0.0):
    """A body at the origin whose clock stands at 0."""
    body = FaultyBody(math.inf, script)
    body.place(0.0, 0.0, heading)
    body.step(0)
    return body


def drive_on(body, seconds, begin=0.0, speed=0.5, curvature=0.0):
    """Drive for some seconds as an agent does; return the time at the end."""
    for tick in range(round(begin * 100) + 1, round((begin + seconds) * 100) + 1):
        body.drive(speed, curvature, 0.1)
        body.step(tick * TICK)
    return begin + seconds


def test_without_a_strike_it_drives_like_any_simulated_body(script):
    whole = SimulatedBody()
    whole.place(0.0, 0.0, 0.0)
    whole.step(0)
    faulty = started(script)
    for body in (whole, faulty):
        drive_on(body, 2.0, curvature=0.7)
    assert faulty.true_pose() == whole.true_pose()


def test_slow_wheels_turn_at_their_share_of_what_is_ordered(script):
    body = started(script)
    now = drive_on(body, 1.0)
    strike(script, "slow 0.6\n")
    before = body.x
    drive_on(body, 1.0, now)
    assert body.x - before == pytest.approx(0.6 * 0.5, abs=0.4 * 0.5 * 0.03)


def test_a_slow_body_still_never_goes_farther_than_ordered(script):
    strike(script, "slow 0.6\n")
    body = started(script)
    body.drive(0.5, 0.0, 0.004)
    body.step(4 * TICK)
    assert body.x == pytest.approx(0.6 * 0.004)


def test_a_stalled_base_stands_while_orders_go_on_and_then_drives_again(script):
    body = started(script)
    now = drive_on(body, 1.0)
    strike(script, "stall 0.5\n")
    now = drive_on(body, 0.1, now)
    at = body.x
    now = drive_on(body, 0.4, now)
    assert body.x == at
    drive_on(body, 0.5, now)
    assert body.x - at == pytest.approx(0.25, abs=0.02)


def test_a_base_that_stalls_for_ever_never_moves_again(script):
    strike(script, "stall inf\n")
    body = started(script)
    drive_on(body, 60.0)
    assert body.true_pose() == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("way", [0.1, -0.3])
@pytest.mark.parametrize("heading", [0.0, 2.0])
def test_a_skid_goes_sideways_by_the_metres_asked_within_its_time(script, way, heading):
    body = started(script, heading)
    strike(script, f"skid {way}\n")
    looked = LOOK_PERIOD // TICK
    for tick in range(1, looked + round(SKID_TIME / 0.01) + 1):
        body.step(tick * TICK)
    assert body.x == pytest.approx(-way * math.sin(heading))
    assert body.y == pytest.approx(way * math.cos(heading))
    assert body.heading == heading
    at = body.true_pose()
    body.step(1_000 * TICK)
    assert body.true_pose() == at


def test_a_skid_does_not_keep_the_wheels_from_turning(script):
    body = started(script)
    strike(script, "skid 0.2\n")
    drive_on(body, 1.0)
    assert (body.x, body.y) == (pytest.approx(0.5), pytest.approx(0.2))


def test_a_skid_keeps_its_direction_while_the_body_turns(script):
    whole = SimulatedBody()
    whole.place(0.0, 0.0, 0.0)
    whole.step(0)
    body = started(script)
    strike(script, "skid 0.2\n")
    for one in (whole, body):
        drive_on(one, 1.0, curvature=8.0)
    assert body.x == pytest.approx(whole.x, abs=0.01)
    assert body.y - whole.y == pytest.approx(0.2, abs=0.01)


def test_a_body_sees_what_is_measured_of_its_slide(script):
    body = started(script)
    strike(script, "skid 0.2\n")
    drive_on(body, 1.0)
    assert body.pose() == body.true_pose()


def test_several_strikes_add_up_and_each_is_taken_once(script):
    body = started(script)
    strike(script, "slow 0.5\nskid 0.1\n")
    now = drive_on(body, 1.0)
    strike(script, "skid 0.2\n")
    drive_on(body, 1.0, now)
    assert body.y == pytest.approx(0.3)
    assert body.x == pytest.approx(0.5, abs=0.02)


def test_a_line_is_taken_only_when_it_is_whole(script):
    body = started(script)
    strike(script, "skid 0.")
    now = drive_on(body, 0.5)
    assert body.y == 0.0
    strike(script, "2\n")
    drive_on(body, 0.5, now)
    assert body.y == pytest.approx(0.2)


def test_the_script_is_looked_at_no_more_often_than_every_20_ms(script, monkeypatch):
    looks = []
    monkeypatch.setattr(FaultyBody, "_look", lambda _, now_ns: looks.append(now_ns))
    body = started(script)
    for millisecond in range(1, 1_001):
        body.step(millisecond * 1_000_000)
    assert len(looks) == 51


def test_a_stepped_wall_clock_jumps_and_the_monotonic_one_does_not(script, monkeypatch):
    for name in ("time", "time_ns"):
        monkeypatch.setattr(time, name, getattr(time, name))
    before, before_ns, steady = time.time(), time.time_ns(), time.monotonic_ns()
    strike(script, "clock-step -3600\n")
    body = started(script)
    assert time.time() - before == pytest.approx(-3600.0, abs=60.0)
    assert time.time_ns() - before_ns == pytest.approx(-3600e9, abs=60e9)
    assert 0 <= time.monotonic_ns() - steady < 60e9
    drive_on(body, 1.0)
    assert body.x == pytest.approx(0.5)


def test_an_unknown_strike_is_an_error_of_the_driver(script):
    strike(script, "explode 1\n")
    with pytest.raises(DriverError, match="'explode'"):
        started(script)


def test_the_script_is_named_in_the_environment(script, monkeypatch):
    monkeypatch.setenv(SCRIPT, str(script))
    strike(script, "skid 0.1\n")
    body = FaultyBody(0.5)
    body.place(0.0, 0.0, 0.0)
    body.step(0)
    body.step(1_000 * TICK)
    assert body.y == pytest.approx(0.1)
    monkeypatch.delenv(SCRIPT)
    with pytest.raises(ValueError, match=SCRIPT):
        FaultyBody(0.5)
