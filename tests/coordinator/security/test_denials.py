"""Refusals read from lines as Zenoh 1.10.2 writes them (its colours and identifiers kept)."""

import datetime

import pytest

from coordinator.security.denials import (
    AGAIN_S,
    DULL,
    MOST,
    MOST_EACH,
    Denial,
    Denials,
    denial_key,
    denial_of,
    denial_record,
    is_denial_key,
)

R1, GONE = "244ad3bff93189883f856865f6780a5e", "6f47f42e3e8e6ee5b2937a4d354b2e0f"
END = datetime.datetime(2026, 11, 20, 23, 33, 53, tzinfo=datetime.UTC)
NAMES = {R1: "robot/R1/1"}

TLS = (
    "\x1b[2m2026-11-21T23:34:34.812449Z\x1b[0m \x1b[33m WARN\x1b[0m acc-0 ThreadId(05) "
    "\x1b[2mzenoh_link_tls::unicast\x1b[0m\x1b[2m:\x1b[0m {} "
    "Hint: increase the system open file limit."
)
EXPIRED = (
    "invalid peer certificate: certificate expired: verification time 1795304074 (UNIX), "
    "but certificate is not valid after 1795217633 (86441 seconds ago)."
)
ACCESS = (
    "2026-11-21T23:35:16.271247Z TRACE  rx-0 ThreadId({}) demux{{zid=41a6 "
    "src=south:0:client/244ad3bf:1}}: zenoh::net::routing::interceptor::access_control: {}"
)
SUBJECT = f"{R1} on Interface(lo)+CertCommonName(robot/R1/1)+Transport(Tls)+{R1}"


def denials():
    return Denials(lambda session: NAMES.get(session, ""), lambda end: "R7" * (end == END))


def access(text, thread=12):
    return ACCESS.format(f"{thread:02}", text)


def texts(lines, now_s=0.0):
    return [denial.text for denial in denials().read(lines, now_s)]


@pytest.mark.parametrize(
    ("reason", "said"),
    [
        (EXPIRED, "refused R7: its key has expired"),
        ("invalid peer certificate: UnknownIssuer.", "somebody: its key is from another authority"),
        ("invalid peer certificate: BadSignature.", "somebody: its key is from another authority"),
        ("peer sent no certificates.", "somebody: it has no key"),
        ("received corrupt message of type InvalidContentType.", "somebody: it speaks plain TCP"),
        (
            "received corrupt message of type UnknownProtocolVersion.",
            "somebody: it speaks plain TCP",
        ),
        ("received fatal alert: UnknownCA.", "somebody: it trusts another authority"),
        ("received fatal alert: BadCertificate.", "somebody: it does not trust the key"),
        ("something new.", "somebody: no TLS link: something new."),
        ("\u202eolleh", r"somebody: no TLS link: \u202eolleh"),
    ],
)
def test_a_refused_link_is_told_with_its_cause_and_by_an_end_that_is_known_whose_it_was(
    reason, said
):
    (text,) = texts([TLS.format(reason)])
    assert said in text


@pytest.mark.parametrize(
    ("deed", "said"),
    [
        ("Put", "publish on"),
        ("Delete", "delete"),
        ("Declare Subscriber", "subscribe to"),
        ("Declare Queryable", "answer queries on"),
        ("Query", "query"),
        ("Liveliness Token", "declare itself alive on"),
        ("Declare Liveliness Subscriber", "subscribe to"),
        ("Something", "do (Something)"),
    ],
)
@pytest.mark.parametrize("subject", [SUBJECT, f"Using cached result: {R1}"])
def test_what_is_denied_is_told_with_who_and_what(subject, deed, said):
    line = access(f"{subject} is unauthorized to {deed} (ingress) on splinefleet/f/hello/R2")
    expected = f"refused robot R1, key 1: it may not {said} splinefleet/f/hello/R2"
    assert texts([line]) == [expected]


def test_a_key_with_letters_that_hide_others_is_told_as_it_is():
    line = access(f"{SUBJECT} is unauthorized to Put (ingress) on a/\u202eb\x85c")
    assert texts([line]) == [r"refused robot R1, key 1: it may not publish on a/\u202eb\x85c"]


def test_a_session_of_which_nothing_is_known_is_somebody():
    line = access(f"Using cached result: {GONE} is unauthorized to Put (ingress) on a/b")
    assert texts([line]) == ["refused somebody: it may not publish on a/b"]


def test_what_is_only_looked_up_in_advance_is_no_refusal_but_the_same_deed_again_is():
    key = "splinefleet/f/plan/R1"
    deeds = ("Query", "Reply", "Put", "Delete", "Declare/Undeclare Subscriber")
    ahead = [access(f"ACL (ingress): caching permissions for `{key}` ...")]
    ahead += [access(f"{SUBJECT} is unauthorized to {deed} (ingress) on {key}") for deed in deeds]
    real = access(f"{SUBJECT} is unauthorized to Put (ingress) on {key}")
    assert texts(ahead) == []
    assert texts([*ahead, real]) == [f"refused robot R1, key 1: it may not publish on {key}"]


def test_a_look_up_in_advance_hides_no_refusal_on_another_thread_key_or_session():
    ahead = access("ACL (ingress): caching permissions for `a/b` ...")
    own = access(f"{SUBJECT} is unauthorized to Put (ingress) on a/b")
    others = [
        access(f"{SUBJECT} is unauthorized to Put (ingress) on a/b", thread=13),
        access(f"{SUBJECT} is unauthorized to Put (ingress) on a/c"),
        access(f"{SUBJECT.replace(R1, GONE)} is unauthorized to Delete (ingress) on a/b"),
    ]
    assert len(texts([ahead, own, *others])) == 3


def test_what_is_not_given_to_somebody_who_did_not_ask_is_no_refusal():
    assert texts([access(f"{SUBJECT} is unauthorized to Put (egress) on a/b")]) == []


def test_lines_of_something_else_are_passed_over():
    lines = [
        "",
        "\x1b[2m",
        "INFO zenoh: hello",
        access("nothing"),
        access(f"{R1}{DULL.decode()}Put"),
    ]
    assert texts(lines) == []


def test_what_goes_on_is_told_at_once_then_now_and_then_with_how_often():
    reader, line = denials(), TLS.format("peer sent no certificates.")
    assert [one.count for one in reader.read([line], 0.0)] == [1]
    told = [reader.read([line, line], 0.1 * tick) for tick in range(1, 99)]
    assert not any(told)
    assert [one.count for one in reader.read([], AGAIN_S)] == [196]
    assert reader.read([], 2 * AGAIN_S) == []
    assert [one.count for one in reader.read([line], 2 * AGAIN_S + 0.1)] == [1]


def test_a_flood_of_different_refusals_is_told_in_few_words_and_forgotten():
    reader = denials()
    flood = [(f"somebody {number}", "no") for number in range(10 * MOST)]
    told = reader.note(flood, 0.0)
    assert len(told) == MOST + 1
    assert told[-1].cause == "many different things"
    assert told[-1].count == 9 * MOST
    reader.note([], AGAIN_S)
    assert len(reader.note([("somebody else", "no")], AGAIN_S)) == 1


def test_a_flood_of_one_keeps_its_name_and_hides_nobody_else():
    reader = denials()
    flood = [("robot R1, key 1", f"it may not publish on {k}") for k in range(10 * MOST)]
    told = reader.note([*flood, ("robot R2, key 1", "its key was revoked")], 0.0)
    assert len(told) == MOST_EACH + 2
    assert {one.who for one in told} == {"robot R1, key 1", "robot R2, key 1"}


def test_a_refusal_is_read_from_a_log_as_it_was_written():
    denial = Denial("robot R1, key 1", "its key was revoked", 3)
    assert denial_of(denial_record(denial)) == denial
    assert denial_of(b"null") is None
    assert denial_of(b"\xff") is None
    assert is_denial_key(denial_key("f"))
    assert not is_denial_key("splinefleet/f/denied")
