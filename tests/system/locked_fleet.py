"""A coordinator with keys, and strangers before its gate."""

import contextlib
import datetime
import json
import shutil
import signal
import threading
import time

import pytest
import zenoh

from coordinator.security.certificate_authority import new_authority, new_certificate
from coordinator.security.key_store import KeyStore
from protocol import zenoh_transport
from protocol.badge import Badge
from protocol.key_files import AUTHORITY, CERTIFICATE, PRIVATE, KeyFiles, read_key_files
from protocol.transport import TransportError
from protocol.zenoh_transport import ZenohTransport
from tests.protocol.links import free_endpoint
from tests.system.fleet_tools import TWO_ROBOTS, started

FLEET = "two"
NOW = datetime.datetime.now(datetime.UTC)
LONG_AGO = NOW - datetime.timedelta(days=400)


def files_in(folder, badge):
    """Name the files of a folder without looking at them, as a thief would."""
    places = (folder / name for name in (AUTHORITY, CERTIFICATE, PRIVATE))
    return KeyFiles(*places, badge, NOW)


def forged(folder, authority, badge, trusts):
    """Make a folder with a certificate of any authority, for a party that trusts any."""
    folder.mkdir()
    pair = new_certificate(authority, badge, NOW, 30)
    (folder / AUTHORITY).write_bytes(trusts)
    (folder / CERTIFICATE).write_bytes(pair.certificate)
    (folder / PRIVATE).write_bytes(pair.private)
    return files_in(folder, badge)


class Keys:
    """The keys of fleet `two`: R1's first has expired, its second is revoked, its third counts."""

    def __init__(self, folder):
        self.folder = folder / "keys"
        store = KeyStore(self.folder)
        store.begin(LONG_AGO)
        self.expired = self._aside(store.issue("robot", ["R1"], LONG_AGO, 30)[0], "expired")
        self.revoked = self._aside(store.issue("robot", ["R1"], NOW, 30)[0], "revoked")
        store.revoke("robot", "R1", NOW)
        store.issue("robot", ["R1", "R2", "R9"], NOW, 365)
        store.issue("coordinator", ["coordinator"], NOW, 365)
        store.issue("observer", ["observer", "other"], NOW, 365)
        store.issue("operator", ["operator"], NOW, 365)
        self.authority = store._authority()
        badge = Badge("robot", "R1", 3)
        trusted = self.authority.certificate
        self.strange = forged(folder / "strange", new_authority(NOW), badge, trusted)
        self.patterns = [
            forged(folder / f"pattern{number}", self.authority, Badge("robot", name, 3), trusted)
            for number, name in enumerate(("*", "**", "R*", "$*", "R1/3", "r1", "R1 ", " R1"))
        ]

    def _aside(self, issued, name):
        shutil.copytree(self.folder / "robot/R1", self.folder.parent / name)
        return files_in(self.folder.parent / name, issued.badge)

    def of(self, role, name):
        return read_key_files(self.folder, role, name)


class Events:
    """What a coordinator says as JSON lines, each with the time at which it came."""

    def __init__(self, process):
        self.heard = []
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._read, args=(process.stdout,), daemon=True)
        self._thread.start()

    def _read(self, lines):
        for line in lines:
            with self._changed:
                self.heard.append((time.monotonic(), json.loads(line)))
                self._changed.notify_all()

    def wait(self, fits, seconds=20.0, since=0.0):
        """Return the first event since a time that fits, and when it came."""

        def found():
            return next((one for one in self.heard if one[0] >= since and fits(one[1])), None)

        with self._changed:
            assert self._changed.wait_for(found, seconds), [event for _, event in self.heard]
            return found()

    def denial(self, *words, since=0.0):
        """Wait for a refusal with these words; returns it and when it was told."""

        def fits(event):
            return event["event"] == "denied" and all(word in event["text"] for word in words)

        came, event = self.wait(fits, 10.0, since)
        return event, came

    def denials(self):
        return [event["text"] for _, event in self.heard if event["event"] == "denied"]


def scenario_in(folder):
    path = folder / "two.toml"
    path.write_text(TWO_ROBOTS)
    return path


def locked_endpoint():
    return free_endpoint().replace("tcp", "tls")


def session_without_key(endpoint, authority):
    """Try to open a session that trusts the authority and has no certificate; raises ZError."""
    settings = {
        **zenoh_transport._COMMON,
        **zenoh_transport._CLIENT,
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 300,
        "transport/link/tls": {"root_ca_certificate": str(authority), "enable_mtls": False},
    }
    config = zenoh.Config()
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    zenoh.open(config).close()


class Gate:
    """A running coordinator with keys: where it is, what it says, what it writes."""

    def __init__(self, endpoint, keys, events, log):
        self.endpoint, self.keys, self.events, self.log = endpoint, keys, events, log

    def connect(self, role, name=""):
        return self.connect_with(self.keys.of(role, name))

    def connect_with(self, files, timeout_s=5.0):
        return ZenohTransport.connect(self.endpoint, timeout_s=timeout_s, keys=files)


@contextlib.contextmanager
def coordinator(folder):
    """Start a coordinator with keys that waits for its two robots."""
    made, endpoint = Keys(folder), locked_endpoint()
    log = folder / "run.mcap"
    arguments = ["coordinator", scenario_in(folder), "--keys", made.folder, "--listen", endpoint]
    with started(*arguments, "--json", "--wait", 600, "--log", log) as process:
        events = Events(process)
        events.wait(lambda event: event["event"] == "listening")
        yield Gate(endpoint, made, events, log)
        process.send_signal(signal.SIGINT)
        assert process.wait(20.0) == 130


def no_link(gate, files, said):
    with pytest.raises(TransportError, match=said):
        gate.connect_with(files, timeout_s=0.2)
