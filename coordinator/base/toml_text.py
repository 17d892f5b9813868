"""Parsing TOML, except dotted keys of so many parts that parsing would take minutes.

Decides: how many parts a dotted key may have, and that a key which is there twice is named.
Must not know: what a file is about.
"""

from __future__ import annotations

import re
import tomllib
from contextlib import suppress
from typing import Final

_MOST_PARTS: Final = 30
_MOST_LINES: Final = 50
"""In so many lines the beginning of a statement is looked for."""

_STRING: Final = r"""(?:"(?:[^"\\\n]|\\.)*+"|'[^'\n]*+')"""
_DOTTED: Final = rf"""(?:[\w-]++|{_STRING})[ \t]*+\.[ \t]*+"""
_TOKEN: Final = re.compile(
    rf"""
    \#[^\n]*+
    | \"\"\"(?:[^"\\]|\\[\s\S]|"(?!""))*+(?:\"\"\")?+
    | \'\'\'(?:[^']|'(?!''))*+(?:\'\'\')?+
    | (?<![\w-])(?P<deep>(?:{_DOTTED}){{{_MOST_PARTS}}})
    | (?<![\w-])(?:{_DOTTED})++
    | "(?:[^"\\\n]|\\.)*+"?+
    | '[^'\n]*+'?+
    """,
    re.VERBOSE,
)
"""The tokens that must be distinguished to find dotted keys: comments and strings, which may
contain anything (unterminated ones too, so that no text is scanned twice), and dotted words."""


def toml_of(text: str) -> dict[str, object]:
    """Parse TOML; raises TOMLDecodeError, also for dotted keys of too many parts.

    The error about a key that is there twice names the key.
    """
    for token in _TOKEN.finditer(text):
        if token["deep"]:
            line = text.count("\n", 0, token.start()) + 1
            raise tomllib.TOMLDecodeError(f"A key of over {_MOST_PARTS} parts (at line {line})")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        key, line = _key_there_twice(str(error), text)
        if not key:
            raise
        said = f"{key}: the key appears more than once in one table (at line {line})"
        raise tomllib.TOMLDecodeError(said) from None


def _key_there_twice(message: str, text: str) -> tuple[str, int]:
    """Return the key that an error of tomllib does not name, and its line; "" if it is another one.

    tomllib tells where the statement with the key ends.  It begins at the nearest line from which
    on the text can be parsed.
    """
    what, _, place = message.rpartition(" (at ")
    if what != "Cannot overwrite a value":
        return "", 0
    found = re.match(r"line (\d+), column (\d+)", place)
    lines = text.replace("\r\n", "\n").split("\n")
    if found is not None:
        lines = lines[: int(found[1])]
        lines[-1] = lines[-1][: int(found[2]) - 1]
    for line in range(len(lines), max(len(lines) - _MOST_LINES, 0), -1):
        statement = "\n".join(lines[line - 1 :])
        if header := re.fullmatch(r"\s*\[+\s*([^\[\]]+)", statement):
            return header[1].strip(), line
        with suppress(tomllib.TOMLDecodeError):
            if tomllib.loads(statement):
                return statement.partition("=")[0].strip(), line
    return "", 0
