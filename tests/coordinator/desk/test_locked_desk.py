"""The desk over TLS: the certificate decides who may look, who may command, and who it was."""

import datetime
import http.client
import json
import ssl
import urllib.request

import pytest

from coordinator.desk.line import Line
from coordinator.desk.web import Desk, served
from coordinator.security.key_store import KeyStore
from coordinator.view.live_course import LiveCourse
from protocol.key_files import read_key_files
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet

NOW = datetime.datetime.now(datetime.UTC)


@pytest.fixture(scope="module")
def hall(tmp_path_factory):
    folder = tmp_path_factory.mktemp("hall") / "keys"
    store = KeyStore(folder)
    store.begin(NOW)
    store.issue("operator", ["gone"], NOW, 365)
    store.revoke("operator", "gone", NOW)
    store.issue("coordinator", ["coordinator"], NOW, 365)
    store.issue("operator", ["anna"], NOW, 365)
    store.issue("observer", ["tv"], NOW, 365)
    store.issue("robot", ["R1"], NOW, 365)
    valid = frozenset(one.common_name for one in store.register().valid(NOW))
    fleet = FakeFleet()
    line = Line(fleet, LiveCourse(FLEET, None))
    desk = Desk(line, str, may_command=True, is_local=False, valid=valid)
    with served(desk.app(), files=read_key_files(folder, "coordinator")) as address:
        fleet.beat()
        yield fleet, int(address.rstrip("/").rpartition(":")[2]), folder


def ask(port, folder, role, name, method="POST", path="/api/freeze"):
    own = read_key_files(folder, "coordinator")
    context = ssl.create_default_context(cafile=str(own.authority))
    context.check_hostname = False
    if role:
        files = read_key_files(folder, role, name)
        context.load_cert_chain(files.certificate, files.private)
    connection = http.client.HTTPSConnection("127.0.0.1", port, timeout=10.0, context=context)
    try:
        connection.request(method, path, headers={"Host": "hall.example"})
        answer = connection.getresponse()
        return answer.status, json.loads(answer.read())
    finally:
        connection.close()


def test_an_operator_commands_and_is_named_in_what_the_fleet_hears(hall):
    fleet, port, folder = hall
    assert ask(port, folder, "operator", "anna")[0] == 200
    assert fleet.said[-1].by == "anna"


@pytest.mark.parametrize(
    ("role", "name", "look", "command"),
    [("observer", "tv", 200, 403), ("robot", "R1", 401, 401), ("operator", "gone", 401, 401)],
)
def test_others_may_less(hall, role, name, look, command):
    _, port, folder = hall
    assert ask(port, folder, role, name, "GET", "/api/fleet")[0] == look
    assert ask(port, folder, role, name)[0] == command


def test_who_has_no_certificate_gets_no_answer(hall):
    _, port, folder = hall
    with pytest.raises((ssl.SSLError, ConnectionError, http.client.HTTPException)):
        ask(port, folder, None, None)


def test_plain_http_gets_no_answer(hall):
    _, port, _ = hall
    with pytest.raises((ConnectionError, http.client.HTTPException)):
        urllib.request.urlopen(f"http://127.0.0.1:{port}/api/fleet", timeout=10.0)
