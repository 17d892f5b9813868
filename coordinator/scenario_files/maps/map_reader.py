"""Reading a map file of any known kind as polygons.

Decides: which reader reads which suffix, and which options it accepts.  Must not know: the
formats.  The libraries that a reader needs are imported only when a map of its kind is read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from coordinator.scenario_files.maps.floor_map import FloorMap, MapOptions, fail

DEFAULTS: Final = MapOptions()
FITTING: Final = {
    ".yaml": ("map_error",),
    ".yml": ("map_error",),
    ".map": ("cell", "map_error"),
    ".dxf": ("layer", "boundary_layer", "map_error"),
}
"""The options of the workspace table that each kind of map accepts."""


def read_map(path: Path, options: MapOptions = DEFAULTS) -> FloorMap:
    """Read a map; raises InputError with every problem, as `FILE: position: what is wrong`."""
    kind = path.suffix.lower()
    if kind not in FITTING:
        known = ".yaml (ROS map_server), .map (MovingAI), .dxf"
        raise fail(path, [f"{kind or 'no suffix'} is not a known kind of map, which are {known}"])
    given = [name for name, value in options._asdict().items() if value not in ("", None)]
    unfit = [name for name in given if name not in FITTING[kind]]
    if unfit:
        raise fail(path, [f"workspace.{name} is not for maps of kind {kind}" for name in unfit])
    if kind == ".map":
        from coordinator.scenario_files.maps.movingai import read_movingai_map

        return read_movingai_map(path, options)
    if kind == ".dxf":
        try:
            from coordinator.scenario_files.maps.dxf import read_dxf_map
        except ImportError:
            need = "reading .dxf needs the package ezdxf: pip install ezdxf"
            raise fail(path, [need]) from None
        return read_dxf_map(path, options)
    from coordinator.scenario_files.maps.ros import read_ros_map

    return read_ros_map(path, options)
