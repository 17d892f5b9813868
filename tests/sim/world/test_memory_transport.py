import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.world.memory_liveliness import CUT_NOTICE_NS
from sim.world.memory_transport import LONGEST_HOLD_NS, MemoryNetwork

MS = 1_000_000


def exchange(network, count=200, step_ns=MS):
    """Two robots and a coordinator talk for a while; return what each heard, and when."""
    heard = []
    sessions = [network.session(name) for name in ("coordinator", "R1", "R2")]
    for session in sessions:

        def note(key, payload, sent_ns, name=session.name):
            heard.append((network.now_ns, name, key, payload, sent_ns))

        session.subscribe("f/*", note)
    for i in range(count):
        sessions[i % 3].put(f"f/{i % 3}", i.to_bytes(2, "big"))
        network.advance(network.now_ns + step_ns)
    network.advance(network.now_ns + 10 * LONGEST_HOLD_NS)
    assert network.next_due_ns() is None
    return heard


def one_way(network):
    speaker, listener = network.session("speaker"), network.session("listener")
    heard = []
    listener.subscribe("*", lambda _key, payload, _sent_ns: heard.append(int(payload)))
    return speaker, heard


@settings(derandomize=True, max_examples=15, database=None)
@given(st.integers(0, 2**32), st.floats(0, 1), st.floats(0, 1), st.floats(0, 1))
def test_the_same_seed_gives_the_same_deliveries(seed, loss, doubling, reordering):
    kinds = {"loss": loss, "doubling": doubling, "reordering": reordering}
    runs = [
        exchange(MemoryNetwork(seed, delay_ns=(MS, 30 * MS), **kinds), count=40) for _ in range(2)
    ]
    assert runs[0] == runs[1]


def test_another_seed_gives_other_deliveries():
    one, two = (exchange(MemoryNetwork(seed, loss=0.5)) for seed in (1, 2))
    assert one != two


def test_a_network_without_faults_delivers_everything_once_in_order_at_once():
    heard = exchange(MemoryNetwork())
    assert len(heard) == 400
    assert [row[3] for row in heard] == sorted(row[3] for row in heard)
    assert all(now_ns == sent_ns for now_ns, *_, sent_ns in heard)


def test_the_share_that_is_lost_is_the_one_asked_for():
    assert exchange(MemoryNetwork(loss=1.0)) == []
    assert 0.6 < len(exchange(MemoryNetwork(loss=0.3), count=1_000)) / 2_000 < 0.8


def test_the_share_that_comes_twice_is_the_one_asked_for():
    assert len(exchange(MemoryNetwork(doubling=1.0))) == 800
    assert 1.2 < len(exchange(MemoryNetwork(doubling=0.3), count=1_000)) / 2_000 < 1.4


def test_delays_lie_within_their_range_and_keep_the_order_between_two_sessions():
    heard = exchange(MemoryNetwork(delay_ns=(2 * MS, 9 * MS)))
    delays = [now_ns - sent_ns for now_ns, *_, sent_ns in heard]
    assert 2 * MS <= min(delays) < 3 * MS
    assert 8 * MS < max(delays) <= 9 * MS
    for listener in ("coordinator", "R1", "R2"):
        for key in ("f/0", "f/1", "f/2"):
            numbers = [row[3] for row in heard if row[1:3] == (listener, key)]
            assert numbers == sorted(numbers)


def test_a_message_that_is_held_back_is_overtaken():
    network = MemoryNetwork(seed=3, reordering=0.2)
    speaker, heard = one_way(network)
    for i in range(100):
        speaker.put("k", str(i).encode())
        network.advance(network.now_ns + MS)
    network.advance(network.now_ns + LONGEST_HOLD_NS)
    assert sorted(heard) == list(range(100))
    assert heard != sorted(heard)


def test_loss_is_drawn_apart_for_each_listener():
    heard = exchange(MemoryNetwork(loss=0.5))
    to_r1 = {row[3] for row in heard if row[1] == "R1" and row[2] == "f/0"}
    to_r2 = {row[3] for row in heard if row[1] == "R2" and row[2] == "f/0"}
    assert to_r1 - to_r2
    assert to_r2 - to_r1


def test_nothing_is_delivered_before_it_is_due_and_the_time_of_the_next_is_known():
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    speaker, heard = one_way(network)
    assert network.next_due_ns() is None
    network.advance(MS)
    speaker.put("k", b"1")
    assert network.next_due_ns() == 6 * MS
    network.advance(6 * MS - 1)
    assert heard == []
    network.advance(6 * MS)
    assert heard == [1]
    assert network.next_due_ns() is None


def test_an_answer_from_within_a_handler_is_sent_at_the_time_of_the_delivery():
    network = MemoryNetwork(delay_ns=(2 * MS, 2 * MS))
    asker, answerer = network.session("asker"), network.session("answerer")
    answerer.subscribe("ask", lambda _key, payload, _sent_ns: answerer.put("answer", payload))
    answers = []
    asker.subscribe(
        "answer", lambda _key, _payload, sent_ns: answers.append((network.now_ns, sent_ns))
    )
    asker.put("ask", b"?")
    network.advance(100 * MS)
    assert answers == [(4 * MS, 2 * MS)]


@pytest.mark.parametrize("name", ["speaker", "listener"])
def test_a_session_that_is_cut_off_neither_hears_nor_is_heard_until_healed(name):
    network = MemoryNetwork(delay_ns=(2 * MS, 2 * MS))
    speaker, heard = one_way(network)
    speaker.put("k", b"1")
    network.advance(MS)
    network.cut(name)
    speaker.put("k", b"2")
    network.advance(10 * MS)
    network.heal(name)
    speaker.put("k", b"3")
    network.advance(20 * MS)
    assert heard == [3]


def test_a_cut_leaves_the_draws_of_all_others_as_they_were():
    whole, cut = MemoryNetwork(7, loss=0.4), MemoryNetwork(7, loss=0.4)
    cut.cut("R2")
    expected = [row for row in exchange(whole) if row[1] != "R2" and row[2] != "f/2"]
    assert exchange(cut) == expected


def test_what_was_put_before_close_still_arrives_and_a_name_can_come_back():
    network = MemoryNetwork(delay_ns=(MS, MS))
    speaker, heard = one_way(network)
    speaker.put("k", b"1")
    speaker.close()
    network.session("speaker").put("k", b"2")
    network.advance(MS)
    assert heard == [1, 2]


def test_a_message_to_a_closed_session_does_not_reach_its_successor():
    network = MemoryNetwork(delay_ns=(MS, MS))
    speaker, listener = network.session("speaker"), network.session("listener")
    heard = []
    listener.subscribe("k", lambda *message: heard.append(message))
    speaker.put("k", b"1")
    listener.close()
    network.session("listener").subscribe("k", lambda *message: heard.append(message))
    network.advance(MS)
    assert heard == []


def test_wrong_calls_are_refused_with_the_numbers():
    with pytest.raises(ValueError, match=r"loss is 1\.5"):
        MemoryNetwork(loss=1.5)
    with pytest.raises(ValueError, match="doubling is nan"):
        MemoryNetwork(doubling=float("nan"))
    with pytest.raises(ValueError, match=r"\(5, 4\)"):
        MemoryNetwork(delay_ns=(5, 4))
    network = MemoryNetwork()
    network.session("R1")
    with pytest.raises(ValueError, match="'R1' is open already"):
        network.session("R1")
    with pytest.raises(ValueError, match="'R2' is not open"):
        network.drop("R2")
    with pytest.raises(ValueError, match="drop_notice_ns is -1"):
        MemoryNetwork(drop_notice_ns=-1)
    network.advance(10)
    with pytest.raises(ValueError, match="from 10 ns to 9 ns"):
        network.advance(9)


def watched(network):
    """A coordinator that watches R1, which has declared itself; the changes it is told, in ms."""
    coordinator, robot = network.session("coordinator"), network.session("R1")
    told = []
    coordinator.watch_alive("*", lambda _key, alive: told.append((network.now_ns // MS, alive)))
    robot.declare_alive("R1")
    network.advance(100 * MS)
    assert told[0][1]
    return robot, told


def test_changes_are_told_after_the_longest_delay_and_never_lost():
    network = MemoryNetwork(loss=1.0, delay_ns=(2 * MS, 9 * MS), reordering=1.0)
    robot, told = watched(network)
    robot.close()
    network.advance(500 * MS)
    assert told == [(9, True), (109, False)]
    assert network.next_due_ns() is None


@pytest.mark.parametrize(("arguments", "notice"), [({}, 100), ({"drop_notice_ns": 3 * MS}, 3)])
def test_a_dropped_session_is_silent_at_once_and_gone_after_the_notice(arguments, notice):
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS), **arguments)
    robot, told = watched(network)
    heard = []
    listener = network.session("listener")
    listener.subscribe("k", lambda _key, payload, _sent_ns: heard.append(payload))
    robot.subscribe("k", lambda _key, payload, _sent_ns: heard.append(payload))
    robot.put("k", b"on its way already")
    listener.put("k", b"to the dead")
    network.drop("R1")
    robot.put("k", b"too late")
    robot.close()
    network.advance(10_000 * MS)
    assert heard == [b"on its way already"]
    assert told == [(5, True), (100 + notice, False)]


def test_a_dropped_session_that_is_back_before_the_notice_never_was_gone():
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    _, told = watched(network)
    network.drop("R1")
    network.session("R1").declare_alive("R1")
    network.advance(10_000 * MS)
    assert told == [(5, True)]


def test_a_session_that_follows_a_dropped_one_that_hung_is_delivered_to():
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    network.session("R1")
    network.hold("R1")
    network.drop("R1")
    heard = []
    network.session("R1").subscribe("k", lambda _key, payload, _sent_ns: heard.append(payload))
    network.session("R2").put("k", b"to the new one")
    network.advance(10 * MS)
    assert heard == [b"to the new one"]


@pytest.mark.parametrize("name", ["R1", "coordinator"])
def test_a_session_that_is_cut_off_counts_as_alive_until_the_connection_is_given_up(name):
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    _, told = watched(network)
    network.cut(name)
    network.advance(100 * MS + CUT_NOTICE_NS - 1)
    assert told == [(5, True)]
    network.advance(20_000 * MS)
    network.heal(name)
    network.advance(30_000 * MS)
    assert told == [(5, True), (10_100, False), (20_005, True)]


def test_a_cut_that_is_healed_in_time_is_never_told():
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    _, told = watched(network)
    network.cut("R1")
    network.advance(9_000 * MS)
    network.heal("R1")
    network.advance(30_000 * MS)
    assert told == [(5, True)]


def test_what_happens_behind_a_cut_is_told_when_it_is_healed():
    network = MemoryNetwork(delay_ns=(5 * MS, 5 * MS))
    robot, told = watched(network)
    network.cut("coordinator")
    robot.close()
    network.session("R2").declare_alive("R2")
    network.advance(2_000 * MS)
    assert told == [(5, True)]
    network.heal("coordinator")
    network.advance(3_000 * MS)
    assert told == [(5, True), (2_005, False), (2_005, True)]


@settings(derandomize=True, max_examples=10, database=None)
@given(st.integers(0, 2**32))
def test_tokens_and_watchers_leave_the_draws_of_messages_as_they_were(seed):
    plain, watching = (MemoryNetwork(seed, loss=0.4, delay_ns=(MS, 9 * MS)) for _ in range(2))
    watching.session("one").watch_alive("*", lambda _key, _alive: None)
    watching.session("two").declare_alive("k")
    assert exchange(watching, count=40) == exchange(plain, count=40)
