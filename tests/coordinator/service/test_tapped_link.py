"""The pipe between a coordinator and its desk: what passes, and what may not."""

import threading
from multiprocessing import Pipe

import pytest

from coordinator.service.tapped_link import PipeLink, TappedLink
from protocol import keys
from protocol.codec import encode
from protocol.messages import END, Admit, Cancel, Tell
from sim.world.memory_transport import MemoryNetwork

FLEET = "hall"
CANCEL = encode(Cancel(1, "a"))


class Heard:
    """What a handler was called with, and a wait for it."""

    def __init__(self):
        self.all = []
        self._news = threading.Condition()

    def __call__(self, key, payload, sent_ns):
        with self._news:
            self.all.append((key, payload, sent_ns))
            self._news.notify_all()

    def wait(self, count):
        with self._news:
            assert self._news.wait_for(lambda: len(self.all) >= count, 5.0)
        return self.all


@pytest.fixture
def ends():
    network, (ours, theirs) = MemoryNetwork(), Pipe()
    ended = threading.Event()
    tapped = TappedLink(network.session("coordinator"), ours, FLEET)
    desk = PipeLink(theirs, ended.set)
    yield network, tapped, desk, ended
    tapped.close()
    assert ended.wait(5.0)


def test_the_desk_hears_what_the_coordinator_says_and_hears(ends):
    network, tapped, desk, _ = ends
    robot, heard, own = network.session("R1"), Heard(), Heard()
    desk.subscribe(keys.command(FLEET), heard)
    desk.subscribe(keys.report(FLEET, "*"), heard)
    tapped.subscribe(keys.report(FLEET, "*"), own)
    robot.subscribe(keys.command(FLEET), own)
    tapped.put(keys.command(FLEET), b"go")
    robot.put(keys.report(FLEET, "R1"), b"here")
    network.advance(10**9)
    assert {(key, data) for key, data, _ in heard.wait(2)} == {
        (keys.command(FLEET), b"go"),
        (keys.report(FLEET, "R1"), b"here"),
    }
    assert {data for _, data, _ in own.all} == {b"go", b"here"}


def test_the_desk_hears_of_links_that_come_and_go(ends):
    network, tapped, desk, _ = ends
    robot, heard, own = network.session("R1"), Heard(), []
    desk.watch_alive(keys.alive(FLEET, "*"), lambda key, alive: heard(key, alive, None))
    tapped.watch_alive(keys.alive(FLEET, "*"), lambda key, alive: own.append((key, alive)))
    robot.declare_alive(keys.alive(FLEET, "R1"))
    network.advance(10**9)
    robot.close()
    network.advance(2 * 10**9)
    assert own == [(keys.alive(FLEET, "R1"), True), (keys.alive(FLEET, "R1"), False)]
    assert [(key, alive) for key, alive, _ in heard.wait(2)] == own


def test_the_desk_says_what_operators_say_and_nothing_else(ends):
    _, tapped, desk, _ = ends
    heard = Heard()
    for key in (
        *(kind(FLEET) for kind in (*keys.TOLD, keys.command)),
        keys.report(FLEET, "*"),
        keys.admit(FLEET, "*"),
    ):
        tapped.subscribe(key, heard)
    desk.put(keys.report(FLEET, "R1"), b"no robot")
    desk.put(keys.command(FLEET), b"no coordinator")
    desk.put(keys.order("other"), CANCEL)
    desk.put(keys.order(FLEET), CANCEL)
    desk.put(keys.tell(FLEET), encode(Tell(1, END)))
    desk.put(keys.admit(FLEET, "R1"), encode(Admit(1)))
    assert [key for key, _, _ in heard.wait(3)] == [
        keys.order(FLEET),
        keys.tell(FLEET),
        keys.admit(FLEET, "R1"),
    ]


def test_the_desk_gets_answers_to_what_it_asks(ends):
    _, tapped, desk, _ = ends
    heard = Heard()
    desk.subscribe(keys.orders(FLEET, "*"), heard)
    tapped.answer(keys.orders(FLEET, "*"), lambda: [(keys.orders(FLEET, "a"), b"done")])
    desk.ask(keys.orders(FLEET, "*"), heard)
    assert heard.wait(1) == [(keys.orders(FLEET, "a"), b"done", None)]


def test_a_desk_that_hangs_loses_messages_and_delays_nobody():
    network, (ours, theirs) = MemoryNetwork(), Pipe()
    tapped = TappedLink(network.session("coordinator"), ours, FLEET)
    for _ in range(20_000):
        tapped.put(keys.command(FLEET), bytes(200))
    tapped.close()
    theirs.close()


def test_a_desk_that_dies_is_no_matter():
    network, (ours, theirs) = MemoryNetwork(), Pipe()
    tapped = TappedLink(network.session("coordinator"), ours, FLEET)
    theirs.close()
    for _ in range(100):
        tapped.put(keys.command(FLEET), b"go")
    tapped.close()


def test_bytes_that_are_no_frame_end_the_pipe_alone():
    network, (ours, theirs) = MemoryNetwork(), Pipe()
    tapped = TappedLink(network.session("coordinator"), ours, FLEET)
    theirs.send_bytes(b"\xc1")
    tapped.put(keys.command(FLEET), b"go")
    assert theirs.poll(5.0)
    tapped.close()
    theirs.close()
