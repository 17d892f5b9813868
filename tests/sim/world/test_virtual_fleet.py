"""Fleet core and robots together in virtual time, on good links and bad ones, sound and failing."""

import math

import numpy as np
import pytest
import shapely
from msgspec.structs import replace

from coordinator.fleet.log_records import TOLD_TO_GO_ON, TOLD_TO_STOP
from coordinator.fleet.phases import HELD_PATIENCE
from coordinator.mission.replanning_input import stretch
from coordinator.planning.planner import plan_scenario
from coordinator.scenario_files.scenario_reader import parse_scenario
from protocol.phases import DONE, GO, OVER, PHASE_NAMES
from protocol.timing import CLOCK_ERROR, MILLISECOND, SECOND
from sim.campaigns.truth import arrived, touches
from sim.floors.generator import generate
from sim.judging.judge import judge_boxes
from sim.world.fault_text import Fault
from sim.world.inhabitant import Inhabitant
from sim.world.memory_transport import MemoryNetwork
from sim.world.virtual_fleet import NO_FLAWS, USUAL_FLAWS, World

SCENARIO = b"""
name = "three"
margin = 0.05
[workspace]
bounds = [0.0, 0.0, 5.0, 5.0]
obstacles = [[[3.6, 3.6], [4.2, 3.6], [4.2, 4.2], [3.6, 4.2]]]
[[robots]]
id = "R1"
start = [0.6, 2.0]
goal = [4.4, 2.0]
radius = 0.15
max_speed = 0.6
[[robots]]
id = "R2"
start = [2.0, 0.6]
goal = [2.0, 4.4]
radius = 0.2
max_speed = 0.5
[[robots]]
id = "R3"
start = [4.4, 4.7]
goal = [1.0, 1.0]
radius = 0.15
max_speed = 0.4
"""


ROBOTS = ("R1", "R2", "R3")

STRETCH_STEP = 0.02
"""A stretch where a robot may stand is followed in such steps [m]."""


@pytest.fixture(scope="module")
def scenario():
    return parse_scenario(SCENARIO, "three.toml")


@pytest.fixture(scope="module")
def document(scenario):
    return plan_scenario(scenario)


def good_link(seed=0):
    return MemoryNetwork(seed, delay_ns=(MILLISECOND, 3 * MILLISECOND))


def struck(scenario, document, *faults, seed=5, flaws=NO_FLAWS):
    """Return a world after a whole run with these faults."""
    world = World(scenario, document, good_link(seed), seed=seed, faults=faults, flaws=flaws)
    world.run(300.0)
    world.go_on(1.0)
    return world


def incidents(world, kind):
    return [one for one in world.fleet.incidents if one.kind == kind]


def push(body, left, on):
    """Put a body so far [m] to its left and ahead."""
    body.x += on * math.cos(body.heading) - left * math.sin(body.heading)
    body.y += on * math.sin(body.heading) + left * math.cos(body.heading)


def nobody_froze(world):
    """Return whether everybody drove on in one epoch, and the plan was never made anew."""
    phases = [one.text for one in incidents(world, "phase")]
    return phases == ["GO", "OVER"] and list(world.mission.documents) == [1]


def when_given_up(world, robot):
    """Return when others were first sent around a robot [s since the first GO]; None if never."""
    told = [one.now_ns for one in incidents(world, "fault") if one.text.endswith(f"around {robot}")]
    return (told[0] - world.began_ns) / SECOND if told else None


def last_motion(box, until):
    moved = np.flatnonzero(np.hypot(*np.diff(box.places, axis=0).T) > 1e-6)
    ends = [box.t[i + 1] for i in moved if box.t[i + 1] <= until]
    return max(ends, default=0.0)


def test_on_a_good_link_everybody_arrives_when_planned(scenario, document):
    world = World(scenario, document, good_link(), flaws=USUAL_FLAWS)
    world.run(120.0)
    assert world.fleet.phase == OVER
    verdict = judge_boxes(document, world.blackboxes())
    assert verdict.collisions == 0
    for robot in verdict.robots:
        assert robot.arrived
        assert robot.t == pytest.approx(document.robot(robot.id).finish_time, abs=0.3)
        assert robot.tracking_error < document.margin / 2
        assert 0.0 < robot.clock_error < CLOCK_ERROR / SECOND
    assert verdict.collisions_with_obstacles == 0


def test_idle_robots_arm_and_are_done_where_they_stand(scenario):
    idle = [
        replace(scenario.robots[0], id=f"I{number}", start=place, goal=place)
        for number, place in enumerate([(3.0, 2.6), (2.6, 3.0, 2.0)])
    ]
    for robots in ((*scenario.robots, *idle), tuple(idle)):
        some = replace(scenario, robots=robots)
        document = plan_scenario(some)
        world = World(some, document, good_link(), flaws=USUAL_FLAWS)
        world.run(120.0)
        assert world.fleet.phase == OVER
        boxes = world.blackboxes()
        assert {box.phases[-1] for box in boxes.values()} == {PHASE_NAMES[DONE]}
        verdict = judge_boxes(document, boxes)
        assert verdict.collisions == 0
        assert all(robot.arrived for robot in verdict.robots)
        for robot in idle:
            assert np.hypot(*(boxes[robot.id].places - robot.start[:2]).T).max() < 2e-3


def test_the_same_seed_gives_the_same_run(scenario, document):
    rows = []
    for _ in range(2):
        network = MemoryNetwork(3, loss=0.1, delay_ns=(0, 50 * MILLISECOND), doubling=0.1)
        faults = [Fault("stall", "R1", 3.0, 1.0), Fault("corrupt", "R2", 2.0, 2.0)]
        world = World(scenario, document, network, seed=3, faults=faults, flaws=USUAL_FLAWS)
        world.run(60.0)
        rows.append({name: robot.rows for name, robot in world.robots.items()})
    assert rows[0] == rows[1]
    assert len(rows[0]["R1"]) > 100


@pytest.mark.parametrize("flaws", [NO_FLAWS, USUAL_FLAWS])
@pytest.mark.parametrize("row_ms", [0, 70])
def test_robots_that_sleep_do_say_and_record_the_same(
    scenario, document, monkeypatch, flaws, row_ms
):
    """Robots rest at their goals while one is pushed, one's base fails and one's clock is set."""
    sent, send = [], MemoryNetwork.send
    monkeypatch.setattr(
        MemoryNetwork, "send", lambda *told: sent.append((told[0].now_ns, *told[1:])) or send(*told)
    )

    def seen():
        sent.clear()
        faults = [
            Fault("kill", "R3", 22.0),
            Fault("driver-error", "R1", 14.0),
            Fault("clock-jump", "R2", 15.003, -0.5),
            Fault("hang", "R3", 16.0, 0.5),
            Fault("clock-pause", "R1", 18.001, 1.0),
            Fault("clock-jump", "R1", 18.5, 1.0),
            Fault("stall", "R3", 5.0, 2.0),
        ]
        network = MemoryNetwork(2, loss=0.05, delay_ns=(0, 5 * MILLISECOND))
        world = World(
            scenario, document, network, seed=2, faults=faults, flaws=flaws,
            row_period_ns=row_ms * MILLISECOND or 1, stays=True,
        )  # fmt: skip
        world.run(25.0)
        push(world.robots["R2"].body, 0.001, 0.0)
        world.run(1.0)
        clocks = [vars(robot.service.agent.clock) for robot in world.robots.values()]
        rows = {name: robot.rows for name, robot in world.robots.items()}
        if flaws is not NO_FLAWS:
            rows = {name: changes(some) for name, some in rows.items()}
        return rows, clocks, list(sent)

    worked, work = [], Inhabitant._work
    monkeypatch.setattr(Inhabitant, "_work", lambda *told: worked.append(told) or work(*told))
    asleep, busy = seen(), len(worked)
    monkeypatch.setattr(Inhabitant, "_sleep", lambda *_: None)
    assert seen() == asleep
    assert busy < 0.7 * (len(worked) - busy)


def changes(rows):
    """Return a black box's rows, without s, whose place or phase differ from the one before."""
    told = [(t, *place, phase) for t, *place, _, phase, _ in rows]
    pairs = zip([None, *told], told, strict=False)
    return [row for before, row in pairs if before is None or before[1:] != row[1:]]


@pytest.mark.parametrize("seed", range(4))
def test_on_a_worse_link_than_planned_for_nobody_touches(scenario, document, seed):
    network = MemoryNetwork(
        seed,
        loss=0.1 * seed,
        delay_ns=(0, 50 * seed * MILLISECOND),
        doubling=0.1,
        reordering=0.1,
    )
    world = World(scenario, document, network, seed=seed)
    world.run(60.0)
    assert touches(document, world.blackboxes()) == []


@pytest.mark.parametrize("dead", ROBOTS)
@pytest.mark.parametrize("time", [0.5, 3.5, 7.5])
def test_when_a_robot_dies_the_others_arrive_and_only_those_behind_it_wait(
    scenario, document, dead, time
):
    world = struck(scenario, document, Fault("kill", dead, time))
    boxes = world.blackboxes()
    assert world.fleet.members[dead].lost
    assert touches(document, boxes) == []
    assert arrived(world, document, boxes) == set(ROBOTS) - {dead}
    assert nobody_froze(world)
    given_up = when_given_up(world, dead)
    if given_up is None:
        for box in boxes.values():
            assert last_motion(box, math.inf) <= document.robot(dead).finish_time + 20.0
    else:
        assert given_up - time > HELD_PATIENCE / SECOND
        body = shapely.Point(world.robots[dead].body.true_pose()[:2])
        solid = shapely.Polygon(world.mission.dispatcher.obstructions.around[dead])
        assert solid.covers(body.buffer(document.robot(dead).radius - 1e-3))


def test_the_black_box_of_a_dead_robot_covers_the_whole_run(scenario, document):
    world = struck(scenario, document, Fault("kill", "R2", 2.0))
    ends = [box.t[-1] for box in world.blackboxes().values()]
    assert max(ends) - min(ends) < 0.02
    assert min(ends) > 10.0


@pytest.mark.parametrize(
    ("fault", "reason"),
    [
        (Fault("skid", "R1", 3.0, 0.06), "R1 stopped: off its path"),
        (Fault("driver-error", "R1", 3.0), "R1 stopped: driver error"),
    ],
)
def test_whoever_fails_arrives_on_a_further_course_of_the_epoch(scenario, document, fault, reason):
    world = struck(scenario, document, fault)
    boxes = world.blackboxes()
    assert incidents(world, "fault")[0].text.endswith(reason)
    assert touches(document, boxes, [fault]) == []
    assert nobody_froze(world)
    assert world.fleet.grants.of("R1").now.revision > 0
    assert arrived(world, document, boxes) == set(ROBOTS)


@pytest.mark.parametrize(
    "fault",
    [
        Fault("hang", "R1", 3.0, 4.0),
        Fault("cut", "R1", 3.0, 4.0),
        Fault("stall", "R1", 3.0, 0.6),
        Fault("stall", "R1", 3.0, 4.0),
        Fault("slow", "R3", 2.0, 0.5),
        Fault("clock-jump", "R2", 3.0, 6.0),
        Fault("clock-jump", "R2", 3.0, -6.0),
        Fault("clock-pause", "R2", 3.0, 2.0),
        Fault("coordinator-hang", "", 3.0, 4.0),
    ],
)
def test_whoever_is_late_or_away_for_a_while_goes_on_and_nobody_plans_anew(
    scenario, document, fault
):
    world = struck(scenario, document, fault)
    boxes = world.blackboxes()
    assert [one.text for one in incidents(world, "phase")] == ["GO", "OVER"]
    assert touches(document, boxes) == []
    assert arrived(world, document, boxes) == set(ROBOTS)
    verdict = judge_boxes(document, boxes)
    assert all(robot.tracking_error < 0.5 * document.margin for robot in verdict.robots)


@pytest.mark.parametrize("tau", [0.2, 0.3, 0.7])
def test_a_tau_that_covers_no_fault_is_as_safe(scenario, tau):
    short = replace(scenario, tau=tau)
    document = plan_scenario(short)
    world = struck(short, document, Fault("stall", "R1", 3.0, 2.0), Fault("hang", "R2", 4.0, 3.0))
    boxes = world.blackboxes()
    assert touches(document, boxes) == []
    assert arrived(world, document, boxes) == set(ROBOTS)


def test_a_fleet_that_is_stopped_for_a_minute_goes_on_where_it_was(scenario, document):
    world = World(scenario, document, good_link(), flaws=USUAL_FLAWS)
    world.run(5.0)
    world.coordinator.driver.tell(TOLD_TO_STOP, world.now_ns)
    world.go_on(2.0)
    stood = {name: robot.body.true_pose() for name, robot in world.robots.items()}
    world.go_on(58.0)
    assert {name: robot.body.true_pose() for name, robot in world.robots.items()} == stood
    world.coordinator.driver.tell(TOLD_TO_GO_ON, world.now_ns)
    world.run(120.0)
    boxes = world.blackboxes()
    assert (world.fleet.phase, world.fleet.epoch) == (OVER, 1)
    assert arrived(world, document, boxes) == set(ROBOTS)
    assert touches(document, boxes) == []
    assert incidents(world, "fault") == []


def test_ten_robots_that_follow_each_other_round_a_loop_all_arrive_however_late():
    for tau in (0.2, "auto"):
        loop = replace(generate("ring", 10, 1), tau=tau)
        document = plan_scenario(loop)
        late = [
            Fault("stall", robot.id, 4.0, 1.0 + 4.0 * number / 9.0)
            for number, robot in enumerate(loop.robots)
        ]
        world = World(loop, document, good_link(), faults=late)
        world.run(300.0)
        boxes = world.blackboxes()
        assert (world.fleet.phase, world.fleet.epoch) == (OVER, 1)
        assert len(arrived(world, document, boxes)) == 10
        assert touches(document, boxes) == []


def test_random_bytes_on_a_robots_keys_change_nothing(scenario, document):
    world = struck(scenario, document, Fault("corrupt", "R1", 1.0, 5.0))
    assert world.fleet.epoch == 1
    assert world.fleet.bad_messages > 100
    assert arrived(world, document, world.blackboxes()) == set(ROBOTS)


def test_a_hanging_coordinator_says_nothing_and_a_hanging_robot_hears_nothing(scenario, document):
    faults = [Fault("coordinator-hang", "", 2.0, 3.0), Fault("hang", "R2", 3.0, 1.0)]
    world = World(scenario, document, good_link(), faults=faults)
    while not world.began_ns or world.now_ns < world.began_ns + 3 * SECOND:
        world.step()
    assert world.fleet.phase == GO
    said, heard = len(world.fleet.incidents), world.robots["R2"].service.heard_ns
    world.go_on(0.9)
    assert (said, heard) == (len(world.fleet.incidents), world.robots["R2"].service.heard_ns)


def test_the_robots_say_little_under_way(scenario, document):
    world = World(scenario, document, MemoryNetwork(0, delay_ns=(MILLISECOND, 2 * MILLISECOND)))
    world.run(120.0)
    seconds = max(robot.rows[-1][0] for robot in world.robots.values())
    assert world.coordinator.bytes_heard / len(world.robots) / seconds < 100


@pytest.mark.parametrize(("left", "on"), [(0.15, 0.0), (0.0, 0.15), (0.0, -0.15), (-0.1, 0.1)])
def test_a_robot_that_is_pushed_off_its_goal_says_so_and_drives_back(scenario, document, left, on):
    world = World(scenario, document, good_link())
    while not world.fleet.members["R1"].finished:
        world.step()
    push(world.robots["R1"].body, left, on)
    world.go_on(0.5)
    assert not world.fleet.members["R1"].finished
    world.run(120.0)
    world.go_on(1.0)
    assert "R1 stopped: off its path" in [one.text for one in incidents(world, "fault")]
    assert arrived(world, document, world.blackboxes()) == set(ROBOTS)
    assert touches(document, world.blackboxes()) == []


@pytest.mark.parametrize(
    ("on", "faults"),
    [(-0.1, []), (0.1, []), (1.2, ["R1 stopped: off its path", "others go around R1"])],
)
def test_a_robot_that_is_pushed_along_its_path_stops_only_beyond_its_authority(
    scenario, document, on, faults
):
    world = World(scenario, document, good_link())
    world.run(3.0)
    push(world.robots["R1"].body, 0.0, on)
    world.run(120.0)
    world.go_on(1.0)
    assert [one.text for one in incidents(world, "fault")] == faults
    assert arrived(world, document, world.blackboxes()) == set(ROBOTS)
    assert touches(document, world.blackboxes()) == []


BRIEFLY = [
    [Fault("hang", "R1", 2.0 + 0.04 * step, 0.44), Fault("kill", "R1", 2.465 + 0.04 * step)]
    for step in range(5)
]
"""R1 dies just after it woke, before it knows that it is late."""


@pytest.mark.parametrize("faults", BRIEFLY)
def test_a_lost_robot_is_nowhere_but_where_it_is_held_to_stand(scenario, document, faults):
    world = World(scenario, document, good_link(), faults=faults)
    world.run(16.0)
    body, ride = world.robots["R1"].body, world.mission.rides["R1", 1, 0]
    (span,) = world.fleet.spans("R1")
    places = stretch(ride, span.since_ms / 1000.0, span.until_ms / 1000.0)
    off = np.hypot(*(places - (body.x, body.y)).T).min()
    assert world.fleet.members["R1"].lost
    assert off < 0.5 * STRETCH_STEP + 0.002
    solid = shapely.Polygon(world.mission.dispatcher.obstructions.around["R1"])
    assert solid.covers(shapely.multipoints(places))
