"""What a robot tells the person who started it until it is armed."""

import pytest

from protocol import keys
from protocol.codec import encode
from protocol.messages import Command
from protocol.phases import (
    ARMED,
    BAD_PLAN,
    CLOCK_UNSURE,
    DONE,
    DRIVER_ERROR,
    FROZEN,
    GO,
    HOLD,
    MOVING,
    STOP,
)
from protocol.timing import SECOND
from robot_agent.core.agent import Agent
from robot_agent.words import (
    DEAF,
    GOES_ON,
    HEARS_AGAIN,
    HELD,
    PATIENCE_NS,
    STOPPED,
    Lasting,
    phase_in_words,
    waits_for,
)
from tests.robot_agent.core.rides import COORDINATOR, ME, MS, NUMBER, TERM
from tests.robot_agent.test_service import FLEET, Hall, raise_interrupt

HERE = (1.0, 2.0, 0.0)


def idle(fault=0):
    agent = Agent()
    agent.fault = fault
    return agent


@pytest.mark.parametrize(
    ("fleet", "phase", "heard", "pose", "fault", "said"),
    [
        (None, HOLD, False, None, 0, "hears no coordinator"),
        ("hall", HOLD, False, None, 0, "hears no coordinator of fleet hall"),
        ("hall", HOLD, True, None, 0, "has said hello to fleet hall, which has sent no plan yet"),
        ("hall", HOLD, True, None, BAD_PLAN, "does not arm, plan not acceptable"),
        ("hall", HOLD, True, None, CLOCK_UNSURE, "does not arm, clock not certain"),
        (
            "hall", GO, True, HERE, 0,
            "fleet hall is under way without it; "
            "`splinefleet join R3 --at 1.000,2.000,0.000 --connect ...` takes in a new robot, "
            "`splinefleet admit R3 --connect ...` lets in one that was there before",
        ),
        (
            "hall", GO, True, None, 0,
            "fleet hall is under way without it; "
            "`splinefleet join R3 --at X,Y,HEADING --connect ...` takes in a new robot, "
            "`splinefleet admit R3 --connect ...` lets in one that was there before, "
            "after a start with --at X Y HEADING",
        ),
    ],
)  # fmt: skip
def test_what_keeps_a_robot_from_being_armed_is_said_in_words(
    fleet, phase, heard, pose, fault, said
):
    assert waits_for(idle(fault), "R3", fleet, phase, heard, pose) == said


@pytest.mark.parametrize("phase", [HOLD, GO])
def test_a_robot_that_has_arrived_does_not_ask_to_be_let_in(phase):
    said = waits_for(idle(), "R3", "hall", phase, True, HERE, arrived=True)
    assert said == "has arrived, fleet hall goes on without it"


def test_a_robot_that_drove_before_is_left_where_it_stands():
    agent = idle()
    agent._spent_epoch = 2
    said = waits_for(agent, "R3", "hall", GO, True, HERE)
    assert said == "has no part in this epoch of fleet hall, stays where it stands"


def test_a_robot_at_its_goal_when_a_new_epoch_begins_says_that_it_has_arrived():
    hall = Hall()

    def go_on():
        hall.phase, hall.plans = HOLD, []
        hall.command = hold

    def hold():
        hall.sequence += 10
        command = Command(COORDINATOR, TERM, hall.sequence, 2, HOLD, 0, 0, run=hall.run_id)
        hall.link.put(keys.command(FLEET), encode(command))

    hall.reactions[DONE] = go_on
    told = told_until(hall, 60.0)
    assert told[-1] == f"{ME}: has arrived, fleet {FLEET} goes on without it"


def test_a_reason_is_told_once_it_has_lasted_and_once():
    lasting, told = Lasting(), []
    texts = ["a"] * 5 + ["b: 1", "b: 2"] * 10 + [""] * 20 + ["b: 3"] * 20
    for tick, text in enumerate(texts):
        told.append(lasting.hear(text, tick * PATIENCE_NS // 10))
    assert [text for text in told if text] == ["b: 1", "b: 3"]


def told_until(hall, seconds=3.0, **options):
    """What a robot tells in this time; it is interrupted then."""
    told = []
    react, end = hall.react, hall.clock() + round(seconds * 1000) * MS

    def react_or_end():
        react()
        if hall.clock() >= end:
            raise_interrupt()

    hall.react = react_or_end
    assert hall.run(tell=told.append, **options) in (0, 130)
    return told


def test_a_robot_that_stands_elsewhere_tells_where_and_where_its_plan_begins():
    hall = Hall()
    hall.body.place(9.0, 9.0, 0.0)
    (line,) = told_until(hall)
    assert "does not arm, off its path: stands at (9.000, 9.000), not at (" in line


def test_a_robot_whose_coordinator_is_silent_tells_so():
    hall = Hall()
    hall.silent, hall.plans = True, []
    (line,) = told_until(hall)
    assert line.endswith(": hears no coordinator of fleet hall")


def test_a_robot_under_way_tells_once_that_it_hears_nobody_and_once_that_it_hears_somebody_again():
    hall = Hall()

    def fall_silent():
        said, until = hall.command, hall.clock() + 5 * SECOND // 2
        hall.command = lambda: said() if hall.clock() >= until else None

    hall.headroom_ms = 300
    hall.reactions[MOVING] = fall_silent
    told = told_until(hall, 10.0)
    told = [line.removeprefix(f"{ME}: ") for line in told]
    assert told.count(DEAF) == told.count(HEARS_AGAIN) == 1
    assert told.index("moving") < told.index(DEAF) < told.index(HEARS_AGAIN)


def test_a_robot_that_may_drive_no_farther_tells_so_and_that_it_drives_on():
    hall = Hall()
    hall.held = ((NUMBER, 100),)
    react = hall.react

    def let_go():
        react()
        if hall.phase == GO and (hall.clock() + 10**12 - hall.start_ns) > 4 * SECOND:
            hall.held = ()

    hall.react = let_go
    told = [line.removeprefix(f"{ME}: ") for line in told_until(hall, 10.0)]
    assert told.count(HELD) == told.count(GOES_ON) == 1
    assert told.index("moving") < told.index(HELD) < told.index(GOES_ON)
    assert DEAF not in told


def test_a_robot_of_a_fleet_that_is_stopped_tells_that_and_that_it_drives_on():
    hall = Hall()
    react = hall.react

    def stop_for_a_while():
        react()
        if hall.phase in (GO, STOP):
            passed = hall.clock() + 10**12 - hall.start_ns
            hall.phase = STOP if SECOND // 4 < passed < 3 * SECOND else GO

    hall.react = stop_for_a_while
    told = [line.removeprefix(f"{ME}: ") for line in told_until(hall, 10.0)]
    assert [line for line in told if line in (HELD, STOPPED, GOES_ON)] == [STOPPED, GOES_ON]


def test_a_robot_that_arms_at_once_tells_its_phases_alone():
    hall = Hall()
    hall.reactions[ARMED] = raise_interrupt
    (line,) = told_until(hall)
    assert line.endswith(": armed")


def test_a_driver_that_fails_is_told_with_what_it_said():
    agent = Agent()
    agent.phase, agent.fault = FROZEN, DRIVER_ERROR
    said = phase_in_words(agent, "DriverError: wheel 2")
    assert said == "frozen, driver error (DriverError: wheel 2), waiting for a new plan"
