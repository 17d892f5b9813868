"""Makes one self-contained page from a scene and the files of page_files/.

Decides: the order of the parts, and that the page requests nothing from elsewhere.  Must not know:
how the page looks (page_files/page.css) or what it does (page_files/*.js).
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Final

import msgspec

from coordinator.view.scene import Scene

_PARTS: Final = Path(__file__).with_name("page_files")
_SCRIPTS: Final = (
    "motion.js",
    "play.js",
    "look.js",
    "lens.js",
    "ground.js",
    "floor.js",
    "diagram.js",
    "lists.js",
    "orders.js",
    "hand.js",
    "outlook.js",
    "flow.js",
    "asking.js",
    "alarms.js",
    "closed_places.js",
    "fleet_state.js",
    "desk.js",
    "word.js",
    "keys.js",
    "page.js",
    "frames.js",
    "outside.js",
)
_COMMENTS: Final = re.compile(r"^[ \t]*(?://[^\n]*|/\*.*?\*/[ \t]*)\n", re.MULTILINE | re.DOTALL)
_INDENT: Final = re.compile(r"^[ \t]+", re.MULTILINE)
_STYLE_SPACE: Final = re.compile(r"(?<=[:;,{]) ")
_POLICY: Final = (
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; "
    "connect-src {connect}"
)


def page_of(scene: Scene, live: bool = False, *, may_command: bool = False) -> str:
    """Return the page as HTML; a live one follows the events of the server that it comes from.

    `may_command`: whether a live page has what an operator commands the fleet with.
    """
    parts = {
        "title": html.escape(scene.name),
        "policy": _POLICY.format(connect="'self'" if live else "'none'"),
        "live": "true" if live else "false",
        "command": "true" if live and may_command else "false",
        "style": _STYLE_SPACE.sub("", _part("page.css")),
        "scene": scene_json(scene).replace("<", "\\u003c"),
        "script": "\n".join(_part(name) for name in _SCRIPTS),
    }
    pieces = []
    for piece in _part("index.html").split("{{"):
        name, mark, rest = piece.partition("}}")
        pieces.append(parts[name] + rest if mark else piece)
    return "".join(pieces)


def scene_json(scene: Scene) -> str:
    """Return a scene as the JSON that the page reads."""
    return msgspec.json.encode(scene).decode()


def _part(name: str) -> str:
    """Return a part without its indentation and without comments that have lines of their own."""
    return _INDENT.sub("", _COMMENTS.sub("", (_PARTS / name).read_text(encoding="utf-8")))
