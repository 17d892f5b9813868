"""ROS map_server maps (YAML and an image) as polygons.

Decides: the meaning of a pixel, exactly as in the modes `trinary` and `scale` of map_server and
nav2_map_server, and that every cell that is not free blocks: unknown cells may be occupied.  Must
not know: how cells become polygons.  Formats: https://wiki.ros.org/map_server.
"""

from __future__ import annotations

import io
import math
import struct
import warnings
import zlib
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
import yaml
from numpy.typing import NDArray
from PIL import Image
from yaml.composer import ComposerError

from coordinator.scenario.checks import (
    COORDINATE,
    FARTHEST,
    HEADING,
    LEAST,
    TOO_FAR,
    Quantity,
    show,
)
from coordinator.scenario_files.maps.cells import MOST_CELLS, Cells, Grid, TooManyCornersError
from coordinator.scenario_files.maps.floor_map import (
    FloorMap,
    MapOptions,
    describe,
    fail,
    read_bytes,
)

MOST_YAML_BYTES: Final = 100_000
MOST_IMAGE_BYTES: Final = 256_000_000
IMAGE_KINDS: Final = ("PPM", "PNG", "BMP", "GIF", "JPEG")
MODES: Final = ("trinary", "scale")
REQUIRED: Final = ("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh")
THRESHOLD: Final = Quantity(from_least=True, most=1.0)
NUMBERS: Final = {
    "resolution": Quantity("m", least=LEAST, from_least=True),
    "occupied_thresh": THRESHOLD,
    "free_thresh": THRESHOLD,
}
Pixels = NDArray[np.uint8] | NDArray[np.uint16]

_BROKEN: Final = (
    OSError, SyntaxError, ValueError, LookupError, TypeError, AttributeError, ArithmeticError,
    MemoryError, struct.error, zlib.error, Image.DecompressionBombError,
    Image.DecompressionBombWarning,
)  # fmt: skip
"""What Pillow raises on damaged files and files that are not pictures."""


class _Settings(NamedTuple):
    """The contents of the YAML file: lengths [m], yaw [rad], thresholds of occupancy (0 to 1)."""

    image: str
    resolution: float
    origin: tuple[float, float, float]
    negate: bool
    occupied_thresh: float
    free_thresh: float
    mode: str


class _PlainLoader(yaml.SafeLoader):
    """Loads YAML but refuses aliases: a few nested ones can expand to a huge document."""

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        if self.check_event(yaml.AliasEvent):
            mark = self.peek_event().start_mark  # type: ignore[no-untyped-call]
            raise ComposerError(None, None, "a YAML alias, which a map must not contain", mark)
        return super().compose_node(parent, index)


def read_ros_map(path: Path, options: MapOptions) -> FloorMap:
    """Read a map's YAML file and image.

    Obstacles are enlarged by at most one cell unless the options say otherwise.

    Raises InputError with every problem, as `FILE: field: what is wrong`.
    """
    settings = _settings(path)
    image = path.parent / settings.image
    free = _free(_pixels(image), settings)
    rows, columns = free.shape
    grid = Grid(~free[::-1], settings.resolution, *settings.origin)
    if max(abs(value) for corner in grid.boundary() for value in corner) > FARTHEST:
        raise fail(path, [f"origin: the map reaches beyond {FARTHEST:g} m, {TOO_FAR}"])
    most = settings.resolution if options.map_error is None else options.map_error
    try:
        obstacles, growth = grid.obstacles(most)
    except TooManyCornersError as error:
        raise fail(image, [str(error)]) from None
    what = f"{columns} x {rows} cells of {settings.resolution:g} m"
    return FloorMap(grid.boundary(), obstacles, describe(path, what, obstacles, growth))


def _settings(path: Path) -> _Settings:
    document = _load(path)
    if not isinstance(document, dict):
        raise fail(path, [f"{show(document)} is not a table of image, resolution, origin, ..."])
    problems = [f"{key}: is missing" for key in REQUIRED if key not in document]
    values: dict[str, float] = {}
    for key in [key for key in NUMBERS if key in document]:
        values[key] = _number(document[key], key, NUMBERS[key], problems)
    origin = _origin(document.get("origin"), problems) if "origin" in document else (0.0, 0.0, 0.0)
    image, negate = document.get("image", "-"), document.get("negate", 0)
    if not isinstance(image, str) or not image:
        problems.append(f"image: {show(image)} is not the name of a file")
    if not isinstance(negate, int) or negate not in (0, 1):
        problems.append(f"negate: {show(negate)} is not 0 or 1")
    mode = document.get("mode", "trinary")
    if mode not in MODES:
        problems.append(f"mode: {show(mode)} is not one of {', '.join(MODES)}")
    low, high = values.get("free_thresh", 0.0), values.get("occupied_thresh", 1.0)
    if low > high:
        problems.append(f"free_thresh: {low:g} is above occupied_thresh {high:g}")
    if problems:
        raise fail(path, problems)
    resolution, occupied, free = (values[key] for key in NUMBERS)
    return _Settings(str(image), resolution, origin, bool(negate), occupied, free, str(mode))


def _load(path: Path) -> object:
    """Return the YAML document; errors name the line."""
    text = read_bytes(path, MOST_YAML_BYTES)
    try:
        document: object = yaml.load(text, _PlainLoader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = "" if mark is None else f"line {mark.line + 1}: "
        problem = f"{line}{error.problem or error.context}"
    except yaml.YAMLError:
        problem = "is not text"
    except RecursionError:
        problem = "lists or tables are nested too deeply"
    except ValueError as error:
        problem = str(error)
    else:
        return document
    raise fail(path, [problem if problem.isprintable() else repr(problem)])


def _number(value: object, where: str, quantity: Quantity, problems: list[str]) -> float:
    """Return a number, or NaN if invalid; YAML 1.1 reads 1e-3, without a point, as text."""
    try:
        number: object = float(value) if isinstance(value, str) else value
    except ValueError:
        number = value
    complaint = quantity.complaint(number)
    if complaint is None and isinstance(number, int | float):
        return float(number)
    problems.append(f"{where}: {complaint}")
    return math.nan


def _origin(value: object, problems: list[str]) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        problems.append(f"origin: {show(value)} is not [x, y, yaw]")
        return 0.0, 0.0, 0.0
    x, y, yaw = (
        _number(number, f"origin[{i}]", HEADING if i == 2 else COORDINATE, problems)
        for i, number in enumerate(value)
    )
    return x, y, yaw


def _pixels(path: Path) -> Pixels:
    """Return the picture (rows, columns, channels): grey, colours, or colours and alpha."""
    content = read_bytes(path, MOST_IMAGE_BYTES)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", Image.DecompressionBombWarning)
            warnings.simplefilter("ignore", UserWarning)
            image = Image.open(io.BytesIO(content), formats=IMAGE_KINDS)
            columns, rows = image.size
            if columns * rows > MOST_CELLS:
                raise fail(path, [f"{columns} x {rows} cells are more than {MOST_CELLS}"])
            image.load()
            if image.mode.startswith("I"):
                deep: Pixels = np.clip(np.asarray(image), 0, 65535).astype(np.uint16)
                return deep[:, :, None]
            if image.mode == "F":
                raise fail(
                    path, ["is a picture of floating point numbers; only 8 and 16 bits are read"]
                )
            if image.has_transparency_data:
                return np.asarray(image.convert("RGBA"))
            grey = image.mode in ("1", "L")
            return np.atleast_3d(np.asarray(image.convert("L" if grey else "RGB")))
    except _BROKEN as error:
        known = f"is not a whole picture of a known kind ({', '.join(IMAGE_KINDS)})"
        cut = "truncated" in str(error)
        raise fail(path, ["is truncated, the picture ends early" if cut else known]) from None


def _free(pixels: Pixels, settings: _Settings) -> Cells:
    """Return which pixels (rows, columns) are free; the others are occupied or unknown.

    Trinary averages over all channels, alpha included; in scale mode a pixel that is not opaque is
    unknown, and one between the thresholds is partly occupied.
    """
    depth = 255 if pixels.dtype == np.uint8 else 65535
    transparent = pixels.shape[2] == 4 and settings.mode == "scale"
    colours = pixels[:, :, :3] if transparent else pixels
    channels = colours.shape[2]
    shades = colours.sum(axis=2, dtype=np.uint16) if channels > 1 else colours[:, :, 0]
    average = np.arange(channels * depth + 1) / channels * (255 / depth)
    occupied = (average if settings.negate else 255.0 - average) / 255.0
    free = (occupied < settings.free_thresh) & ~(occupied > settings.occupied_thresh)
    cells: Cells = free[shades]
    return cells & (pixels[:, :, 3] == 255) if transparent else cells
