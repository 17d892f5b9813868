"""The page and the exported table tell the same of a log in which the fleet was frozen."""

import numpy as np

from coordinator.exchange.motion_story import story_of_log
from coordinator.log.log_writer import WALL_OFFSET
from coordinator.log.records import Log
from coordinator.plan.wire import drive
from coordinator.view.scene_log import scene_of_logs
from protocol.messages import Rest
from protocol.phases import BRAKING, FREEZE, FROZEN, GO, MOVING
from tests.coordinator.view.test_scene import Telling, planned


def on_the_page(ride, t):
    """Where the page has a ride at a time of the plan, by the words of scene.py."""
    if len(ride.passed) > 1 and t > ride.passed[0][0]:
        (t0, p0), (t1, p1) = ride.passed[-2:]
        beyond = p1 + min(max((p1 - p0) / (t1 - t0), 0.0), 1.0) * (t - t1)
        t = beyond if t > t1 else np.interp(t, *zip(*ride.passed, strict=True))
    t = t if ride.ends is None else min(t, ride.ends)
    if ride.halt is not None and t >= ride.halt[0]:
        t0, t1, s0, s1 = ride.halt
        part = min((t - t0) / (t1 - t0), 1.0) if t1 > t0 else 1.0
        s = s0 + (s1 - s0) * part * (2.0 - part)
    else:
        s = ride.legs[0][2]
        for t0, t1, s0, s1, v0, v1 in ride.legs:
            if t >= t0:
                passed = min(t, t1) - t0
                s = s0 + passed * (v0 + 0.5 * (v1 - v0) / (t1 - t0) * passed) if t < t1 else s1
    arcs, xs, ys = ride.path
    return np.interp(s, arcs, xs), np.interp(s, arcs, ys)


def shown(scene, name, times):
    """Where the page has a robot at these times, by the words of scene.py; nan: not there."""
    (epoch,) = scene.epochs
    index = [body.id for body in scene.robots].index(name)
    mine = [ride for ride in epoch.rides if ride.robot == index]
    assert [ride.revision for ride in mine] == sorted(ride.revision for ride in mine)
    places = np.full((len(times), 2), np.nan)
    for number, t in enumerate((times - epoch.start).tolist()):
        begun = [one for one in mine if one.told is None or (one.since or np.inf) <= t]
        if begun:
            places[number] = on_the_page(begun[-1], t)
    return places


def frozen_log():
    """R1 stands at once, R2 falls silent, the others brake from when they hear of the freeze."""
    told = Telling(planned("paper_five_real"))
    told.command(-0.5, 1, GO)
    for number, one in enumerate(drive(told.document)):
        line, rate = one.timeline, one.plan.brake_mmps2 / 1000.0
        told.report(5.8, one.id, 1, MOVING)
        if one.id != "R2":
            heard = 6.02 + 0.003 * number
            rest = line.s_at(heard) + line.v_at(heard) ** 2 / (2.0 * rate)
            told.report(heard + 0.01, one.id, 1, BRAKING)
            rest, after = (line.s_at(5.5), 0.1) if one.id == "R1" else (rest, 1.1)
            told.report(heard + after, one.id, 1, FROZEN, Rest(rest, 1))
    told.command(6.0, 1, FREEZE)
    told.records.sort(key=lambda record: record.log_ns)
    metadata = {"fleet": told.fleet, WALL_OFFSET: "0"}
    return Log(metadata, told.attachments, told.records, True, "")


def test_robots_that_were_frozen_are_at_the_same_places_to_a_millimetre():
    log = frozen_log()
    scene, legs = scene_of_logs([("run.mcap", log)]), story_of_log(log).of_robots()
    times = np.arange(0.0, 8.0, 0.01)
    for ride in scene.epochs[0].rides:
        (leg,) = legs[scene.robots[ride.robot].id]
        seen = np.array([on_the_page(ride, t) for t in times.tolist()])
        off = np.hypot(*(leg.sample(times)[:, :2] - seen).T)
        assert off.max() < 1e-3, scene.robots[ride.robot].id
    assert [ride.halt is not None for ride in scene.epochs[0].rides] == [True] * 5
