"""What the transport suite needs of either link: sessions, and waiting until something is heard."""

import socket
import threading
import time
from abc import ABC, abstractmethod

from protocol.zenoh_transport import ZenohTransport
from sim.world.memory_transport import MemoryNetwork

PATIENCE_S = 5.0


class Inbox:
    """A handler that keeps what it hears and can be waited for."""

    def __init__(self):
        self.heard = []
        self._changed = threading.Condition()

    def __call__(self, key, payload, sent_ns):
        with self._changed:
            self.heard.append((key, payload, sent_ns))
            self._changed.notify_all()

    def payloads(self):
        return [payload for _, payload, _ in self.heard]

    def wait(self, enough, seconds):
        with self._changed:
            return self._changed.wait_for(enough, seconds)


class Link(ABC):
    """Sessions named `coordinator` (open first) or after a robot."""

    def __init__(self):
        self._sessions = []

    def session(self, name):
        session = self.open(name)
        self._sessions.append(session)
        return session

    def close(self):
        for session in reversed(self._sessions):
            session.close()

    def say_until_heard(self, speaker, key, payload, *inboxes):
        """Put again and again, as the protocol does, until every inbox has heard it."""
        for inbox in inboxes:
            self.until(
                lambda: speaker.put(key, payload),
                inbox,
                lambda inbox=inbox: payload in inbox.payloads(),
            )

    @abstractmethod
    def open(self, name): ...

    @abstractmethod
    def until(self, again, inbox, enough): ...


class MemoryLink(Link):
    def __init__(self):
        super().__init__()
        self.network = MemoryNetwork(seed=1, delay_ns=(100_000, 900_000))

    def open(self, name):
        return self.network.session(name)

    def until(self, again, inbox, enough):  # noqa: ARG002
        for _ in range(10):
            again()
            self.network.advance(self.network.now_ns + 1_000_000)
            if enough():
                return
        raise AssertionError("not heard within 10 ms of virtual time")


class ZenohLink(Link):
    def __init__(self):
        super().__init__()
        self.endpoint = free_endpoint()

    def open(self, name):
        if name == "coordinator":
            return ZenohTransport.listen(self.endpoint)
        return ZenohTransport.connect(self.endpoint)

    def until(self, again, inbox, enough):
        deadline = time.monotonic() + PATIENCE_S
        while time.monotonic() < deadline:
            again()
            if inbox.wait(enough, 0.02):
                return
        raise AssertionError(f"not heard within {PATIENCE_S} s")


def free_endpoint():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"
