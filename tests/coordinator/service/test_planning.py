"""Planning on this machine: what is told when there is no plan."""

import pytest

from coordinator.base.errors import PlanError, SeveralRobotsError
from coordinator.service.planning import plan_here
from tests.scenarios import a_robot, a_scenario, box

DOOR = [box(4.8, 0.0, 5.2, 2.6), box(4.8, 3.1, 5.2, 8.0)]
LEFT = a_robot("L", (1, 3), (9, 3), radius=0.3)
RIGHT = a_robot("R", (9, 1), (1, 1), radius=0.3)
SMALL = a_robot("S", (1, 5), (9, 5), radius=0.1)


def test_all_robots_that_no_door_is_wide_enough_for_are_told():
    with pytest.raises(SeveralRobotsError) as caught:
        plan_here(a_scenario([LEFT, SMALL, RIGHT], obstacles=DOOR), effort=0)
    assert [error.robot for error in caught.value.errors] == ["L", "R"]
    lines = str(caught.value).splitlines()
    assert [line.partition(":")[0] for line in lines] == ["L", "R"]
    assert all("workspace.obstacles[0] and workspace.obstacles[1]" in line for line in lines)
    assert caught.value.blames == "L"


def test_a_single_robot_and_a_later_epoch_have_the_error_of_the_planner():
    with pytest.raises(PlanError, match=r"^R: has no way") as caught:
        plan_here(a_scenario([RIGHT, SMALL], obstacles=DOOR), effort=0)
    assert not isinstance(caught.value, SeveralRobotsError)
    with pytest.raises(PlanError, match=r"^L: has no way") as caught:
        plan_here(a_scenario([LEFT, RIGHT], obstacles=DOOR), effort=0, epoch=2)
    assert not isinstance(caught.value, SeveralRobotsError)
