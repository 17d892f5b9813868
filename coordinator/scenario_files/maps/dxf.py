"""DXF drawings as polygons: every closed outline of a layer is a solid obstacle.

Decides: units, layers, which entities are joined to an outline, and that approximating curves
enlarges obstacles and shrinks the floor.  Must not know: how an entity is approximated
(dxf_entities.py).  Needs the optional package ezdxf.
"""

from __future__ import annotations

import difflib
import logging
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import shapely
from ezdxf.entities.dxfentity import DXFEntity
from ezdxf.filemanagement import readfile
from ezdxf.lldxf.const import DXFError
from shapely.geometry.polygon import orient

from coordinator.scenario.checks import FARTHEST, TOO_FAR, printable, show
from coordinator.scenario.model import Point
from coordinator.scenario_files.maps.curve_hulls import CurveError, Hulls
from coordinator.scenario_files.maps.dxf_entities import (
    OUTLINE_NAMES,
    OUTLINES,
    REMARKS,
    hulls_of,
    layer_of,
    name_of,
)
from coordinator.scenario_files.maps.floor_map import (
    FloorMap,
    MapOptions,
    check_file,
    describe,
    fail,
)
from coordinator.scenario_files.maps.rings import Part, join, polygon_of

MOST_BYTES: Final = 64_000_000
MOST_FAULTS: Final = 50
"""At most this many faulty entities are listed one by one."""
UNITS: Final = {
    0: ("no unit, taken as metres", 1.0), 1: ("inches", 0.0254), 2: ("feet", 0.3048),
    4: ("mm", 1e-3), 5: ("cm", 1e-2), 6: ("m", 1.0), 14: ("dm", 0.1),
}  # fmt: skip
"""The values of $INSUNITS, each with the unit's name and its length in metres."""
TOLERANCE: Final = 0.005
"""Outlines deviate from curves by at most this [m] unless the scenario says otherwise."""
FINEST: Final = 1e-5
"""The least tolerance [m] that a scenario may ask for."""

_BROKEN: Final = (
    OSError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError, AssertionError,
    RuntimeError, StopIteration, MemoryError, EOFError, struct.error,
)  # fmt: skip
"""What ezdxf raises, besides its own errors, on damaged files and files that are not drawings."""


def read_dxf_map(path: Path, options: MapOptions) -> FloorMap:
    """Read one layer of a drawing, or all layers if the options name none.

    If the options name no boundary layer, the bounding box of the obstacles is the floor.
    Raises InputError with every problem, as `FILE: entity and layer: what is wrong`.
    """
    tolerance = TOLERANCE if options.map_error is None else options.map_error
    if tolerance < FINEST:
        raise fail(path, [f"workspace.map_error: curves need at least {FINEST:g} m"])
    code, entities = _load(path)
    unit, metres = _unit(path, code)
    wanted = _wanted(path, entities, options)
    problems: list[str] = []
    solid_parts: list[Part] = []
    floor_parts: list[Part] = []
    for entity in entities:
        layer = layer_of(entity).casefold()
        if entity.dxftype() not in REMARKS and layer in wanted:
            part = _part(entity, metres, tolerance, problems)
            if part is not None:
                is_floor = layer == options.boundary_layer.casefold()
                (floor_parts if is_floor else solid_parts).append(part)
    solids = _polygons(solid_parts, tolerance, problems, grow=True)
    floors = _polygons(floor_parts, tolerance, problems, grow=False)
    problems = problems or _faults(solids, floors, options)
    if problems:
        more = [f"and {len(problems) - MOST_FAULTS} more"] if len(problems) > MOST_FAULTS else []
        raise fail(path, problems[:MOST_FAULTS] + more)
    floor = floors[0] if floors else shapely.box(*shapely.total_bounds(solids))
    obstacles = tuple(map(_corners, solids))
    curved = any(len(hull) > 2 for part in solid_parts for hull in part.hulls)
    note = describe(path, f"drawn in {unit}", obstacles, tolerance if curved else 0.0)
    return FloorMap(_corners(floor), obstacles, note)


def _polygons(
    parts: Sequence[Part], tolerance: float, problems: list[str], *, grow: bool
) -> list[shapely.Polygon]:
    found = [polygon_of(o, tolerance, problems, grow=grow) for o in join(parts, problems)]
    return [polygon for polygon in found if polygon is not None]


def _faults(
    solids: Sequence[shapely.Polygon], floors: Sequence[shapely.Polygon], options: MapOptions
) -> list[str]:
    """Return what is wrong with all outlines together; each by itself is valid."""
    if options.boundary_layer and len(floors) != 1:
        return [
            f"layer {options.boundary_layer}: {len(floors)} closed outlines, but a floor has one"
        ]
    if not solids and not floors:
        return ["encloses nothing: there is no closed outline on the layers that are read"]
    return []


def _load(path: Path) -> tuple[object, list[DXFEntity]]:
    """Return $INSUNITS and all that is drawn in model space."""
    check_file(path, MOST_BYTES)
    logging.getLogger("ezdxf").addHandler(logging.NullHandler())
    try:
        drawing = readfile(path)
        return drawing.header.get("$INSUNITS", 0), list(drawing.modelspace())
    except DXFError as error:
        problem = f"is not a complete DXF file: {printable(str(error))}"
    except _BROKEN:
        problem = "is not a complete DXF file"
    raise fail(path, [problem])


def _unit(path: Path, code: object) -> tuple[str, float]:
    if not isinstance(code, int) or code not in UNITS:
        known = ", ".join(f"{code} {name}" for code, (name, _) in UNITS.items())
        raise fail(path, [f"$INSUNITS: {show(code)} is not one of {known}"])
    return UNITS[code]


def _wanted(path: Path, entities: Sequence[DXFEntity], options: MapOptions) -> set[str]:
    """Return the layers to read, in lower case."""
    layers = sorted({layer_of(entity) for entity in entities})
    known = {layer.casefold() for layer in layers}
    problems = []
    for key in ("layer", "boundary_layer"):
        name = getattr(options, key)
        if name and name.casefold() not in known:
            nearest = difflib.get_close_matches(name[:60], layers, n=3, cutoff=0.0)
            hint = (
                f"the nearest are {', '.join(map(show, nearest))}"
                if nearest
                else "the drawing is empty"
            )
            problems.append(f"workspace.{key}: nothing is drawn on layer {show(name)}, {hint}")
    if options.layer and options.layer.casefold() == options.boundary_layer.casefold():
        problems.append("workspace.boundary_layer: is the layer of the obstacles as well")
    if problems:
        raise fail(path, problems)
    chosen = {options.layer.casefold()} if options.layer else known
    return chosen | {options.boundary_layer.casefold()}


def _part(entity: DXFEntity, metres: float, tolerance: float, problems: list[str]) -> Part | None:
    """Return an entity with its hulls [m], or note why it has none."""
    if not isinstance(entity, OUTLINES):
        problems.append(f"{name_of(entity)}: is not read; outlines are made of {OUTLINE_NAMES}")
        return None

    def follow(finer: float) -> Hulls:
        with np.errstate(all="ignore"):
            hulls = [hull * metres for hull in hulls_of(entity, finer / metres)]
        reach = np.abs(np.concatenate(hulls)).max()
        if not reach <= FARTHEST:
            raise CurveError(f"reaches {reach:g} m, beyond {FARTHEST:g} m, {TOO_FAR}")
        return hulls

    try:
        return Part(name_of(entity), follow, follow(tolerance))
    except CurveError as error:
        problems.append(f"{name_of(entity)}: {error}")
    except _BROKEN:
        problems.append(f"{name_of(entity)}: is damaged")
    return None


def _corners(polygon: shapely.Polygon) -> tuple[Point, ...]:
    return tuple((x, y) for x, y in orient(polygon).exterior.coords[:-1])
