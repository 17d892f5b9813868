"""The contents of a log, as data.

Decides: the fields.  Must not know: the file format.
"""

from __future__ import annotations

from typing import Final

import msgspec

NOT_CLOSED: Final = "not closed"
"""What `Log.recovered` says of a log that ended early and was not damaged."""


class Record(msgspec.Struct, frozen=True):
    """A recorded message.

    `log_ns` is the time of the record on the coordinator's clock, `publish_ns` the sender's time
    stamp [ns since 1970], `offset` the byte in the file at which the message's chunk begins.
    """

    key: str
    payload: bytes
    log_ns: int
    publish_ns: int
    offset: int


class Log(msgspec.Struct, frozen=True):
    """The contents of a log; the records are in the order in which they were recorded.

    `complete` is whether the file was closed.  `damage` says where the file's bytes differ from
    what was written; it is empty if the file is intact.  `before` has the logs that it resumes, the
    oldest first, if they are in the same folder.  `recovered` says what a recovered log was like
    before, "not closed" or its damage; it is empty for other logs.  `left_out` names the files of a
    folder that are not part of the log.
    """

    metadata: dict[str, str]
    attachments: dict[str, bytes]
    records: list[Record]
    complete: bool
    damage: str
    before: tuple[Log, ...] = ()
    recovered: str = ""
    left_out: tuple[str, ...] = ()

    @property
    def is_recording(self) -> bool:
        """Whether a listener wrote it, not the fleet's coordinator."""
        return self.metadata.get("passive") == "yes"

    @property
    def loss(self) -> str:
        """Why messages may be missing amid the log; empty if none are."""
        is_whole = not self.damage and self.recovered in ("", NOT_CLOSED)
        return "" if is_whole else "; ".join(self.flaws)

    @property
    def flaws(self) -> list[str]:
        """What has befallen the log's bytes: damage, and what it was recovered from."""
        recovery = self.recovered and f"recovered (before: {self.recovered})"
        return [flaw for flaw in (self.damage, recovery) if flaw]

    @property
    def remarks(self) -> list[str]:
        """What whoever relies on the log has to know about its files."""
        left_out = [f"not part of the log: {', '.join(self.left_out)}"] if self.left_out else []
        return [*self.flaws, *left_out]
