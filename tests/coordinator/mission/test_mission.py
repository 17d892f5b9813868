"""When a fleet is planned anew, and when a plan that was found is adopted."""

from __future__ import annotations

from coordinator.fleet.log_records import LINK_GONE
from coordinator.mission.mission import Mission
from coordinator.plan.wire import packed
from coordinator.planning.planner import plan_fleet, plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario
from protocol import keys
from protocol.codec import encode
from protocol.messages import PROTOCOL_VERSION, Admit, Hello, Report, Rest
from protocol.phases import ARMED, BRAKING, FREEZE, FROZEN, GO, HOLD, MOVING
from protocol.timing import COMMAND_PERIOD, SECOND

TWO = b"""
name = "two"
[workspace]
bounds = [0.0, 0.0, 4.0, 4.0]
[[robots]]
id = "R1"
start = [0.5, 1.0]
goal = [3.5, 1.0]
radius = 0.2
max_speed = 0.5
[[robots]]
id = "R2"
start = [0.5, 3.0]
goal = [3.5, 3.0]
radius = 0.2
max_speed = 0.5
"""


class Frozen:
    """A fleet of two that froze because R2 fell silent; R1 has said where it rests."""

    def __init__(self):
        scenario = parse_scenario(TWO, "two.toml")
        document = plan_scenario(scenario, effort=1)
        self.mission = Mission.of_plan(
            scenario, packed(document), 9, lambda s, epoch: plan_fleet(s, effort=1, epoch=epoch)
        )
        self.fleet = self.mission.fleet
        self.now, self.sequence = 5 * SECOND, 0
        for name in ("R1", "R2"):
            self.hear(keys.hello("two", name), Hello(version=PROTOCOL_VERSION, boot=1))
            self.report(name, ARMED)
        self.tick()
        self.report("R1", MOVING)
        self.report("R2", MOVING)
        while not self.fleet.members["R2"].lost:
            self.tick()
            self.report("R1", MOVING)
        self.fleet.leave_floor(self.now)
        self.report("R1", FROZEN, Rest(0.5, 1))
        self.tick()

    def hear(self, key, message):
        self.fleet.hear(key, encode(message), self.now)

    def report(self, name, phase, rest=None, epoch=1):
        self.sequence += 1
        self.hear(keys.report("two", name), Report(1, self.sequence, epoch, phase, 0, rest))

    def tick(self):
        self.now += COMMAND_PERIOD
        self.fleet.tick(self.now)


def test_a_plan_that_comes_while_a_lost_robot_speaks_again_is_asked_for_anew_when_it_dies():
    frozen = Frozen()
    mission = frozen.mission
    request = mission.request(frozen.now)
    recovery = mission.solve(request)
    assert mission.request(frozen.now) is None
    frozen.report("R2", BRAKING)
    assert mission.adopt(request, recovery, frozen.now) is None
    frozen.fleet.hear(keys.alive("two", "R2"), LINK_GONE, frozen.now)
    frozen.report("R1", FROZEN)
    frozen.tick()
    again = mission.request(frozen.now)
    assert again == request
    assert mission.adopt(again, recovery, frozen.now) is not None
    assert frozen.fleet.phase == HOLD


def test_a_robot_that_comes_back_with_a_place_that_cannot_be_stops_nobody_for_good():
    frozen = Frozen()
    mission = frozen.mission
    request = mission.request(frozen.now)
    mission.adopt(request, mission.solve(request), frozen.now)
    place = tuple(round(1000 * x) for x in mission.site.scenario.robots[0].start)
    for epoch in (2, 3):
        frozen.report("R1", ARMED, epoch=epoch)
        frozen.tick()
        frozen.report("R1", MOVING, epoch=epoch)
        assert frozen.fleet.phase == GO
        if epoch == 2:
            frozen.hear(keys.hello("two", "R2"), Hello(PROTOCOL_VERSION, 2, sequence=1))
            frozen.hear(keys.admit("two", "R2"), Admit(5))
            back = Hello(PROTOCOL_VERSION, 2, place=place, sequence=2)
            frozen.hear(keys.hello("two", "R2"), back)
        else:
            frozen.fleet.leave_floor(frozen.now)
        frozen.report("R1", FROZEN, Rest(0.0, epoch), epoch=epoch)
        frozen.tick()
        request = mission.request(frozen.now)
        assert ("R2" in [standing.robot for standing in request.told]) == (epoch == 2)
        mission.adopt(request, mission.solve(request), frozen.now)
        assert [robot.id for robot in mission.document.robots] == ["R1"]
        assert frozen.fleet.phase == HOLD
        where = f"({place[0] / 1000:.2f}, {place[1] / 1000:.2f})"
        if epoch == 2:
            stays = f"it says that it stands at {where}, where R1 stands"
            assert frozen.fleet.members["R2"].stays == stays


def test_a_robot_heard_again_and_admitted_is_planned_for_from_where_it_rests():
    frozen = Frozen()
    mission = frozen.mission
    request = mission.request(frozen.now)
    mission.adopt(request, mission.solve(request), frozen.now)
    frozen.report("R1", ARMED, epoch=2)
    frozen.tick()
    frozen.report("R1", MOVING, epoch=2)
    frozen.report("R2", FROZEN, Rest(1.0, 1))
    assert frozen.fleet.phase == GO
    frozen.hear(keys.admit("two", "R2"), Admit(5))
    assert frozen.fleet.phase == FREEZE
    frozen.report("R1", FROZEN, Rest(0.5, 2), epoch=2)
    frozen.tick()
    request = mission.request(frozen.now)
    mission.adopt(request, mission.solve(request), frozen.now)
    assert (frozen.fleet.phase, mission.document.epoch) == (HOLD, 3)
    starts = {robot.id: robot.path.control_points[0] for robot in mission.document.robots}
    x, y = starts["R2"]
    assert (round(x, 2), round(y, 2)) == (1.5, 3.0)
    assert mission.site.aside == ()
