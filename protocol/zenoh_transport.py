"""The transport over Zenoh.

Either the coordinator's session routes messages and the robots are its clients, or a separate
router does so and all are its clients, the coordinator too.

Decides: Zenoh's settings, and which sentence a person reads when the link cannot be opened.
Must not know: what the bytes mean.  Zenoh is imported when a link is opened, not before.

A process that ends while a session is open hangs for ever, even after `sys.exit` or an exception:
use a transport in a `with` block, or close it in a `finally`.
"""

from __future__ import annotations

import contextlib
import errno
import json
import os
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from protocol.endpoint import endpoint_of
from protocol.transport import (
    AliveHandler,
    Answers,
    Handler,
    NoAnswerError,
    Transport,
    TransportError,
)

if TYPE_CHECKING:
    import zenoh

    from protocol.key_files import KeyFiles

LinkHandler = Callable[[str, str, str, bool], None]
"""Called as handler(session, common name or nothing, address, is up) when a link changes."""

_ATTEMPT_MS: Final = 2_000
"""The longest single attempt to connect: Zenoh ignores Ctrl-C while it tries."""

_LOOK_S: Final = 0.02

_ANSWER_S: Final = 2.0
"""How long [s] a query waits for answers."""

_COMMON: Final[dict[str, Any]] = {
    "scouting/multicast/enabled": False,
    "scouting/gossip/enabled": False,
    "scouting/delay": 0,
    "transport/shared_memory/enabled": False,
    "transport/link/tx/lease": 1_000,
    "transport/link/tx/keep_alive": 4,
    "transport/link/tx/queue/congestion_control/drop/wait_before_drop": 500,
    "transport/link/rx/max_message_size": 1_048_576,
}
_NOBODY_INSISTS: Final = {
    "messages": ["put", "delete"],
    "key_exprs": ["**"],
    "flows": ["ingress"],
    "overwrite": {"congestion_control": "drop"},
}
"""Drops messages that a client sends to a robot faster than the robot receives them.  Otherwise
Zenoh would block until its queue had room, and with it everything else for that robot, the
coordinator's own `put` too; in the end it would close the robot's link."""

_ROUTER: Final[dict[str, Any]] = {
    "mode": "router",
    "transport/unicast/accept_timeout": 2_000,
    "transport/link/tx/queue/congestion_control/block/wait_before_close": 500_000,
    "timestamping/enabled": True,
    "qos/network": [_NOBODY_INSISTS],
}
_CLIENT: Final[dict[str, Any]] = {
    "mode": "client",
    "connect/retry": {
        "period_init_ms": 100,
        "period_max_ms": 500,
        "period_increase_factor": 1.5,
    },
}


class ZenohTransport(Transport):
    """One Zenoh session, made by `listen` (it routes) or `connect` (it is a client).

    `sent_ns` is in nanoseconds since 1970, on the clock of the host that routes.  That host stamps
    the messages which it forwards, so a robot's wrong clock does no harm.
    """

    def __init__(self, session: zenoh.Session) -> None:
        import zenoh

        self._session = session
        self._drop = zenoh.CongestionControl.DROP
        self._block = zenoh.CongestionControl.BLOCK
        self._remote = zenoh.Locality.REMOTE
        self._appears = zenoh.SampleKind.PUT
        self._error = zenoh.ZError
        self._every = zenoh.ConsolidationMode.NONE
        self._gate = threading.RLock()
        self._closed = False
        self._tokens: list[zenoh.LivelinessToken] = []  # Zenoh undeclares an unreferenced one

    @classmethod
    def listen(
        cls, endpoint: str, keys: KeyFiles | None = None, access: dict[str, Any] | None = None
    ) -> ZenohTransport:
        """Open the coordinator's session, which routes messages between all its clients.

        With `keys`, only clients with a certificate of the same authority can connect, and `access`
        (access.py) states what each of them may do.  With `keys` but without `access`, clients can
        connect but may neither send nor receive.
        Raises TransportError when the endpoint is malformed, in use or not this machine's.
        """
        import zenoh

        endpoint_of(endpoint, locked=keys is not None)
        try:
            return cls(_open(router_settings(endpoint, keys, access)))
        except zenoh.ZError as error:
            raise TransportError(f"{endpoint}: {_why_not_listening(str(error))}") from None

    @classmethod
    def connect(
        cls,
        endpoint: str,
        timeout_s: float = 5.0,
        whom: str = "coordinator or router",
        keys: KeyFiles | None = None,
    ) -> ZenohTransport:
        """Open a client's session, trying for timeout_s seconds; errors name the other side `whom`.

        Once open, a session whose link breaks reconnects by itself, however long that takes. Raises
        TransportError when the endpoint is malformed, or when the other side is not of the same
        authority or refuses these keys; NoAnswerError when nobody answers within timeout_s.
        """
        import zenoh

        from protocol.tls_probe import why_no_link

        place = endpoint_of(endpoint, locked=keys is not None)
        settings = {**_COMMON, **_CLIENT, "connect/endpoints": [endpoint]}
        if keys is not None:
            settings["transport/link/tls"] = _locked(keys, "connect")
        deadline = time.monotonic() + timeout_s
        while True:
            left_ms = max(1, round((deadline - time.monotonic()) * 1_000))
            settings["connect/timeout_ms"] = min(left_ms, _ATTEMPT_MS)
            try:
                return cls(_open(settings))
            except zenoh.ZError:
                if time.monotonic() >= deadline:
                    why = "" if keys is None else why_no_link(place, keys)
                    if why:
                        raise TransportError(f"{endpoint}: {why}") from None
                    sentence = f"{endpoint}: nobody answers; is the {whom} running?"
                    raise NoAnswerError(sentence) from None

    def has_router(self) -> bool:
        """Return whether a client is linked to the session that routes for it; takes 1 us."""
        return bool(list(self._session.info.routers_zid()))

    def put(self, key: str, payload: bytes, attachment: bytes | None = None) -> None:
        """Send bytes; dropped when the link is congested, broken or closed.

        `attachment` is sent with them, for programs of others.  Raises zenoh.ZError only for a
        malformed key.
        """
        self._put(key, payload, self._drop, attachment)

    def put_patiently(self, key: str, payload: bytes) -> None:
        """Send bytes; wait when the link is congested, for a program that nobody relies on in time.

        A receiver that hangs costs 0.5 s, after which its link is closed.
        """
        self._put(key, payload, self._block, None)

    def _put(
        self, key: str, payload: bytes, when_full: zenoh.CongestionControl, attachment: bytes | None
    ) -> None:
        if self._closed:
            return
        try:
            self._session.put(
                key,
                payload,
                congestion_control=when_full,
                express=True,
                attachment=attachment,
            )
        except self._error:
            if not self._closed:  # another thread may have closed it meanwhile
                raise

    def subscribe(self, key_expression: str, handler: Handler) -> None:
        """Call the handler, on one of Zenoh's threads, for what other sessions put."""
        if self._closed:
            return

        def deliver(sample: zenoh.Sample) -> None:
            stamp = sample.timestamp
            sent_ns = None if stamp is None else stamp.get_time_as_ntp64().as_nanos()
            key, payload = str(sample.key_expr), sample.payload.to_bytes()
            with self._gate:
                if not self._closed:
                    handler(key, payload, sent_ns)

        self._session.declare_subscriber(key_expression, deliver, allowed_origin=self._remote)

    def answer(self, key_expression: str, answers: Answers) -> None:
        """Answer, on one of Zenoh's threads, queries on keys that intersect the expression."""
        if self._closed:
            return

        def reply(query: zenoh.Query) -> None:
            with query:
                for key, payload in () if self._closed else answers():
                    query.reply(key, payload, express=True)

        self._session.declare_queryable(key_expression, reply, complete=True)

    def ask(self, key_expression: str, handler: Handler) -> None:
        """Call the handler, on one of Zenoh's threads, for each answer; none has a time stamp."""
        if self._closed:
            return

        def deliver(reply: zenoh.Reply) -> None:
            sample = reply.ok
            if sample is None:
                return
            key, payload = str(sample.key_expr), sample.payload.to_bytes()
            with self._gate:
                if not self._closed:
                    handler(key, payload, None)

        with contextlib.suppress(self._error):
            self._session.get(
                key_expression,
                deliver,
                consolidation=self._every,
                congestion_control=self._drop,
                timeout=_ANSWER_S,
            )

    def wait_for_listener(self, key_expression: str, timeout_s: float) -> bool:
        """Wait until another session subscribes to any of these keys; False after timeout_s."""
        publisher = self._session.declare_publisher(
            key_expression, allowed_destination=self._remote
        )
        deadline = time.monotonic() + timeout_s
        try:
            while not publisher.matching_status.matching:  # type: ignore[attr-defined]
                if time.monotonic() >= deadline:
                    return False
                time.sleep(_LOOK_S)
        finally:
            publisher.undeclare()  # type: ignore[no-untyped-call]
        return True

    def declare_alive(self, key: str) -> None:
        """Make the key count as alive for others, also after a lost link is up again."""
        if not self._closed:
            self._tokens.append(self._session.liveliness().declare_token(key))

    def watch_alive(self, key_expression: str, handler: AliveHandler) -> None:
        """Call the handler, on one of Zenoh's threads, when a key appears or is gone.

        A key is gone 2 ms after its process was killed or its session closed, and about 1 s (the
        link's lease) after its process was stopped or its link fell silent.
        """
        if self._closed:
            return
        alive: set[str] = set()

        def deliver(sample: zenoh.Sample) -> None:
            key, appears = str(sample.key_expr), sample.kind == self._appears
            with self._gate:
                if self._closed or appears == (key in alive):
                    return  # Zenoh reports everything twice to a client
                alive.symmetric_difference_update([key])
                handler(key, appears)

        self._session.liveliness().declare_subscriber(key_expression, deliver, history=True)

    def watch_links(self, handler: LinkHandler) -> None:
        """Call the handler, on one of Zenoh's threads, when a client's link comes up or is lost."""

        def deliver(event: zenoh.LinkEvent) -> None:
            link = event.link
            name, address = link.auth_identifier or "", link.dst.partition("/")[2]
            with self._gate:
                if not self._closed:
                    handler(str(link.zid), name, address, event.kind == self._appears)

        self._links = self._session.info.declare_link_events_listener(deliver, history=True)

    def close(self) -> None:
        """End the session; when this returns, no handler runs or will run.

        Takes milliseconds, but up to 10 s if the other side hangs and the socket buffers are full.
        """
        with self._gate:
            self._closed = True
        # After 10 s Zenoh gives up on such a link with an error; the process can end all the same.
        with contextlib.suppress(self._error):
            self._session.close()  # type: ignore[no-untyped-call]


def router_settings(
    endpoint: str, keys: KeyFiles | None = None, access: dict[str, Any] | None = None
) -> dict[str, Any]:
    """Return the settings of a session that routes, by their paths; zenohd takes the same."""
    from protocol.access import access_control

    settings = {**_COMMON, **_ROUTER, "listen/endpoints": [endpoint]}
    if keys is not None:
        settings["transport/link/tls"] = _locked(keys, "listen")
        settings["access_control"] = access_control(()) if access is None else access
    return settings


def use_few_threads() -> None:
    """Make Zenoh use one receiving thread less; to be called before the first session opens.

    For a process that only listens: with a hundred robots it saves about a seventh of its CPU time.
    """
    os.environ.setdefault("ZENOH_RUNTIME", "(rx: (worker_threads: 1), acc: (worker_threads: 1))")


def _open(settings: dict[str, Any]) -> zenoh.Session:
    import zenoh

    config = zenoh.Config()
    for name, value in settings.items():
        config.insert_json5(name, json.dumps(value))
    return zenoh.open(config)


def _locked(keys: KeyFiles, side: str) -> dict[str, Any]:
    """Return the settings of mutual TLS, `side` being listen or connect."""
    return {
        "enable_mtls": True,
        "root_ca_certificate": str(keys.authority.absolute()),
        f"{side}_certificate": str(keys.certificate.absolute()),
        f"{side}_private_key": str(keys.private.absolute()),
        "verify_name_on_connect": True,
        "close_link_on_expiration": True,
    }


def _why_not_listening(reason: str) -> str:
    """Return the cause in Zenoh's message, without the names of source files."""
    if f"os error {errno.EADDRINUSE})" in reason:
        return "the port is in use; is another coordinator running?"
    cause = reason.split(" at /")[0].rsplit(": ", 1)[-1].strip("[]. ")
    return f"cannot listen there: {cause}"
