"""Parsing TOML, except dotted keys of so many parts that parsing would take minutes.

Decides: how many parts a dotted key may have.  Must not know: what a file is about.
"""

from __future__ import annotations

import re
import tomllib
from typing import Final

_MOST_PARTS: Final = 30
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
    """Parse TOML; raises TOMLDecodeError, also for dotted keys of too many parts."""
    for token in _TOKEN.finditer(text):
        if token["deep"]:
            line = text.count("\n", 0, token.start()) + 1
            raise tomllib.TOMLDecodeError(f"A key of over {_MOST_PARTS} parts (at line {line})")
    return tomllib.loads(text)
