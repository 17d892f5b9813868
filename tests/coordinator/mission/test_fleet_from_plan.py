"""What is proven is what is sent: the bytes of a Plan but for who sends it and the checksum."""

from dataclasses import replace

import msgspec
import pytest

from coordinator.base.errors import PlanError
from coordinator.mission.fleet_from_plan import muster, parts_of
from coordinator.plan.wire import PackedPlan, packed
from coordinator.planning.planner import plan_fleet
from protocol.codec import decode
from tests.scenarios import a_robot, a_scenario

BOOT = 0xDEADBEEF


@pytest.fixture(scope="module")
def plan():
    robots = [a_robot("R1", (1, 4), (9, 4)), a_robot("R2", (5, 1), (5, 7), max_speed=0.6)]
    return plan_fleet(a_scenario(robots), effort=1)


def test_what_robots_get_is_what_was_proven_but_for_the_sender_and_the_checksum(plan):
    assert plan.document.proof.holds
    for name, part in parts_of(plan, BOOT).items():
        proven, sent = decode("plan", plan.messages[name]), decode("plan", part.plan)
        assert (proven.boot, sent.boot) == (0, BOOT)
        assert msgspec.structs.replace(sent, boot=0) == proven


def test_the_messages_of_a_plan_are_those_of_its_file(plan):
    assert packed(plan.document).messages == plan.messages


def test_a_fleet_is_made_of_the_messages_and_not_of_the_document_again(plan):
    other = plan_fleet(a_scenario([a_robot("R1", (1, 4), (8, 4)), a_robot("R2", (5, 1), (5, 7))]))
    mixed = PackedPlan(plan.document, other.messages)
    assert parts_of(mixed, 0)["R1"].plan == other.messages["R1"]


def test_a_plan_without_a_proof_becomes_no_fleet(plan):
    bare = msgspec.structs.replace(plan.document, proof=None)
    with pytest.raises(PlanError, match="proof does not hold"):
        muster(replace(plan, document=bare), BOOT)
