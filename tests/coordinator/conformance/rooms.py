"""A robot under examination in virtual time: the Python agent, or one that is broken on purpose."""

from __future__ import annotations

import pytest

from coordinator.conformance.courses import Pace
from coordinator.conformance.examiner import Examiner
from coordinator.conformance.exchanges import EXCHANGES, RESTART
from coordinator.conformance.stage import CLOCK_AHEAD
from protocol import keys
from protocol.timing import MILLISECOND, SECOND
from robot_agent.service import Robot, RobotService
from sim.world.body import SimulatedBody
from sim.world.memory_transport import MemoryNetwork

FLEET, ME, BOOT = "conformance", "R1", 1_000_000
TICK = 10 * MILLISECOND


def examine(make=RobotService, names=(), delay_ms=2, body=None, restart=None, rows=None):
    """Examine a robot by the exchanges whose names begin so, after the first two; all if none.

    `restart`: makes the program that is started when a person is asked to; its true places are
    added to `rows`, as in a black box.
    """
    chosen = [
        one
        for place, one in enumerate(EXCHANGES)
        if not names or place < 2 or one.name.startswith(tuple(names))
    ]
    if restart:
        chosen.append(RESTART)
    network = MemoryNetwork(1, delay_ns=(MILLISECOND, delay_ms * MILLISECOND))
    link, other = network.session("examiner"), network.session("robot")
    examiner = Examiner(FLEET, None, BOOT, Pace(), exchanges=chosen)
    for kind in ("hello", "report", "clock"):
        link.subscribe(
            f"splinefleet/{FLEET}/{kind}/*",
            lambda key, payload, _: examiner.hear(key, payload, network.now_ns),
        )
    link.watch_alive(keys.alive(FLEET, "*"), examiner.hear_alive)

    def clock():
        return network.now_ns + 7_777 * SECOND + network.now_ns * 40 // 1_000_000

    body = body or SimulatedBody(0.5)
    me = Robot(ME, 0.15, 0.5, 0.5)
    robot = make(me, other, body, FLEET, boot=7, clock=clock)
    going, asked = True, 0
    while not examiner.is_over and network.now_ns < 400 * SECOND:
        network.advance(network.now_ns + TICK)
        if going:
            try:
                going = robot.tick(clock())
            except Exception:  # A broken robot's program ends.
                going = False
                body.stop()
        for key, payload in examiner.tick(network.now_ns):
            link.put(key, payload)
        if examiner.exam.asks_person:
            asked += 1
            place = [float(word) for word in examiner.exam.asks_person.split(" at ")[1].split()]
            assert place == pytest.approx([body.x, body.y, body.heading], abs=0.01)
        if asked > 100 and restart is not None:  # A person takes a second.
            network.drop("robot")
            robot = restart(me, network.session("robot"), body, FLEET, boot=8, clock=clock)
            restart, going = None, True
        if rows is not None and examiner.exam.first_start_ns:
            t = (network.now_ns + CLOCK_AHEAD - examiner.exam.first_start_ns) / SECOND
            rows.append((t, body.x, body.y))
    assert examiner.is_over
    return examiner


def failures(examiner):
    """What does not hold, by number."""
    return {one.number: one.seen for one in examiner.findings() if one.seen}


def verdicts(examiner):
    """The verdict on each requirement, by number."""
    return {one.number: one.verdict for one in examiner.findings()}
