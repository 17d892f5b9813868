"""The messages of ROS 2 that the driver sends and hears, as CDR.

Decides: their fields, in the order of their definitions.  Must not know: topics, frames' meaning.
"""
# mypy: disable-error-code="misc,type-arg,valid-type"
# pycdr2 reads the types of the fields, so annotations are not postponed.

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

from pycdr2 import IdlStruct
from pycdr2.types import array, float64, int32, sequence, uint32

from robot_agent.driver import Pose
from robot_agent.ros2.frames import yaw_of
from robot_agent.ros2.topics import TWIST_STAMPED

_Message = TypeVar("_Message", bound=IdlStruct)

_LEAST: Final = 8
"""Shorter bytes are no message: the head has four, and no message here is empty."""

ODOMETRY: Final = "nav_msgs/Odometry"
TF: Final = "tf2_msgs/TFMessage"


@dataclass
class _Time(IdlStruct):
    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class _Header(IdlStruct):
    stamp: _Time = field(default_factory=_Time)
    frame_id: str = ""


@dataclass
class _Vector3(IdlStruct):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class _Quaternion(IdlStruct):
    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class _Pose(IdlStruct):
    position: _Vector3
    orientation: _Quaternion

    def flat(self) -> Pose:
        """Return x, y [m] and heading [rad]."""
        turned = self.orientation
        heading = yaw_of(turned.x, turned.y, turned.z, turned.w)
        return float(self.position.x), float(self.position.y), heading


@dataclass
class _Twist(IdlStruct):
    linear: _Vector3
    angular: _Vector3


@dataclass
class _TwistStamped(IdlStruct):
    header: _Header
    twist: _Twist


@dataclass
class _PoseStamped(IdlStruct):
    header: _Header
    pose: _Pose


@dataclass
class _PoseWithCovariance(IdlStruct):
    pose: _Pose
    covariance: array[float64, 36]


@dataclass
class _PoseWithCovarianceStamped(IdlStruct):
    header: _Header
    pose: _PoseWithCovariance


@dataclass
class _Odometry(IdlStruct):
    """All but the twist that follows, which nobody reads here."""

    header: _Header
    child_frame_id: str
    pose: _PoseWithCovariance


@dataclass
class _Transform(IdlStruct):
    translation: _Vector3
    rotation: _Quaternion


@dataclass
class _TransformStamped(IdlStruct):
    header: _Header
    child_frame_id: str
    transform: _Transform


@dataclass
class _TFMessage(IdlStruct):
    transforms: sequence[_TransformStamped]


_POSES: Final[dict[str, tuple[Any, Callable[[Any], _Pose]]]] = {
    ODOMETRY: (_Odometry, lambda message: message.pose.pose),
    "geometry_msgs/PoseStamped": (_PoseStamped, lambda message: message.pose),
    "geometry_msgs/PoseWithCovarianceStamped": (
        _PoseWithCovarianceStamped,
        lambda message: message.pose.pose,
    ),
}

KINDS: Final = (*_POSES, TF)
"""The kinds of message from which a pose can be had."""


def twist(kind: str, speed: float, turn_rate: float, now_ns: int) -> bytes:
    """Return a Twist, or a TwistStamped of a time [ns since 1970]."""
    told = _Twist(_Vector3(x=speed), _Vector3(z=turn_rate))
    if kind == TWIST_STAMPED:
        stamp = _Time(now_ns // 1_000_000_000, now_ns % 1_000_000_000)
        return bytes(_TwistStamped(_Header(stamp), told).serialize())
    return bytes(told.serialize())


def pose_in(kind: str, payload: bytes) -> Pose:
    """Return the pose that a message of a kind states; ValueError when it is none."""
    message, pose_of = _POSES[kind]
    return pose_of(_read(message, payload)).flat()


def transforms_in(payload: bytes) -> list[tuple[str, str, Pose]]:
    """Return parent, child and pose of each transform; ValueError when it is no TFMessage."""
    told = []
    transforms: Any = _read(_TFMessage, payload).transforms
    for one in transforms:
        at = _Pose(one.transform.translation, one.transform.rotation).flat()
        told.append((one.header.frame_id, one.child_frame_id, at))
    return told


def _read(message: type[_Message], payload: bytes) -> _Message:
    try:
        if len(payload) < _LEAST:
            raise ValueError("too short")
        read: _Message = message.deserialize(payload)
    except Exception as error:  # pycdr2 lets out whatever damaged bytes lead to.
        raise ValueError(f"no {message.__name__}: {error}") from None
    return read
