"""TOML read, but for keys so deep that reading them takes minutes.

Decides: how deep a dotted key may be.  Must not know: what a file is about.
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
"""What has to be known apart to see a key: comments and strings, which may hold anything (also
broken ones, so that nothing is looked at twice), and words joined by dots."""


def toml_of(text: str) -> dict[str, object]:
    """Parse TOML; raises TOMLDecodeError, also for dotted keys so deep that they take minutes."""
    for token in _TOKEN.finditer(text):
        if token["deep"]:
            line = text.count("\n", 0, token.start()) + 1
            raise tomllib.TOMLDecodeError(f"A key of over {_MOST_PARTS} parts (at line {line})")
    return tomllib.loads(text)
