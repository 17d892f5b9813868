"""One suite for both links: what protocol/transport.py promises, and no more than that."""

import pytest

from tests.protocol.links import Inbox, MemoryLink, ZenohLink


@pytest.fixture(params=[MemoryLink, ZenohLink], ids=["memory", "zenoh"])
def link(request):
    made = request.param()
    try:
        yield made
    finally:
        made.close()


@pytest.fixture
def coordinator(link):
    return link.session("coordinator")


@pytest.fixture
def robot(link, coordinator):  # noqa: ARG001
    return link.session("R1")


@pytest.fixture
def other(link, coordinator):  # noqa: ARG001
    return link.session("R2")


@pytest.fixture(
    params=[("coordinator", "robot"), ("robot", "coordinator"), ("robot", "other")],
    ids=["down", "up", "across"],
)
def pair(request):
    return tuple(request.getfixturevalue(name) for name in request.param)


@pytest.mark.parametrize("payload", [b"", b"\x00", bytes(range(256))])
def test_bytes_arrive_whole_on_the_key_they_were_put_on(link, pair, payload):
    speaker, listener = pair
    inbox = Inbox()
    listener.subscribe("splinefleet/f/hello/R1", inbox)
    link.say_until_heard(speaker, "splinefleet/f/hello/R1", payload, inbox)
    assert {(key, heard) for key, heard, _ in inbox.heard} == {("splinefleet/f/hello/R1", payload)}
    assert all(type(heard) is bytes for heard in inbox.payloads())


def test_the_largest_message_of_4000_bytes_arrives_whole(link, pair):
    speaker, listener = pair
    payload = bytes(i * 7 % 251 for i in range(4_000))
    inbox = Inbox()
    listener.subscribe("a/b", inbox)
    link.say_until_heard(speaker, "a/b", payload, inbox)
    assert set(inbox.payloads()) == {payload}


def test_a_session_does_not_hear_its_own_puts(link, pair):
    speaker, listener = pair
    own, theirs = Inbox(), Inbox()
    speaker.subscribe("a/*", own)
    listener.subscribe("a/*", theirs)
    link.say_until_heard(speaker, "a/b", b"mine", theirs)
    link.say_until_heard(listener, "a/b", b"answer", own)
    assert set(own.payloads()) == {b"answer"}
    assert set(theirs.payloads()) == {b"mine"}


def test_a_star_stands_for_exactly_one_part_of_a_key(link, coordinator, robot):
    inbox = Inbox()
    coordinator.subscribe("f/*/R1", inbox)
    for key in ["f/R1", "f/a/b/R1", "f/a/R2", "g/a/R1", "f/a/R1/more", "f/a", "f"]:
        robot.put(key, b"wrong")
    link.say_until_heard(robot, "f/a/R1", b"one", inbox)
    for key in ["f/R1", "f/a/b/R1", "f/a/R2", "g/a/R1", "f/a/R1/more", "f/a", "f"]:
        robot.put(key, b"wrong")
    link.say_until_heard(robot, "f/b/R1", b"two", inbox)
    assert {(key, payload) for key, payload, _ in inbox.heard} == {
        ("f/a/R1", b"one"),
        ("f/b/R1", b"two"),
    }


def test_every_subscriber_of_a_key_hears_it(link, coordinator, robot, other):
    inboxes = [Inbox() for _ in range(4)]
    robot.subscribe("f/command", inboxes[0])
    robot.subscribe("f/command", inboxes[1])
    robot.subscribe("f/*", inboxes[2])
    other.subscribe("f/command", inboxes[3])
    link.say_until_heard(coordinator, "f/command", b"go", *inboxes)
    assert all(set(inbox.payloads()) == {b"go"} for inbox in inboxes)


def test_one_who_subscribes_late_hears_what_is_put_later(link, coordinator, robot, other):
    early, late = Inbox(), Inbox()
    robot.subscribe("f/command", early)
    link.say_until_heard(coordinator, "f/command", b"before", early)
    other.subscribe("f/command", late)
    link.say_until_heard(coordinator, "f/command", b"after", early, late)
    assert b"after" in late.payloads()


def test_nothing_is_heard_after_close(link, coordinator, robot, other):
    closed, fence = Inbox(), Inbox()
    robot.subscribe("f/command", closed)
    other.subscribe("f/command", fence)
    link.say_until_heard(coordinator, "f/command", b"before", closed, fence)
    robot.close()
    heard = len(closed.heard)
    link.say_until_heard(coordinator, "f/command", b"after", fence)
    assert len(closed.heard) == heard


def test_a_handler_may_close_its_own_session(link, coordinator, robot, other):
    heard, fence = [], Inbox()

    def close_at_once(key, payload, sent_ns):  # noqa: ARG001
        heard.append(payload)
        robot.close()
        fence("", b"closed", None)

    robot.subscribe("f/command", close_at_once)
    link.until(
        lambda: coordinator.put("f/command", b"x"), fence, lambda: b"closed" in fence.payloads()
    )
    other.subscribe("f/command", fence)
    link.say_until_heard(coordinator, "f/command", b"y", fence)
    assert heard == [b"x"]


def test_after_close_puts_and_subscriptions_are_ignored(link, coordinator, robot, other):
    inbox, deaf = Inbox(), Inbox()
    coordinator.subscribe("f/*", inbox)
    link.say_until_heard(robot, "f/a", b"before", inbox)
    robot.close()
    robot.put("f/a", b"after")
    robot.subscribe("f/*", deaf)
    link.say_until_heard(other, "f/a", b"fence", inbox)
    assert b"after" not in inbox.payloads()
    assert deaf.heard == []


def test_close_may_be_called_twice_and_ends_a_with_block(link, coordinator):
    with link.session("R1") as robot:
        assert robot is not None
    robot.close()
    robot.close()
    coordinator.close()
    coordinator.close()


def test_a_put_that_nobody_wants_is_no_error(coordinator, robot):
    robot.put("f/nobody", b"x")
    coordinator.put("f/nobody", b"x")


def test_many_messages_repeated_until_heard_all_arrive_whole(link, pair):
    speaker, listener = pair
    inbox = Inbox()
    listener.subscribe("f/*", inbox)
    wanted = {f"f/{i % 7}": set() for i in range(7)}
    for i in range(500):
        wanted[f"f/{i % 7}"].add(i.to_bytes(4, "little") * (1 + i % 90))

    def missing():
        heard = {(key, payload) for key, payload, _ in inbox.heard}
        return [(k, p) for k, group in wanted.items() for p in group if (k, p) not in heard]

    def put_the_missing():
        for key, payload in missing():
            speaker.put(key, payload)

    link.until(put_the_missing, inbox, lambda: len(inbox.heard) >= 500 and not missing())
    assert all(payload in wanted[key] for key, payload, _ in inbox.heard)


class Told:
    """A handler of changes; what it is told wakes an inbox that can be waited for."""

    def __init__(self):
        self.inbox = Inbox()

    def __call__(self, key, alive):
        self.inbox(key, alive, None)

    def changes(self):
        return [(key, alive) for key, alive, _ in self.inbox.heard]


def wait_until_told(link, told, *changes):
    link.until(lambda: None, told.inbox, lambda: set(changes) <= set(told.changes()))


def test_a_watcher_is_told_who_is_alive_already_and_who_comes(link, coordinator, robot, other):
    early, late = Told(), Told()
    coordinator.watch_alive("f/alive/*", early)
    robot.declare_alive("f/alive/R1")
    wait_until_told(link, early, ("f/alive/R1", True))
    coordinator.watch_alive("f/alive/*", late)
    wait_until_told(link, late, ("f/alive/R1", True))
    other.declare_alive("f/alive/R2")
    for told in (early, late):
        wait_until_told(link, told, ("f/alive/R2", True))
        assert told.changes() == [("f/alive/R1", True), ("f/alive/R2", True)]


def test_a_session_that_is_closed_is_told_as_gone_once(link, pair):
    speaker, listener = pair
    told = Told()
    listener.watch_alive("f/alive/*", told)
    speaker.declare_alive("f/alive/A")
    speaker.declare_alive("f/alive/B")
    wait_until_told(link, told, ("f/alive/A", True), ("f/alive/B", True))
    speaker.close()
    wait_until_told(link, told, ("f/alive/A", False), ("f/alive/B", False))
    assert len(told.changes()) == 4


def test_only_keys_that_fit_are_told(link, coordinator, robot):
    told = Told()
    coordinator.watch_alive("f/alive/*", told)
    for key in ["f/alive", "g/alive/R1", "f/alive/R1/more", "f/report/R1", "f/alive/R1"]:
        robot.declare_alive(key)
    wait_until_told(link, told, ("f/alive/R1", True))
    robot.close()
    wait_until_told(link, told, ("f/alive/R1", False))
    assert told.changes() == [("f/alive/R1", True), ("f/alive/R1", False)]


def test_a_key_is_alive_as_long_as_any_session_that_declared_it(link, coordinator, robot, other):
    told = Told()
    coordinator.watch_alive("f/alive/*", told)
    robot.declare_alive("f/alive/R1")
    wait_until_told(link, told, ("f/alive/R1", True))
    other.declare_alive("f/alive/R1")
    other.declare_alive("f/alive/fence")
    wait_until_told(link, told, ("f/alive/fence", True))
    robot.close()
    third = link.session("R3")
    third.declare_alive("f/alive/second")
    wait_until_told(link, told, ("f/alive/second", True))
    assert ("f/alive/R1", False) not in told.changes()
    other.close()
    wait_until_told(link, told, ("f/alive/R1", False))
    assert told.changes().count(("f/alive/R1", True)) == 1


def test_a_robot_that_comes_back_is_told_as_alive_again(link, coordinator, robot):
    told = Told()
    coordinator.watch_alive("f/alive/*", told)
    robot.declare_alive("f/alive/R1")
    wait_until_told(link, told, ("f/alive/R1", True))
    robot.close()
    wait_until_told(link, told, ("f/alive/R1", False))
    link.session("R1").declare_alive("f/alive/R1")
    link.until(lambda: None, told.inbox, lambda: len(told.changes()) == 3)
    assert told.changes()[-1] == ("f/alive/R1", True)


def test_after_close_nobody_is_declared_and_nobody_is_told(link, coordinator, robot, other):
    closed, deaf, fence = Told(), Told(), Told()
    robot.watch_alive("f/alive/*", closed)
    coordinator.watch_alive("f/alive/*", fence)
    robot.close()
    robot.declare_alive("f/alive/R1")
    robot.watch_alive("f/alive/*", deaf)
    other.declare_alive("f/alive/R2")
    wait_until_told(link, fence, ("f/alive/R2", True))
    assert fence.changes() == [("f/alive/R2", True)]
    assert closed.changes() == deaf.changes() == []


def test_a_handler_of_changes_may_close_its_own_session(link, coordinator, robot, other):
    heard, fence = [], Told()

    def close_at_once(key, alive):
        heard.append((key, alive))
        robot.close()
        fence("closed", True)

    robot.watch_alive("f/alive/*", close_at_once)
    other.declare_alive("f/alive/R2")
    wait_until_told(link, fence, ("closed", True))
    other.declare_alive("f/alive/R3")
    coordinator.watch_alive("f/alive/*", fence)
    wait_until_told(link, fence, ("f/alive/R3", True))
    assert heard == [("f/alive/R2", True)]
