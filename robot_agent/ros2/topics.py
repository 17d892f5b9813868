"""The keys on which the topics of ROS 2 are in Zenoh, and what goes with the bytes.

Decides: the forms of zenoh-bridge-ros2dds and of rmw_zenoh.  Must not know: what messages say.
"""

from __future__ import annotations

import os
import struct
import time
from dataclasses import dataclass, field
from typing import Final, Protocol

TWIST: Final = "geometry_msgs/Twist"
TWIST_STAMPED: Final = "geometry_msgs/TwistStamped"

_HASHES: Final = {
    TWIST: "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a",
    TWIST_STAMPED: "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
}
"""The hashes of the definitions of messages that are sent; `*` stands for those of others."""


class Topics(Protocol):
    """How the topics of a robot are named in Zenoh."""

    def key(self, topic: str, kind: str) -> str:
        """Return the key of a topic, of messages of a kind such as geometry_msgs/Twist."""

    def attachment(self) -> bytes | None:
        """Return what is attached to the next message that is sent."""


@dataclass(frozen=True)
class Bridge:
    """Topics as zenoh-bridge-ros2dds names them; `namespace` is the bridge's, as in "/bot1"."""

    namespace: str = ""

    def key(self, topic: str, _kind: str) -> str:
        """Return the topic's name, within the namespace, without the slash before it."""
        return "/".join(part for part in (self.namespace.strip("/"), topic.strip("/")) if part)

    def attachment(self) -> bytes | None:
        """Return nothing: the bridge attaches nothing either."""
        return None


@dataclass
class RmwZenoh:
    """Topics as rmw_zenoh names them, for a domain (ROS_DOMAIN_ID)."""

    domain: int = 0
    _gid: bytes = field(default_factory=lambda: os.urandom(16))
    _sequence: int = 0

    def key(self, topic: str, kind: str) -> str:
        """Return domain, topic, type and the hash of its definition, `*` for one not known."""
        package, _, name = kind.partition("/")
        return f"{self.domain}/{topic.strip('/')}/{package}::msg::dds_::{name}_/{_hash_of(kind)}"

    def attachment(self) -> bytes | None:
        """Return sequence number, time [ns since 1970] and the sender's id with its length."""
        self._sequence += 1
        return struct.pack("<qqB16s", self._sequence, time.time_ns(), 16, self._gid)


def _hash_of(kind: str) -> str:
    return _HASHES.get(kind, "*")
