"""The reason why a link with keys cannot be opened, which Zenoh writes only to its log.

Decides: which sentence a person reads.  It repeats the handshake with Python's own TLS.
"""

from __future__ import annotations

import socket
import ssl
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from protocol.endpoint import Endpoint
    from protocol.key_files import KeyFiles

_PATIENCE_S: Final = 3.0
"""A program that is silent for this long hangs: one that routes without TLS closes the connection
to an unknown client sooner (after 2 s, zenoh_transport.py)."""

_NO_TLS: Final = "the program that answers does not speak TLS; was it started with --keys?"

_REASONS: Final = (
    ("ALERT_UNKNOWN_CA", "it refuses these keys, they are of another authority"),
    ("ALERT_CERTIFICATE_EXPIRED", "it refuses these keys, they have expired"),
    ("ALERT_BAD_CERTIFICATE", "it refuses these keys, they are damaged"),
    ("ALERT", "it refuses these keys"),
    ("CERTIFICATE_VERIFY_FAILED", "the program that answers is not trusted"),
    ("WRONG_VERSION_NUMBER", _NO_TLS),
    ("UNEXPECTED_EOF", _NO_TLS),
)


def why_no_link(endpoint: Endpoint, keys: KeyFiles) -> str:
    """Return why the link cannot be opened; empty when no reason is found or the peer hangs."""
    try:
        plain = socket.create_connection((endpoint.host, endpoint.port), _PATIENCE_S)
    except OSError:
        return ""
    with plain:
        return _shake_hands(plain, endpoint.host, keys)


def _shake_hands(plain: socket.socket, host: str, keys: KeyFiles) -> str:
    """Return why TLS fails over a connection, or an empty text.

    With TLS 1.3 the other side's verdict arrives only after the handshake, so one byte is awaited.
    """
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    shaken = False
    try:
        context.load_verify_locations(keys.authority)
        context.load_cert_chain(keys.certificate, keys.private)
        with context.wrap_socket(plain, server_hostname=host) as link:
            shaken = True
            link.recv(1)
    except ssl.SSLCertVerificationError as error:
        return f"{_reason(error)}: {error.verify_message}"
    except ssl.SSLError as error:
        return _reason(error)
    except TimeoutError:
        return ""
    except OSError:
        return "" if shaken else _NO_TLS
    return ""


def _reason(error: ssl.SSLError) -> str:
    name = error.reason or ""
    known = (text for part, text in _REASONS if part in name)
    return next(known, f"no TLS link: {name.replace('_', ' ').lower()}")
