"""The desk over HTTP: statuses, bodies, who may do what, events, metrics, the OpenAPI document."""

import http.client
import json
import socket
import time
import urllib.error
import urllib.request
from contextlib import ExitStack, contextmanager

import pytest
from openapi_spec_validator import validate
from prometheus_client.parser import text_string_to_metric_families

from coordinator.base.errors import InputError
from coordinator.desk import commands, web
from coordinator.desk.api import ENDPOINTS
from coordinator.desk.commands import PATIENCE_S
from coordinator.desk.line import Line
from coordinator.desk.openapi import openapi
from coordinator.desk.rights import Right, is_foreign, party_of
from coordinator.desk.web import Desk, page_app, served
from coordinator.view.live_course import LiveCourse
from protocol import keys
from protocol.messages import END, GO_ON, HALT, REFUSED, Admit, Cancel, Order, OrderState, Tell
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet, a_report

JSON = {"Content-Type": "application/json"}
TRIANGLE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


@contextmanager
def desk_of(fleet, **options):
    line = Line(fleet, LiveCourse(FLEET, None), "page")
    desk = Desk(line, lambda may: f"<p>{may}</p>", **{"may_command": True, **options})
    with served(desk.app()) as address:
        fleet.beat()
        fleet.tell(keys.report(FLEET, "R1"), a_report())
        yield address


@pytest.fixture(scope="module")
def hall():
    fleet = FakeFleet()
    with desk_of(fleet) as address:
        yield fleet, address


@pytest.fixture
def desk(hall):
    fleet, address = hall
    fleet.said.clear()
    fleet.beat()
    return fleet, address


def ask(address, path="", method="GET", body=None, headers=JSON):
    data = body if body is None or isinstance(body, bytes) else json.dumps(body).encode()
    request = urllib.request.Request(address + path, data, headers, method=method)
    try:
        with urllib.request.urlopen(request, timeout=20.0) as answer:
            return answer.status, json.loads(answer.read() or b"null")
    except urllib.error.HTTPError as error:
        with error:
            return error.code, json.loads(error.read())


def test_the_fleet_is_told_as_it_is_known(desk):
    _, address = desk
    status, fleet = ask(address, "api/fleet")
    assert (status, fleet["fleet"], fleet["phase"]) == (200, FLEET, "go")
    assert [one["id"] for one in fleet["robots"]] == ["R1"]


def test_an_order_goes_to_the_fleet_with_who_gave_it_and_its_state_comes_back(desk):
    fleet, address = desk
    body = {"goal": [1.0, 2.0, 0.5], "id": "o-1", "robot": "R1", "via": [[3.0, 4.0]], "dwell": 2.5}
    status, state = ask(address, "api/orders", "POST", {**body, "priority": 3, "now": True})
    assert (status, state["id"], state["state"]) == (201, "o-1", "under way")
    order = fleet.said[0]
    assert isinstance(order, Order)
    assert (order.goal, order.via, order.dwell_ms) == ((1.0, 2.0, 0.5), ((3.0, 4.0),), 2_500)
    assert (order.priority, order.now, order.by) == (3, True, "page")
    assert ask(address, "api/orders/o-1")[1] == state
    assert state in ask(address, "api/orders")[1]


def test_an_order_with_the_id_of_another_one_is_refused_with_where_that_one_leads(desk):
    _, address = desk
    status, problem = ask(address, "api/orders", "POST", {"goal": [1.0, 2.0], "id": "taken"})
    assert status == 409
    assert problem["error"] == "taken is another order for R1, to (9, 5); use another id"


def test_a_refusal_that_is_told_to_who_gave_the_order_calls_nobody_else(desk):
    _, address = desk
    body = {"goal": [1.0, 2.0], "robot": "R9", "id": "far"}
    assert ask(address, "api/orders", "POST", body)[0] == 409
    assert ask(address, "api/orders/far")[1]["state"] == "refused"
    assert "refused-far" not in [one["id"] for one in ask(address, "api/fleet")[1]["alarms"]]


def test_each_press_of_a_person_is_a_word_of_its_own(desk):
    fleet, address = desk
    for path in ("api/freeze", "api/resume", "api/freeze", "api/resume"):
        assert ask(address, path, "POST")[0] == 200
    for _ in range(2):
        ask(address, "api/robots/R1/admit", "POST")
    for kind, count in ((Tell, 4), (Admit, 2)):
        assert len({one.boot for one in fleet.said if isinstance(one, kind)}) == count


def test_a_robot_whose_join_was_refused_later_may_join_elsewhere_and_a_person_is_told(desk):
    fleet, address = desk
    body = {"at": [1.0, 2.0, 0.0]}
    assert ask(address, "api/robots/R4/join", "POST", body)[0] == 202
    refused = OrderState("join-R4", REFUSED, "R4", released_ms=5, reason="R1 rests too near")
    fleet.tell(keys.orders(FLEET, "join-R4"), refused)
    alarms = ask(address, "api/fleet")[1]["alarms"]
    assert "R4 does not join: R1 rests too near" in [one["text"] for one in alarms]
    assert ask(address, "api/robots/R4/join", "POST", {"at": [5.0, 6.0, 0.0]})[0] == 202


def test_an_admitted_robot_that_has_no_course_yet_is_told_so(monkeypatch):
    monkeypatch.setattr(commands, "_ADMIT_S", 0.3)
    with desk_of(FakeFleet()) as address:
        status, told = ask(address, "api/robots/R7/admit", "POST")
    assert status == 200
    assert told["text"].startswith("R7 was asked for and has no course yet: ")


def test_an_order_that_comes_after_another_one_is_answered_while_it_waits(desk):
    fleet, address = desk
    status, state = ask(
        address, "api/orders", "POST", {"goal": [1, 2], "id": "o-2", "after": "o-1"}
    )
    assert (status, state["state"], fleet.said[0].after) == (201, "waiting", "o-1")


def test_an_order_that_says_why_it_waits_is_answered_at_once(monkeypatch):
    monkeypatch.setattr("coordinator.desk.commands._SETTLES_S", 60.0)
    fleet, order = FakeFleet(), {"goal": [1, 2], "robot": "R1"}
    with desk_of(fleet) as address:
        fleet.beat()
        assert ask(address, "api/orders", "POST", order)[1]["state"] == "under way"
        second = ask(address, "api/orders", "POST", order)[1]
    assert (second["state"], second["reason"]) == ("waiting", "R1 does another one first")


def test_an_order_for_at_once_is_answered_when_it_has_begun_whatever_keeps_it_first(monkeypatch):
    monkeypatch.setattr("coordinator.desk.commands._SETTLES_S", 0.2)
    fleet, order = FakeFleet(), {"goal": [1, 2], "robot": "R1"}
    with desk_of(fleet) as address:
        fleet.beat()
        ask(address, "api/orders", "POST", order)
        began = time.monotonic()
        assert ask(address, "api/orders", "POST", order | {"now": True})[1]["state"] == "waiting"
        assert time.monotonic() - began > 0.2


def test_all_that_is_wrong_with_an_order_is_told_at_once(desk):
    fleet, address = desk
    body = {"goal": [1.0], "robot": "R 1", "dwell": -1, "colour": "red"}
    status, problem = ask(address, "api/orders", "POST", body)
    assert status == 400
    assert [line.partition(":")[0] for line in problem["problems"]] == [
        "colour",
        "goal",
        "robot",
        "dwell",
    ]
    assert ask(address, "api/orders", "POST", {})[1]["problems"] == ["goal: is missing"]
    both = {"goal": [1, 2], "now": True, "after": "a"}
    assert ask(address, "api/orders", "POST", both)[0] == 400
    assert fleet.said == []


@pytest.mark.parametrize(
    ("method", "path", "body", "status"),
    [
        ("POST", "api/orders", {"goal": [1, 2], "robot": "R8"}, 409),
        ("GET", "api/orders/nosuch", None, 404),
        ("DELETE", "api/orders/nosuch", None, 404),
        ("DELETE", "api/orders/done", None, 409),
        ("DELETE", "api/orders/refused", None, 409),
        ("DELETE", "api/orders/under-way", None, 200),
        ("POST", "api/freeze", {"reason": "fire"}, 200),
        ("POST", "api/resume", {"reason": "out"}, 400),
        ("POST", "api/orders", {"goal": [1, 2], "now": True}, 400),
        ("POST", "api/orders", {"goal": [1, 2], "id": ".."}, 400),
        ("POST", "api/robots/R2/join", {"at": [1, 2, 0], "max_accel": 1e-300}, 400),
        ("POST", "api/robots/R1/admit", None, 409),
        ("POST", "api/robots/R2/join", {"at": [1, 2, 0]}, 202),
        ("POST", "api/robots/R9/join", {"at": [1, 2, 0]}, 409),
        ("POST", "api/robots/R9/join", {"at": [1, 2]}, 400),
        ("POST", "api/robots/R2/leave", None, 200),
        ("POST", "api/robots/R9/leave", None, 409),
        ("POST", "api/robots/R%209/leave", None, 404),
        ("POST", "api/blocks", {"polygon": TRIANGLE, "id": "wet"}, 201),
        ("POST", "api/blocks", {"polygon": [[0, 0], [1, 0], [2, 0]]}, 400),
        ("GET", "api/blocks", None, 200),
        ("DELETE", "api/blocks/wet", None, 200),
        ("DELETE", "api/blocks/nosuch", None, 404),
        ("POST", "api/alarms/nosuch/acknowledge", None, 404),
        ("PUT", "api/freeze", None, 405),
        ("GET", "api/nosuch", None, 404),
        ("GET", "api/orders/", None, 404),
        ("POST", "api/orders", b"{", 400),
        ("POST", "api/orders", b"[]", 400),
        ("POST", "api/orders", b"\xff\xfe", 400),
        ("POST", "api/orders", b'{"\xa8": 1}', 400),
        ("POST", "api/orders", b"[" * 90_000, 400),
        ("POST", "api/orders", b" " * 100_001, 413),
    ],
)
def test_every_outcome_has_its_status_and_a_reason(desk, method, path, body, status):
    _, address = desk
    got, answer = ask(address, path, method, body)
    assert got == status
    assert (status < 400) == (not isinstance(answer, dict) or "error" not in answer)


def test_a_robot_joins_again_at_its_place_and_at_no_other(desk):
    _, address = desk
    path, body = "api/robots/R3/join", {"at": [4.5, 1.6, 0.0], "radius": 0.25}
    assert ask(address, path, "POST", body)[0] == 202
    assert ask(address, path, "POST", body | {"at": [4.5, 1.2, 0.0]})[0] == 409
    assert ask(address, path, "POST", body)[0] == 202
    assert ask(address, "api/robots/R3/leave", "POST")[0] == 200
    assert ask(address, path, "POST", body | {"at": [4.5, 1.2, 0.0]})[0] == 202


def test_a_client_that_leaves_in_the_middle_of_its_body_prints_nothing(desk, caplog):
    _, address = desk
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    head = f"POST /api/orders HTTP/1.1\r\nHost: {host}:{port}\r\nContent-Type: application/json\r\n"
    for _ in range(3):
        with socket.create_connection((host, int(port))) as client:
            client.sendall(f"{head}Content-Length: 9\r\n\r\n{{".encode())
    with socket.create_connection((host, int(port)), timeout=5.0) as client:
        client.sendall(f"{head}Content-Length: 99999999999\r\n\r\n{{".encode())
        assert client.recv(100).startswith(b"HTTP/1.1 413 ")
    assert ask(address, "api/fleet")[0] == 200
    assert caplog.records == []


def test_stop_go_on_and_end_are_told_until_the_fleets_commands_say_so(desk):
    fleet, address = desk
    assert ask(address, "api/freeze", "POST") == (200, {"fleet": FLEET, "phase": "stop"})
    assert ask(address, "api/resume", "POST") == (200, {"fleet": FLEET, "phase": "go"})
    assert ask(address, "api/end", "POST") == (202, {"fleet": FLEET, "phase": "go"})
    told = [one.what for one in fleet.said if isinstance(one, Tell)]
    assert list(dict.fromkeys(told)) == [HALT, GO_ON, END]


def test_a_fleet_that_does_not_answer_is_told_so(monkeypatch):
    monkeypatch.setattr("coordinator.desk.commands.PATIENCE_S", 0.3)
    fleet = FakeFleet()
    fleet.is_deaf = True
    with desk_of(fleet) as address:
        status, problem = ask(address, "api/orders/a", "DELETE")
    assert (status, PATIENCE_S) == (504, 5.0)
    assert problem["error"].startswith("no coordinator has answered")
    assert all(isinstance(one, Cancel) for one in fleet.said)


def test_a_browser_on_somebody_elses_page_cannot_command(desk):
    fleet, address = desk
    own = address.removeprefix("http://").rstrip("/")
    for headers, status in [
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Host": "evil.example:80"}, 403),
        ({"Origin": f"http://{own}"}, 200),
    ]:
        assert ask(address, "api/freeze", "POST", headers=headers)[0] == status
    assert ask(address, "api/freeze", "POST", b"{}", {"Content-Type": "text/plain"})[0] == 415
    assert all(isinstance(one, Tell) for one in fleet.said)


def test_who_may_only_look_cannot_command():
    fleet = FakeFleet()
    with desk_of(fleet, may_command=False) as address:
        for one in ENDPOINTS:
            path = one.path[1:].replace("{name}", "R1")
            status = ask(address, path, one.method, {} if one.method == "POST" else None)[0]
            assert (status == 403) == (one.right is Right.COMMAND)
        with urllib.request.urlopen(address, timeout=5.0) as page:
            assert page.read() == b"<p>False</p>"
    assert fleet.said == []


@pytest.mark.parametrize(
    ("name", "right"),
    [
        (None, Right.COMMAND),
        ("operator/anna/1", Right.COMMAND),
        ("observer/tv/2", Right.LOOK),
        ("robot/R1/1", Right.NOTHING),
        ("coordinator/coordinator/1", Right.NOTHING),
        ("somebody", Right.NOTHING),
        ("", Right.NOTHING),
    ],
)
def test_the_role_on_a_certificate_decides(name, right):
    assert party_of(name, may_command=True).right is right
    assert party_of(name, may_command=False).right is min(right, Right.LOOK)


def test_a_host_name_that_resolves_here_is_foreign_only_without_tls():
    assert is_foreign({"host": "hall.example:8443"}, is_local=True)
    assert not is_foreign({"host": "hall.example:8443"}, is_local=False)
    assert is_foreign({"host": "h:1", "origin": "https://h:2"}, is_local=False)
    for here in ("127.0.0.1", "localhost", "[::1]", "[::1]:80"):
        assert not is_foreign({"host": here, "origin": f"http://{here}"}, is_local=True)
    assert is_foreign({"host": "hall.example"}, is_local=True)


def read_events(address, path, count):
    """Return the first events as (name, data)."""
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    connection = http.client.HTTPConnection(host, int(port), timeout=10.0)
    connection.request("GET", path)
    answer, found = connection.getresponse(), []
    assert answer.headers["Content-Type"].startswith("text/event-stream")
    while len(found) < count:
        line = answer.readline().decode().rstrip()
        if line.startswith("event: "):
            data = answer.readline().decode().removeprefix("data: ")
            found.append((line.removeprefix("event: "), json.loads(data)))
    connection.close()
    return found


def test_a_desk_that_ends_ends_its_streams_without_a_word(caplog):
    with desk_of(FakeFleet()) as address:
        host = address.removeprefix("http://").rstrip("/")
        connection = http.client.HTTPConnection(host, timeout=10.0)
        connection.request("GET", "/api/events?scenes=1")
        answer = connection.getresponse()
        answer.readline()
    answer.read()
    connection.close()
    assert caplog.records == []


def test_events_tell_the_fleet_first_and_then_what_is_new(desk):
    fleet, address = desk
    (name, first), *_ = read_events(address, "/api/events", 1)
    assert (name, [one["id"] for one in first["robots"]]) == ("fleet", ["R1"])
    scenes = read_events(address, "/api/events?scenes=1", 3)
    assert {name for name, _ in scenes} >= {"scene", "word"}
    fleet.tell(keys.report(FLEET, "R1"), a_report(late=9))
    assert ask(address, "api/fleet")[1]["robots"][0]["late"] == 0.45
    fleet.tell(keys.report(FLEET, "R1"), a_report())


def test_the_metrics_are_read_by_the_official_parser(desk):
    _, address = desk
    with urllib.request.urlopen(f"{address}metrics", timeout=5.0) as answer:
        text = answer.read().decode()
    found = {family.name: family for family in text_string_to_metric_families(text)}
    assert found["splinefleet_up"].samples[0].value == 1.0
    assert found["splinefleet_robots"].samples[0].value == 1.0
    kinds = {one.labels["kind"]: one.value for one in found["splinefleet_messages"].samples}
    assert kinds["report"] >= 1.0


def test_the_openapi_document_is_valid_and_has_every_endpoint(desk):
    _, address = desk
    document = ask(address, "api/openapi.json")[1]
    validate(document)
    told = {(path, method) for path, one in document["paths"].items() for method in one}
    assert told == {(one.path, one.method.lower()) for one in ENDPOINTS} | {
        ("/api/events", "get"),
        ("/metrics", "get"),
    }
    assert document["info"]["version"] != openapi("9.9")["info"]["version"] == "9.9"


def test_bytes_that_are_no_http_are_answered_and_disturb_nobody(desk):
    _, address = desk
    host, port = address.removeprefix("http://").rstrip("/").split(":")
    for data in (b"\0" * 100, b"GET\r\n\r\n", b"POST /api/freeze HTTP/1.1\r\nHost: a\r\n\r\n"):
        with socket.create_connection((host, int(port)), timeout=5.0) as stranger:
            stranger.sendall(data)
            assert stranger.recv(100).startswith(b"HTTP/1.1 4")
    with socket.create_connection((host, int(port)), timeout=5.0):
        assert ask(address, "api/fleet")[0] == 200


def test_a_stop_gets_in_while_others_hold_requests_that_they_never_finish(monkeypatch):
    monkeypatch.setattr(web, "_MOST_KEPT", 20)
    monkeypatch.setattr(web, "_MOST_CONNECTIONS", 30)
    host = b"HTTP/1.1\r\nHost: 127.0.0.1\r\n"
    half = b"POST /api/resume " + host + b"Content-Length: 9\r\n\r\n{"
    begun = (b"", b"GET /api/events " + host + b"\r\n", half)
    with desk_of(FakeFleet()) as address, ExitStack() as held:
        place, port = address.removeprefix("http://").rstrip("/").split(":")
        for k in range(60):
            stranger = socket.create_connection((place, int(port)), timeout=5.0)
            held.enter_context(stranger)
            stranger.sendall(begun[k % 3])
        assert ask(address, "api/freeze", "POST")[0] == 200


def test_a_page_of_a_file_is_for_this_machine_only():
    with served(page_app(lambda: "<p>page</p>")) as address:
        with urllib.request.urlopen(address, timeout=5.0) as page:
            assert page.read() == b"<p>page</p>"
            assert page.headers["Content-Type"] == "text/html; charset=utf-8"
        assert ask(address, "etc/passwd")[0] == 404
        assert ask(address, "api/events")[0] == 404
        assert ask(address, headers={"Host": "elsewhere.example:80"})[0] == 403
        port = int(address.rstrip("/").rpartition(":")[2])
        with pytest.raises(InputError, match=str(port)), served(page_app(str), port=port):
            pass
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(address, timeout=5.0)


def test_a_desk_with_listeners_ends_at_once():
    fleet = FakeFleet()
    with desk_of(fleet) as address:
        host, port = address.removeprefix("http://").rstrip("/").split(":")
        connection = http.client.HTTPConnection(host, int(port), timeout=10.0)
        connection.request("GET", "/api/events?scenes=1")
        connection.getresponse().readline()
        began = time.monotonic()
    assert time.monotonic() - began < 3.0
    connection.close()


def test_an_admit_names_who_asks(desk):
    fleet, address = desk
    assert ask(address, "api/robots/R1/admit", "POST")[1]["error"] == "R1 has arrived already"
    assert next(one for one in fleet.said if isinstance(one, Admit)).by == "page"


def test_vda_5050_states_are_told_of_all_robots_and_of_one(desk):
    fleet, address = desk
    fleet.tell(keys.report(FLEET, "R1"), a_report())
    status, states = ask(address, "api/vda5050")
    assert (status, [one["serialNumber"] for one in states]) == (200, ["R1"])
    status, state = ask(address, "api/vda5050/R1")
    assert (status, state["driving"], state["errors"]) == (200, False, [])
    assert state["headerId"] > states[0]["headerId"]
    assert ask(address, "api/vda5050/R7")[0] == 404


def test_a_preview_needs_a_floor(desk):
    _, address = desk
    status, told = ask(address, "api/preview", "POST", {"goal": [1.0, 2.0]})
    assert (status, told["error"]) == (
        409,
        "the floor is not known to this desk: give it the plan",
    )


def test_what_is_no_http_is_answered_and_counted(desk, capfd):
    _, address = desk
    host, port = address.removeprefix("http://").rstrip("/").split(":")

    def counted():
        with urllib.request.urlopen(address + "metrics", timeout=20.0) as answer:
            text = answer.read().decode()
        found = [line for line in text.splitlines() if 'status="400"' in line]
        return float(found[0].split()[-1]) if found else 0.0

    before = counted()
    with socket.create_connection((host, int(port)), 5.0) as link:
        link.sendall(b"\x00\x01 nonsense\r\n\r\n")
        assert link.recv(100).startswith(b"HTTP/1.1 400")
    assert counted() == before + 1.0
    assert capfd.readouterr().err == ""
