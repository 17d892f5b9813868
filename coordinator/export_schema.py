"""The messages of Foxglove's well-known schemas, and those schemas as JSON.

Decides: which fields there are, exactly as foxglove-sdk 0.30 has them (the golden file of the tests
is made from what that package ships).  Must not know: what is drawn.

Lichtblick and Foxglove know these messages by their names; every field is written, used or not,
for their panels read all of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Final

import msgspec

LINE_STRIP: Final = 0
LINE_LOOP: Final = 1
LINE_LIST: Final = 2

INFO: Final = 2
WARNING: Final = 3
ERROR: Final = 4

MATCHING_ID: Final = 0

_Unsigned = Annotated[int, msgspec.Meta(ge=0)]
_Below = Annotated[int, msgspec.Meta(ge=0, le=999_999_999)]


class Time(msgspec.Struct, frozen=True):
    """Since 1970."""

    sec: _Unsigned
    nsec: _Below

    @classmethod
    def of(cls, time_ns: int) -> Time:
        """Return a time given in ns."""
        return cls(*divmod(time_ns, 1_000_000_000))


class Duration(msgspec.Struct, frozen=True):
    """A span of time; zero means for ever."""

    sec: int = 0
    nsec: _Below = 0


class Color(msgspec.Struct, frozen=True):
    """Red, green, blue and opacity, each from 0 to 1."""

    r: float
    g: float
    b: float
    a: float = 1.0


class Vector3(msgspec.Struct, frozen=True):
    """Three lengths [m]."""

    x: float
    y: float
    z: float = 0.0


class Point3(msgspec.Struct, frozen=True):
    """A place [m]."""

    x: float
    y: float
    z: float = 0.0


class Quaternion(msgspec.Struct, frozen=True):
    """A rotation."""

    x: float = 0.0
    y: float = 0.0
    z: float = 0.0
    w: float = 1.0


class Pose(msgspec.Struct, frozen=True):
    """A place and a rotation."""

    position: Vector3 = Vector3(0.0, 0.0)
    orientation: Quaternion = Quaternion()


class KeyValuePair(msgspec.Struct, frozen=True):
    """A fact about an entity."""

    key: str
    value: str


class ArrowPrimitive(msgspec.Struct, frozen=True):
    """An arrow along +x of its pose; lengths in metres."""

    pose: Pose
    shaft_length: float
    shaft_diameter: float
    head_length: float
    head_diameter: float
    color: Color


class CubePrimitive(msgspec.Struct, frozen=True):
    """A box around its pose."""

    pose: Pose
    size: Vector3
    color: Color


class SpherePrimitive(msgspec.Struct, frozen=True):
    """An ellipsoid around its pose."""

    pose: Pose
    size: Vector3
    color: Color


class CylinderPrimitive(msgspec.Struct, frozen=True):
    """A cylinder along z around its pose, its ends scaled by the two numbers."""

    pose: Pose
    size: Vector3
    color: Color
    bottom_scale: float = 1.0
    top_scale: float = 1.0


class LinePrimitive(msgspec.Struct, frozen=True, kw_only=True):
    """Straight lines, `thickness` in metres unless scale_invariant (pixels)."""

    type: Annotated[int, msgspec.Meta(ge=LINE_STRIP, le=LINE_LIST)]
    pose: Pose = Pose()
    thickness: float
    scale_invariant: bool = False
    points: list[Point3]
    color: Color
    colors: list[Color] = []
    indices: list[_Unsigned] = []


class TriangleListPrimitive(msgspec.Struct, frozen=True, kw_only=True):
    """Triangles of three points each, through `indices` where there are any."""

    pose: Pose = Pose()
    points: list[Point3]
    color: Color
    colors: list[Color] = []
    indices: list[_Unsigned] = []


class TextPrimitive(msgspec.Struct, frozen=True, kw_only=True):
    """A label, its size in metres unless scale_invariant (pixels)."""

    pose: Pose
    billboard: bool = True
    font_size: float
    scale_invariant: bool = False
    color: Color
    text: str


class ModelPrimitive(msgspec.Struct, frozen=True, kw_only=True):
    """A mesh from a file."""

    pose: Pose
    scale: Vector3
    color: Color
    override_color: bool
    url: str
    media_type: str
    data: bytes


class SceneEntity(msgspec.Struct, frozen=True, kw_only=True):
    """Primitives in a frame; replaces an earlier entity of the same topic and id."""

    timestamp: Time
    frame_id: str
    id: str
    lifetime: Duration = Duration()
    frame_locked: bool = True
    metadata: list[KeyValuePair] = []
    arrows: list[ArrowPrimitive] = []
    cubes: list[CubePrimitive] = []
    spheres: list[SpherePrimitive] = []
    cylinders: list[CylinderPrimitive] = []
    lines: list[LinePrimitive] = []
    triangles: list[TriangleListPrimitive] = []
    texts: list[TextPrimitive] = []
    models: list[ModelPrimitive] = []


class SceneEntityDeletion(msgspec.Struct, frozen=True):
    """Removes the entity of that id, or all (type 1)."""

    timestamp: Time
    type: Annotated[int, msgspec.Meta(ge=0, le=1)]
    id: str


class SceneUpdate(msgspec.Struct, frozen=True, kw_only=True):
    """What appears and what goes."""

    deletions: list[SceneEntityDeletion] = []
    entities: list[SceneEntity]


class FrameTransform(msgspec.Struct, frozen=True):
    """Where a frame is in another."""

    timestamp: Time
    parent_frame_id: str
    child_frame_id: str
    translation: Vector3
    rotation: Quaternion


class FrameTransforms(msgspec.Struct, frozen=True):
    """Where all frames are."""

    transforms: list[FrameTransform]


class Log(msgspec.Struct, frozen=True):
    """A line of text; levels from 0 (unknown) over 2 (info) to 5 (fatal)."""

    timestamp: Time
    level: Annotated[int, msgspec.Meta(ge=0, le=5)]
    message: str
    name: str
    file: str = ""
    line: _Unsigned = 0


WellKnown = SceneUpdate | FrameTransforms | Log

_TIMES: Final = {"Time": "time", "Duration": "duration"}


def schema_name(kind: type[WellKnown]) -> str:
    """Return the name by which viewers know a message."""
    return f"foxglove.{kind.__name__}"


def json_schema(kind: type[WellKnown]) -> bytes:
    """Return a message's JSON Schema without references, which not every viewer follows."""
    whole = msgspec.json.schema(kind)
    return msgspec.json.encode(_resolved(whole, whole["$defs"]))


def _resolved(schema: object, definitions: Mapping[str, object]) -> object:
    """Return a schema with what each reference refers to in its place, all fields required."""
    if isinstance(schema, list):
        return [_resolved(item, definitions) for item in schema]
    if not isinstance(schema, dict):
        return schema
    if "$ref" in schema:
        name = schema["$ref"].rpartition("/")[2]
        found = _resolved(definitions[name], definitions)
        assert isinstance(found, dict)
        return found | {"title": _TIMES.get(name, f"foxglove.{name}")}
    resolved = {
        word: _resolved(part, definitions)
        for word, part in schema.items()
        if word not in ("$defs", "default")
    }
    if "properties" in resolved:
        resolved["required"] = list(schema["properties"])
    return resolved
