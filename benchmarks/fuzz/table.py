"""The names of the fuzz targets and the modules that they are in; imports none of these."""

from __future__ import annotations

from typing import Final

MODULES: Final = {
    "codec": "wire",
    "fleet": "wire",
    "robot": "wire",
    "scenario-toml": "files",
    "scenario-json": "files",
    "plan": "files",
    "vda5050": "files",
    "ros-yaml": "maps",
    "ros-image": "maps",
    "movingai": "maps",
    "dxf": "maps",
    "log-bytes": "logs",
    "log-words": "logs",
}
