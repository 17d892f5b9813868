"""A fleet with keys that a robot joins; what operators may say, and nobody else."""

import contextlib
import signal

from protocol import keys
from protocol.codec import decode, encode
from protocol.messages import (
    HALT,
    Admit,
    Block,
    Cancel,
    Join,
    Leave,
    Order,
    OrderState,
    Tell,
    Unblock,
)
from tests.protocol.links import Inbox
from tests.system.fleet_tools import splinefleet, started, wait_for
from tests.system.locked_fleet import FLEET, Events, Keys, coordinator, locked_endpoint, scenario_in

SAID = (
    (keys.order(FLEET), Order(9, "theirs", (2.0, 2.0))),
    (keys.order(FLEET), Cancel(9, "theirs")),
    (keys.tell(FLEET), Tell(9, HALT)),
    (keys.block(FLEET), Block(9, "theirs", ((1.0, 1.0), (2.0, 1.0), (1.0, 2.0)))),
    (keys.block(FLEET), Unblock(9, "theirs")),
    (keys.roster(FLEET), Join(9, "R8", (2.0, 2.0, 0.0), 0.2, 0.5)),
    (keys.roster(FLEET), Leave(9, "R2")),
)


def test_what_operators_say_is_heard_from_operators_alone(tmp_path):
    with (
        coordinator(tmp_path) as gate,
        gate.connect("observer") as observer,
        gate.connect("operator") as operator,
    ):
        heard, answers = Inbox(), Inbox()
        observer.subscribe(f"{keys.ROOT}/**", heard)
        operator.subscribe(keys.orders(FLEET, "*"), answers)
        for role, name, who in (
            ("robot", "R1", "robot R1, key 3"),
            ("observer", "other", "observer other, key 1"),
        ):
            with gate.connect(role, name) as stranger:
                for key in dict.fromkeys(key for key, _ in SAID):
                    for message in (one for other, one in SAID if other == key):
                        stranger.put(key, encode(message))
                    gate.events.denial(who, f"publish on {key}")
                stranger.put(keys.admit(FLEET, "R2"), encode(Admit(9)))
                gate.events.denial(who, f"publish on {keys.admit(FLEET, 'R2')}")

        def is_answered():
            for key, message in SAID:
                operator.put(key, encode(message))
            said = [decode("orders", payload) for payload in answers.payloads()]
            found = {one.id for one in said if isinstance(one, OrderState)}
            return {"theirs", "join-R8", "leave-R2"} <= found

        assert not answers.heard
        assert not {encode(message) for _, message in SAID} & set(heard.payloads())
        wait_for(is_answered)
        wait_for(lambda: {encode(one) for _, one in SAID} <= set(heard.payloads()))


def test_a_robot_with_a_key_of_its_own_joins_a_fleet_with_keys_and_may_join_after_a_restart(
    tmp_path,
):
    made, endpoint, log = Keys(tmp_path), locked_endpoint(), tmp_path / "run.mcap"
    done = splinefleet("keys", "robot", "R7", "--may-join", "--keys", made.folder)
    assert done.returncode == 0, done.stderr
    scenario = scenario_in(tmp_path)
    options = [scenario, "--keys", made.folder, "--listen", endpoint, "--stay", "--json"]

    def agent(robot, *more):
        folder = made.folder / "robot" / robot
        return started("agent", robot, "--keys", folder, "--connect", endpoint, *more)

    def operate(*words):
        folder = made.folder / "operator/operator"
        return splinefleet(*words, "--keys", folder, "--connect", endpoint, timeout=90.0)

    def joined():
        folder = made.folder / "operator/operator"
        words = ("join", "R7", "--at", "3.2,3.2,0", "--radius", 0.15)
        return started(*words, "--keys", folder, "--connect", endpoint)

    with contextlib.ExitStack() as stack:
        for robot in ("R1", "R2", "R9"):
            stack.enter_context(agent(robot))
        with started("coordinator", *options, "--log", log) as process:
            events = Events(process)
            events.wait(lambda event: event.get("phase") == "GO", 40.0)
            events.denial("robot R9, key 1", "no part in this fleet and may not join it")
            with joined() as join:
                events.wait(lambda event: "R7" in event.get("text", ""), 20.0)
                stack.enter_context(agent("R7", "--at", 3.2, 3.2, 0))
                assert join.wait(60.0) == 0
                assert "R7 has joined two" in join.stderr.read()
            ordered = operate(
                "order", "--to", "0.8,3.2", "--robot", "R7", "--id", "first", "--wait"
            )
            assert ordered.returncode == 0, ordered.stderr
            process.send_signal(signal.SIGKILL)
            process.wait()
        again = tmp_path / "run-2.mcap"
        with started("coordinator", *options, "--resume", log, "--log", again) as process:
            Events(process).wait(lambda event: event.get("phase") == "GO", 40.0)
            ordered = operate("order", "--to", "3.2,3.2", "--robot", "R7", "--wait")
            assert ordered.returncode == 0, ordered.stderr
            left = operate("leave", "R7")
            assert left.returncode == 0, left.stderr
            assert operate("end").returncode == 0
            assert process.wait(20.0) == 0
