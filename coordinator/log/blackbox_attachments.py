"""Robots' black boxes as attachments of the log of the same run.

Decides: the attachments' names, and that they are compressed, to about a tenth of their size.  Must
not know: the columns of a black box.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Mapping
from typing import Final

from coordinator.base.errors import InputError
from coordinator.log.log_writer import Attachment

_FOLDER: Final = "blackbox/"
_ENDING: Final = ".csv.gz"
_GZIP: Final = 16 + zlib.MAX_WBITS

_MOST: Final = 16 * 2**20
_MOST_RATIO: Final = 50
"""A black box may unpack to _MOST bytes plus _MOST_RATIO times its compressed length."""


def packed(robot: str, text: bytes) -> Attachment:
    """Return a robot's black box, a CSV text, as an attachment."""
    data = gzip.compress(text, mtime=0)
    return Attachment(f"{_FOLDER}{robot}{_ENDING}", "application/gzip", data)


def unpacked(attachments: Mapping[str, bytes]) -> dict[str, str]:
    """Return the black boxes among a log's attachments by robot, as text.

    Raises InputError, which names the attachment, if one is not a black box.
    """
    found = {}
    for name, data in attachments.items():
        if name.startswith(_FOLDER) and name.endswith(_ENDING):
            robot = name.removeprefix(_FOLDER).removesuffix(_ENDING)
            try:
                found[robot] = _unpacked(data).decode("ascii")
            except (ValueError, zlib.error) as error:
                raise InputError([f"attachment {name}: cannot be unpacked: {error}"]) from None
    return found


def _unpacked(data: bytes) -> bytes:
    """Decompress a file; raise ValueError if it is cut short or would become too long."""
    most = _MOST + _MOST_RATIO * len(data)
    unpacker = zlib.decompressobj(_GZIP)
    text = unpacker.decompress(data, most + 1)
    if len(text) > most:
        raise ValueError(f"it is longer than {most} bytes")
    if not unpacker.eof:
        raise ValueError("it ends early")
    return text
