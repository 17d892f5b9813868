"""Robots' black boxes as attachments of a log, where they were made beside it.

Decides: their names and that they are packed, a tenth of their size.  Must not know: their columns.
"""

from __future__ import annotations

import gzip
import zlib
from collections.abc import Mapping
from typing import Final

from coordinator.base.errors import InputError
from coordinator.log.recorder import Attachment

_FOLDER: Final = "blackbox/"
_ENDING: Final = ".csv.gz"
_GZIP: Final = 16 + zlib.MAX_WBITS

_MOST: Final = 16 * 2**20
_MOST_RATIO: Final = 50
"""A black box may unpack to so many bytes, and to so many times its length beyond."""


def packed(robot: str, text: bytes) -> Attachment:
    """Return a robot's black box, CSV, as an attachment."""
    data = gzip.compress(text, mtime=0)
    return Attachment(f"{_FOLDER}{robot}{_ENDING}", "application/gzip", data)


def unpacked(attachments: Mapping[str, bytes]) -> dict[str, str]:
    """Return the black boxes of a log's attachments by robot, as text.

    Raises InputError naming an attachment that is none.
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
    """Unpack a file; ValueError when it is cut short, or would be longer than a black box is."""
    most = _MOST + _MOST_RATIO * len(data)
    unpacker = zlib.decompressobj(_GZIP)
    text = unpacker.decompress(data, most + 1)
    if len(text) > most:
        raise ValueError(f"it is longer than {most} bytes")
    if not unpacker.eof:
        raise ValueError("it ends early")
    return text
