"""Operators who say what makes no sense: nothing they say brings a fleet down or together."""

from random import Random

import pytest
from msgspec.structs import replace

from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.plan.plan_file import to_json
from coordinator.scenario.model import Demand
from coordinator.service.replay import check_log
from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    CANCELLED,
    END,
    FARTHEST,
    GO_ON,
    HALT,
    ORDER_DONE,
    REFUSED,
    UNDER_WAY,
    WAITING,
    Admit,
    Block,
    Cancel,
    Join,
    Leave,
    Tell,
    Unblock,
)
from protocol.messages import Order as Said
from protocol.phases import GO, OVER
from sim.judging.blackbox import blackbox_text
from sim.judging.judge import judge
from sim.world.run_logs import RunLogs
from sim.world.virtual_service import VirtualService
from tests.sim.world.test_orders_in_time import (
    a_world,
    admit,
    assert_sound,
    idle,
    long_hall,
    operator,
    states,
)

R9 = Join(9, "R9", (10.0, 3.0, 1.0), 0.25, 0.8)


def a_hall(**fields):
    return a_world(long_hall(idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))), stays=True, **fields)


def reasons(world):
    return {name: task.reason for name, task in world.fleet.orders.tasks.items()}


def test_an_order_with_the_id_of_another_one_changes_nothing_and_is_told_of_that_one(
    tmp_path,
):
    logs = RunLogs(tmp_path)
    world = a_hall(logs=logs)
    say, told = operator(world), []
    session = world._network.session("beside")

    def hear(_key, payload, _sent_ns):
        told.append(decode("orders", payload))

    session.subscribe(keys.orders(world.fleet.name, "o"), hear)
    world.run(3.0)
    say(Said(9, "o", (6.0, 3.0), "R1"))
    world.run(1.0)
    said_before = len(told)
    say(Said(5, "o", (2.0, 5.0), "R1"))
    world.run(1.0)
    assert Said(5, "o", (6.0, 3.0), "R1") in told[said_before:]
    assert world.fleet.orders.tasks["o"].order.goal == (6.0, 3.0)
    say(Tell(9, END))
    world.run(60.0)
    logs.close()
    assert states(world) == {"o": ORDER_DONE}
    assert_sound(world, logs)


def test_a_robot_that_may_not_join_yet_is_unknown_and_cannot_leave():
    world = a_hall()
    say = operator(world)
    say(R9)
    say(Leave(9, "R9"))
    world.run(2.0)
    assert states(world) == {"join-R9": REFUSED, "leave-R9": REFUSED}
    assert reasons(world)["leave-R9"] == "there is no robot R9 in this fleet"
    say(R9)
    world.run(2.0)
    assert (states(world)["join-R9"], "R9" in world.fleet.members) == (UNDER_WAY, True)


@pytest.mark.parametrize("place", [(50.0, 3.0), (FARTHEST, -FARTHEST), (14.0, 3.0)])
def test_a_robot_off_the_floor_cannot_join_and_orders_to_there_are_refused_at_once(place):
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Join(9, "R9", (*place, 0.0), 0.25, 0.8))
    say(Said(9, "there", place))
    world.run(1.0)
    assert (states(world)["join-R9"], states(world)["there"]) == (REFUSED, REFUSED)
    assert reasons(world)["join-R9"].endswith("is off the floor")
    assert reasons(world)["there"].endswith("which is off the floor")
    assert set(world.fleet.members) == {"R1", "R2"}


def test_no_message_states_a_place_beyond_what_the_wire_can_tell_apart():
    far = 1.01 * FARTHEST
    said = (
        ("order", Said(9, "a", (far, 1.0))),
        ("order", Said(9, "a", (1.0, 1.0), via=((1.0, -far),))),
        ("roster", Join(9, "R9", (far, 1.0, 0.0), 0.25, 0.8)),
        ("block", Block(9, "a", ((0.0, 0.0), (1e300, 0.0), (0.0, 1.0)))),
    )
    assert [decode(kind, encode(message)) for kind, message in said] == [None] * len(said)


def test_no_order_is_named_like_one_of_the_coordinators_own():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    for name in ("join-R1", "leave-R1", "room-1", "way-1"):
        say(Said(9, name, (3.0, 3.0), robot="R1"))
    say(Said(9, "leaves-R1", (3.0, 3.0), robot="R1"))
    world.run(20.0)
    assert states(world) == {"leaves-R1": ORDER_DONE}


def test_a_join_can_be_cancelled_and_asked_for_again():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(R9)
    world.run(2.0)
    assert states(world)["join-R9"] == UNDER_WAY
    say(Cancel(9, "join-R9"))
    world.run(1.0)
    assert (states(world)["join-R9"], set(world.fleet.members)) == (CANCELLED, {"R1", "R2"})
    say(R9)
    world.add("R9", 0.25, 0.8, 77)
    world.run(4.0)
    assert states(world)["join-R9"] == ORDER_DONE


def test_a_robot_that_joins_and_is_never_heard_is_lost_and_holds_up_no_end():
    world = a_hall()
    say = operator(world)
    say(R9)
    world.run(0.5)
    say(R9)
    world.run(80.0)
    assert states(world) == {"join-R9": REFUSED}
    assert "was not heard" in reasons(world)["join-R9"]
    assert world.fleet.members["R9"].lost
    say(Said(9, "there", (10.0, 3.0)))
    world.run(10.0)
    assert reasons(world)["there"] == "waits for R9"
    say(Leave(9, "R9"))
    world.run(30.0)
    assert states(world)["there"] == ORDER_DONE
    say(replace(R9, place=(3.0, 3.0, 0.0)))
    world.run(2.0)
    say(Tell(9, END))
    world.run(100.0)
    assert world.fleet.phase == OVER


def test_a_dead_robot_at_rest_is_not_taken_for_heard_when_the_next_coordinator_hangs(tmp_path):
    hangs = ["coordinator-hang@16:0.7", "coordinator-hang@22:4"]
    logs = RunLogs(tmp_path)
    world = a_hall(faults=["kill:R2@1", "coordinator-restart@4:2", *hangs], logs=logs)
    world.run(14.0)
    say = operator(world)
    say(Said(9, "there", (10.0, 5.0), robot="R2"))
    for k in range(200):
        world.run(0.1)
        assert world.fleet.members["R2"].is_silent(world.now_ns)
        if k == 30:
            say(Tell(9, HALT))
        if k == 35:
            say(Tell(9, GO_ON))
    assert states(world) == {"there": WAITING}
    logs.close()


def test_a_robot_that_is_heard_only_after_its_join_was_given_up_gets_its_course_proven(tmp_path):
    logs = RunLogs(tmp_path)
    world = a_hall(logs=logs)
    say = operator(world)
    world.run(1.0)
    say(R9)
    world.run(80.0)
    assert states(world) == {"join-R9": REFUSED}
    world.add("R9", 0.25, 0.8, 77)
    world.run(10.0)
    assert not world.fleet.members["R9"].lost
    say(R9)
    world.run(0.5)
    assert states(world) == {"join-R9": ORDER_DONE}
    say(Leave(9, "R9"))
    world.run(5.0)
    say(Tell(9, END))
    world.run(100.0)
    logs.close()
    log = read_log(logs.paths[-1])
    assert prove_log(log, before=logs_before(log)).holds


def test_a_robot_upon_which_a_place_is_closed_while_it_joins_has_joined():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    world.add("R9", 0.25, 0.8, 77)
    say(R9)
    while "join-R9" not in states(world) or states(world)["join-R9"] == WAITING:
        world.run(0.1)
    say(Block(9, "here", ((9.5, 2.5), (10.5, 2.5), (10.5, 3.5), (9.5, 3.5))))
    world.run(30.0)
    assert states(world)["join-R9"] == ORDER_DONE
    say(Said(9, "out", (3.0, 5.0), robot="R9"))
    world.run(40.0)
    assert states(world)["out"] == ORDER_DONE


def test_a_robot_that_is_started_again_while_it_is_to_join_joins_and_need_not_be_admitted():
    """Its course is looked for for 2 s meanwhile."""
    world = a_hall(planning_ns=12_000_000_000)
    say = operator(world)
    world.run(3.0)
    say(R9)
    world.add("R9", 0.25, 0.8, 77)
    world.run(0.3)
    world.renew("R9", 78, (10.0, 3.0, 1.0))
    world.run(1.2)
    assert (states(world)["join-R9"], world.fleet.members["R9"].boot) == (WAITING, 78)
    admit(world, "R9")
    world.run(5.0)
    assert states(world)["join-R9"] == ORDER_DONE
    assert "R9 joins, and need not be admitted" in [one.text for one in world.fleet.incidents]
    assert world.fleet.phase == GO


def test_a_robot_that_does_not_stand_where_it_joins_is_told_so_and_may_leave():
    world = a_hall()
    say = operator(world)
    world.run(3.0)
    say(R9)
    world.add("R9", 0.25, 0.8, 77)
    world.robots["R9"].body.place(10.0, 3.4, 1.0)
    world.run(30.0)
    told = [one.text for one in world.fleet.incidents]
    words = "put it there, or start its program again and admit it"
    assert f"R9 does not stand at (10.0, 3.0), where its course begins: {words}" in told
    assert not any("wheels" in text for text in told)
    say(Leave(9, "R9"))
    world.run(1.0)
    assert (states(world)["leave-R9"], "R9" in world.fleet.members) == (ORDER_DONE, False)
    assert reasons(world)["join-R9"] == "R9 has left the fleet"


def test_a_robot_that_leaves_and_joins_again_within_a_search_is_not_sent_what_that_found(
    monkeypatch,
):
    """The search for the order takes 3 s, those for others 50 ms."""
    times = {"any": 3_000_000_000}
    monkeypatch.setattr(
        VirtualService, "_time_of", lambda _, job: times.get(job.wanted.order, 50_000_000)
    )
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Said(9, "any", (3.0, 1.0)))
    world.run(0.3)
    assert world.mission.dispatcher.searches.has("R1")
    say(Leave(9, "R1"))
    world.run(0.2)
    say(Join(9, "R1", (10.0, 5.0, 0.0), 0.2, 0.8))
    world.run(0.1)
    world.renew("R1", 500, (10.0, 5.0, 0.0))
    world.run(30.0)
    assert states(world)["any"] == ORDER_DONE
    assert not world.fleet.grants.given_up
    assert not any("does not take" in one.text for one in world.fleet.incidents)


def test_a_join_that_is_cancelled_and_asked_for_elsewhere_within_a_search_is_to_there():
    world = a_hall(planning_ns=12_000_000_000)
    say = operator(world)
    world.run(3.0)
    say(R9)
    world.run(0.3)
    say(Cancel(9, "join-R9"))
    say(replace(R9, place=(3.0, 5.0, 0.0), radius_m=0.3))
    world.add("R9", 0.3, 0.8, 77)
    world.run(8.0)
    assert states(world)["join-R9"] == ORDER_DONE
    assert world.mission.dispatcher.searches.place("R9")[0] == pytest.approx((3.0, 5.0), abs=0.01)
    assert world.fleet.grants.of("R9").now.course.driven.radius == 0.3


def test_who_cannot_leave_is_told_what_to_do():
    world = a_hall()
    say = operator(world)
    say(Leave(9, "R1"))
    world.run(3.0)
    assert reasons(world)["leave-R1"] == "R1 can leave once the fleet has set out"
    say(Said(9, "there", (10.0, 3.0), robot="R1"))
    world.run(2.0)
    say(Leave(9, "R1"))
    world.run(0.5)
    why = "R1 does not rest; if it cannot get on, end its program first"
    assert reasons(world)["leave-R1"] == why


def test_a_name_of_32_characters_joins_and_leaves():
    name, world = 32 * "x", a_hall()
    say = operator(world)
    world.run(2.0)
    say(replace(R9, robot=name))
    world.add(name, 0.25, 0.8, 77)
    world.run(4.0)
    say(Leave(9, name))
    world.run(1.0)
    assert states(world) == {f"join-{name}": ORDER_DONE, f"leave-{name}": ORDER_DONE}
    for state in world.coordinator.driver.orders_again():
        key, payload = state
        assert decode(keys.split(key)[1], payload) is not None


def test_an_order_for_later_is_told_to_whoever_asks():
    world = a_hall()
    say = operator(world)
    world.run(2.0)
    say(Said(9, "later", (3.0, 5.0), robot="R1", release_ms=3_600_000))
    world.run(1.0)
    told = [key.rpartition("/")[2] for key, _ in world.coordinator.driver.orders_again()]
    assert told == ["later"]
    say(Cancel(9, "later"))
    world.run(1.0)
    assert states(world) == {"later": CANCELLED}


def test_robots_join_and_leave_a_fleet_with_a_demand_which_is_for_its_own_robots():
    places = ((1.0, 1.0), (11.0, 1.0), (11.0, 5.0), (3.0, 5.0))
    robots = idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0))
    demand = Demand(places=places, per_robot=2, first_within=1.0, seed=1)
    world = a_world(replace(long_hall(*robots), demand=demand), faults=["kill:R2@4"])
    say = operator(world)
    world.run(2.0)
    say(R9)
    world.add("R9", 0.25, 0.8, 77)
    world.run(10.0)
    say(Leave(9, "R2"))
    world.run(120.0)
    assert world.fleet.phase == OVER
    done = {name for name, state in states(world).items() if state == ORDER_DONE}
    assert {"join-R9", "leave-R2", "R1-1", "R1-2"} <= done
    assert not any(name.startswith("R9-") for name in states(world))


def test_the_order_without_a_name_of_a_lost_robot_that_leaves_is_done_by_another_one():
    world = a_hall(faults=["kill:R2@6"])
    say = operator(world)
    world.run(3.0)
    say(Said(9, "any", (11.0, 1.0)))
    world.run(1.0)
    say(Said(9, "named", (9.0, 1.0), robot="R2"))
    world.run(6.0)
    assert world.fleet.orders.of_robot("R2").order.id == "any"
    say(Leave(9, "R2"))
    world.run(60.0)
    assert (states(world)["any"], states(world)["named"]) == (ORDER_DONE, REFUSED)
    assert world.fleet.orders.tasks["any"].robot == "R1"


def test_an_order_for_a_robot_at_rest_says_that_it_is_not_heard_or_not_admitted_yet():
    world = a_hall(faults=["restart:R2@2:5"])
    say = operator(world)
    world.run(4.0)
    say(Said(9, "there", (9.0, 1.0), robot="R2"))
    world.run(1.0)
    assert reasons(world)["there"] == "R2 is not heard"
    world.run(5.0)
    assert reasons(world)["there"] == "R2 is back and waits to be admitted"
    admit(world, "R2")
    world.run(30.0)
    assert states(world)["there"] == ORDER_DONE


def odd_word(dice, step):
    """Return what an operator says, sense or not."""

    def number():
        return dice.choice([*[dice.uniform(0.5, 11.5)] * 20, -1.0, 50.0, FARTHEST, -FARTHEST])

    def place():
        return number(), dice.choice([*[dice.uniform(0.5, 5.5)] * 20, number()])

    names, ids = ("R1", "R2", "R3", "R8", "R9", "R77"), ("a", "b", "room-1", "join-R9", "leave-R1")
    (x, y), size = place(), dice.choice([0.5, 1.5, 30.0])
    corners = ((x, y), (x + size, y), (x + size, y + size), (x, y + size))
    return dice.choice(
        [
            *5
            * [
                Said(
                    9,
                    dice.choice([*ids, f"o{step}"]),
                    place(),
                    robot=dice.choice([*names, "", "", ""]),
                    via=dice.choice([(), (), (place(),)]),
                    dwell_ms=dice.choice([0, 0, 3_000, 2**40]),
                    priority=dice.randint(-3, 3),
                    now=dice.random() < 0.4,
                )
            ],
            Cancel(9, dice.choice([*ids, f"o{dice.randrange(step + 1)}"])),
            Block(9, dice.choice("xyz"), corners),
            Unblock(9, dice.choice("xyz")),
            *2 * [Join(9, dice.choice(names), (x, y, number()), dice.choice([0.2, 5.0]), 0.8)],
            Leave(9, dice.choice(names)),
            Admit(step + 1),
            Tell(9, dice.choice([HALT, GO_ON, GO_ON])),
        ]
    )


@pytest.mark.parametrize("seed", range(3))
def test_whatever_operators_say_robots_keep_clear_and_the_log_is_proven(tmp_path, seed):
    dice, logs = Random(seed), RunLogs(tmp_path)
    robots = idle("R1", (1.0, 3.0)), idle("R2", (6.0, 1.0)), idle("R3", (9.0, 5.0))
    faults = ["kill:R3@20"] if seed else ["coordinator-restart@20:2"]
    world = a_world(long_hall(*robots), stays=True, logs=logs, faults=faults)
    say, session, name = operator(world), world._network.session("beside"), world.fleet.name
    for step in range(60):
        word = odd_word(dice, step)
        if isinstance(word, Admit):
            session.put(keys.admit(name, dice.choice(["R1", "R9", "R77"])), encode(word))
        else:
            say(word)
        if isinstance(word, Join) and word.robot not in world.robots:
            world.add(word.robot, word.radius_m, 0.8, 100 + step)
        world.run(dice.choice([0.05, 0.3, 1.0, 3.0]))
    for place in "xyz":
        say(Unblock(9, place))
    say(Tell(9, GO_ON))
    world.run(30.0)
    say(Tell(9, END))
    world.run(200.0)
    logs.close()
    assert world.fleet.phase == OVER
    assert not {UNDER_WAY, WAITING} & set(states(world).values())
    (tmp_path / "plan.json").write_bytes(to_json(world.mission.documents[1]))
    for one, robot in world.robots.items():
        (tmp_path / f"{one}.csv").write_bytes(blackbox_text(robot.written_rows()))
    verdict = judge(tmp_path)
    assert (verdict.collisions, verdict.collisions_with_obstacles) == (0, 0)
    log = read_log(logs.paths[-1])
    assert check_log(log).difference == ""
    proof = prove_log(log, before=logs_before(log))
    assert proof.holds, [failure for epoch in proof.epochs for failure in epoch.failures]
