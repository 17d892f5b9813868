"""Every run of two real agent cores and the fleet core with a fault; broken cores are found."""

import random

import pytest

from coordinator.schedule.authority import Authority
from tests.exploration.broken import BROKEN, a_robot_brakes_too_late_for_its_authority
from tests.exploration.explorer import LEFT_OUT, Explorer, Part, world_of
from tests.exploration.forking import Digests
from tests.exploration.world import LATER, Fault

WHOLE = 60
"""Steps in which two robots set out, drive and arrive, with what a fault costs."""


def test_no_state_of_two_robots_with_one_fault_is_unsafe():
    found = Explorer(2, 1).explore(WHOLE)
    assert (found.broken, found.is_complete, found.deepest) == ("", True, WHOLE)
    assert found.states > 10_000
    assert found.ends > 0


def test_parts_of_a_search_find_what_the_whole_finds(monkeypatch):
    a_robot_brakes_too_late_for_its_authority(monkeypatch)
    whole = Explorer(2, 1, ("die",)).explore(WHOLE)
    step, fault = whole.way[-1]
    parts = [
        Explorer(2, 1, ("die",)).explore(WHOLE, part=Part(step, piece, 2)) for piece in range(2)
    ]
    assert whole.broken
    assert [one.way for one in parts if one.broken][:1] == [((step, fault),)]


@pytest.mark.parametrize("mistake", BROKEN, ids=lambda mistake: mistake.__name__)
def test_a_broken_core_is_found(mistake, monkeypatch):
    mistake(monkeypatch)
    faults, kinds, says = BROKEN[mistake]
    found = Explorer(2, faults, kinds).explore(WHOLE)
    assert says in found.broken
    assert {fault.kind for _, fault in found.way} <= set(kinds)


def test_states_are_the_same_when_all_that_differs_is_that_a_message_came_twice():
    digests, first = Digests(LEFT_OUT), world_of(2)
    for _ in range(10):
        first.step()
    worlds = [first.copy(), first.copy()]
    assert digests.of(worlds[0]) == digests.of(worlds[1])
    kinds = [one.key.split("/")[2] for one in worlds[0].arriving()]
    worlds[0].step([Fault("double", kinds.index("command"))])
    worlds[1].step()
    assert digests.of(worlds[0]) != digests.of(worlds[1])
    for _ in range(LATER):
        worlds = [world.copy() for world in worlds]
        for world in worlds:
            world.step()
    assert digests.of(worlds[0]) == digests.of(worlds[1])


@pytest.mark.parametrize("seed", range(3))
def test_a_copy_goes_its_own_way_and_leaves_the_other_as_it_was(seed):
    dice, world, digests = random.Random(seed), world_of(2), Digests(LEFT_OUT)
    for _ in range(30):
        before, one, other = digests.of(world), world.copy(), world.copy()
        assert digests.of(one) == digests.of(other) == before
        faults = [dice.choice(world.options())] if dice.random() < 0.2 else []
        one.step(faults)
        assert digests.of(world) == digests.of(other) == before
        other.step(faults)
        assert digests.of(one) == digests.of(other)
        world = one


def test_nothing_that_authority_rests_on_is_shared_between_copies():
    world = world_of(2)
    copy = world.copy()
    one, other = world.fleet.grants._rule, copy.fleet.grants._rule
    assert isinstance(one, Authority)
    assert one is not other
    for name, value in vars(one).items():
        if hasattr(value, "shape"):
            assert getattr(other, name) is not value
