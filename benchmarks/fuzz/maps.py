"""Fuzz targets for maps: ROS map_server, MovingAI, DXF."""

from __future__ import annotations

import io
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np
from PIL import Image

from benchmarks.fuzz.target import Target, answered, workshop
from benchmarks.table import ROOT
from coordinator.scenario_files.maps.floor_map import MapOptions
from coordinator.scenario_files.maps.map_reader import DEFAULTS, read_map

_MAPS: Final = ROOT / "examples" / "maps"
_YAML: Final = (
    "image: {name}\nresolution: 0.05\norigin: [-1.0, 2.0, 0.1]\nnegate: 0\n"
    "occupied_thresh: 0.65\nfree_thresh: 0.196\nmode: {mode}\n"
)


@cache
def _folder() -> Path:
    """Return a folder with the files to which the targets' maps refer."""
    folder = workshop()
    (folder / "small.png").write_bytes(_picture("PNG", "L"))
    (folder / "picture.yaml").write_text(_YAML.format(name="picture", mode="scale"))
    return folder


def _read(data: bytes, name: str, options: MapOptions = DEFAULTS) -> None:
    file = _folder() / name
    file.write_bytes(data)
    floor = read_map(file, options)
    assert len(floor.boundary) >= 3, "the floor has no corners"


@answered
def ros_yaml(data: bytes) -> None:
    """Read the YAML of a ROS map whose image is sound."""
    _read(data, "fuzzed.yaml")


@answered
def ros_image(data: bytes) -> None:
    """Read the image of a ROS map whose YAML is sound."""
    (_folder() / "picture").write_bytes(data)
    read_map(_folder() / "picture.yaml")


@answered
def movingai(data: bytes) -> None:
    """Read a MovingAI map."""
    _read(data, "fuzzed.map")


@answered
def dxf(data: bytes) -> None:
    """Read a drawing."""
    _read(data, "fuzzed.dxf")


def _picture(kind: str, mode: str) -> bytes:
    cells = np.random.default_rng(1).integers(0, 2, (12, 10)).astype(np.uint8) * 255
    stream = io.BytesIO()
    Image.fromarray(cells).convert(mode).save(stream, kind)
    return stream.getvalue()


def _yaml_seeds() -> Iterator[bytes]:
    yield (_MAPS / "lab.yaml").read_bytes()
    for mode in ("trinary", "scale"):
        yield _YAML.format(name="small.png", mode=mode).encode()


def _image_seeds() -> Iterator[bytes]:
    for kind in ("PNG", "PPM", "BMP", "GIF", "JPEG"):
        yield _picture(kind, "L")
    for mode in ("1", "P", "RGB", "RGBA", "LA", "I;16"):
        yield _picture("PNG", mode)
    yield b"P2\n3 2\n255\n0 255 0\n255 0 255\n"


def _drawings() -> Iterator[bytes]:
    """Yield the smallest drawings with one entity of each kind."""
    entities = (
        "LINE\n8\nW\n10\n0\n20\n0\n11\n1\n21\n0",
        "CIRCLE\n8\nW\n10\n2\n20\n2\n40\n1",
        "ARC\n8\nW\n10\n2\n20\n2\n40\n1\n50\n0\n51\n90",
        "ELLIPSE\n8\nW\n10\n2\n20\n2\n11\n1\n21\n0\n40\n0.5\n41\n0\n42\n6.283185307179586",
        "LWPOLYLINE\n8\nW\n90\n3\n70\n1\n10\n0\n20\n0\n42\n0.5\n10\n2\n20\n0\n10\n1\n20\n2",
        "POLYLINE\n8\nW\n66\n1\n70\n1\n0\nVERTEX\n8\nW\n10\n0\n20\n0\n0\nVERTEX\n8\nW\n10\n2\n20\n0"
        "\n0\nVERTEX\n8\nW\n10\n1\n20\n2\n0\nSEQEND\n8\nW",
        "SPLINE\n8\nW\n70\n8\n71\n2\n72\n6\n73\n3\n74\n0\n40\n0\n40\n0\n40\n0\n40\n1\n40\n1\n40\n1"
        "\n10\n0\n20\n0\n10\n1\n20\n2\n10\n2\n20\n0",
    )
    for entity in entities:
        text = f"0\nSECTION\n2\nENTITIES\n0\n{entity}\n0\nENDSEC\n0\nEOF\n"
        yield text.encode()


TARGETS: Final = {
    "ros-yaml": Target(ros_yaml, _yaml_seeds, 4_096),
    "ros-image": Target(ros_image, _image_seeds, 4_096),
    "movingai": Target(movingai, lambda: [(_MAPS / "yard.map").read_bytes()], 4_096),
    "dxf": Target(dxf, lambda: [(_MAPS / "hall.dxf").read_bytes(), *_drawings()], 32_768),
}
