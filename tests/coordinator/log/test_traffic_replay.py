"""A log's traffic played again: what, when, under which keys."""

import random
import threading

import pytest
import typer
import zenoh

from coordinator.fleet.log_records import LINK_UP
from coordinator.log.records import Log, Record
from coordinator.log.traffic_replay import Wish, cues, key_filter, play
from protocol import keys
from protocol.zenoh_transport import ZenohTransport
from splinefleet import app
from tests.protocol.links import PATIENCE_S, free_endpoint

SECOND = 1_000_000_000


def log_of(*messages):
    records = [
        Record(key, payload, 7 * SECOND + round(t * SECOND), 0, 0) for t, key, payload in messages
    ]
    return Log({"fleet": "f"}, {}, records, True, "")


LOG = log_of(
    (0.0, keys.command("f"), b"0"),
    (1.0, keys.alive("f", "R1"), LINK_UP),
    (1.5, keys.report("f", "R1"), b"1"),
    (2.0, "coordinator/f/epoch", b"{}"),
    (2.5, keys.report("f", "R2"), b"2"),
    (3.0, "weather", b"3"),
)


def told(wish):
    return [(cue.due, cue.key, cue.payload) for cue in cues(LOG, wish)]


def test_what_was_put_is_played_in_order_and_nothing_else():
    assert told(Wish()) == [
        (0.0, "splinefleet/f/command", b"0"),
        (1.5, "splinefleet/f/report/R1", b"1"),
        (2.5, "splinefleet/f/report/R2", b"2"),
        (3.0, "weather", b"3"),
    ]


def test_a_part_of_the_time_begins_at_once_and_holds_both_its_ends():
    assert [(due, payload) for due, _, payload in told(Wish(since=1.5, until=2.5))] == [
        (0.0, b"1"),
        (1.0, b"2"),
    ]
    assert told(Wish(since=9.0)) == []


def test_chosen_keys_go_under_a_prefix():
    assert told(Wish(pattern="splinefleet/*/report/*", prefix="again/one")) == [
        (1.5, "again/one/splinefleet/f/report/R1", b"1"),
        (2.5, "again/one/splinefleet/f/report/R2", b"2"),
    ]


def test_an_empty_log_plays_nothing():
    assert cues(log_of()) == []
    assert play([], lambda *_: None, lambda _: None) == 0


@pytest.mark.parametrize("speed", [0.5, 1.0, 4.0])
def test_messages_go_out_when_their_time_has_come(speed):
    clock, sent = [0.0], []

    def wait_until(seconds):
        assert seconds >= clock[0]
        clock[0] = seconds

    found = cues(LOG)
    count = play(found, lambda key, _payload: sent.append((clock[0], key)), wait_until, speed)
    assert count == len(found) == 4
    assert sent == [(cue.due / speed, cue.key) for cue in found]


def test_patterns_mean_what_they_mean_to_zenoh():
    chance = random.Random(1)
    words = ["a", "b", "ab", "abc", "a.b", "a+"]
    for _ in range(3_000):
        parts = [
            chance.choice([*words, "*", "**", "$*b", "a$*"])
            for _ in range(chance.choice((1, 2, 3, 4)))
        ]
        pattern = zenoh.KeyExpr.autocanonize("/".join(parts))
        key = "/".join(chance.choice(words) for _ in range(chance.randrange(1, 5)))
        assert key_filter(str(pattern))(key) == pattern.includes(zenoh.KeyExpr(key)), (pattern, key)
        assert key_filter("/".join(parts))(key) == pattern.includes(zenoh.KeyExpr(key)), parts


@pytest.mark.parametrize(
    "pattern", ["", "/a", "a/", "a//b", "a*", "***", "a/**b", "a#", "a?b", "a$b"]
)
def test_a_malformed_pattern_is_refused(pattern):
    with pytest.raises(ValueError, match="is not a key pattern"):
        key_filter(pattern)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--keys a//b", "'--keys': 'a//b' is not a key pattern"),
        ("--prefix /a", "'--prefix': '/a' is not a prefix of keys"),
        ("--prefix a/*", "'--prefix': 'a/*' is not a prefix of keys"),
        ("--from -1", "'--from': -1.0 is not a finite number from 0"),
        ("--from 3 --to 2", "'--to': 2 s is before --from 3"),
    ],
)
def test_a_wish_that_makes_no_sense_is_one_line(options, said):
    with pytest.raises(typer.TyperException) as caught:
        app(["replay", "absent.mcap", *options.split()], standalone_mode=False)
    assert said in caught.value.format_message()


def test_playing_waits_for_somebody_who_listens():
    endpoint = free_endpoint()
    with ZenohTransport.listen(endpoint) as player:
        assert not player.wait_for_listener("again/**", 0.0)
        heard = threading.Event()
        with ZenohTransport.connect(endpoint) as listener:
            listener.subscribe("again/splinefleet/*/command", lambda *_: heard.set())
            assert player.wait_for_listener("again/**", PATIENCE_S)
            assert not player.wait_for_listener("elsewhere/**", 0.0)
            found = cues(LOG, Wish(prefix="again"))
            play(found, player.put, lambda _: None)
            assert heard.wait(PATIENCE_S)
