"""The driver for ROS 2: bytes, keys, frames, and what a base is told."""

import math
import struct

import pytest

from robot_agent.loop import PERIOD_NS

pytest.importorskip("pycdr2")
from robot_agent.ros2 import Bridge, RmwZenoh
from robot_agent.ros2.arc import Arc
from robot_agent.ros2.frames import Frames, compose, inverse, moved, yaw_of
from robot_agent.ros2.messages import KINDS, ODOMETRY, TF, pose_in, transforms_in, twist
from robot_agent.ros2.topics import TWIST, TWIST_STAMPED

HEAD = b"\0\1\0\0"
SECOND = 1_000_000_000


class Cdr:
    """Fields put one after the other by hand, each aligned to its size: little-endian CDR."""

    def __init__(self):
        self.data = b""

    def put(self, form, *values):
        for value in values:
            size = struct.calcsize(form)
            self.data += b"\0" * (-len(self.data) % size) + struct.pack("<" + form, value)
        return self

    def text(self, text):
        self.put("I", len(text) + 1)
        self.data += text.encode() + b"\0"
        return self

    def header(self, frame):
        return self.put("I", 7, 8).text(frame)

    def pose(self, x, y, heading):
        half = 0.5 * heading
        return self.put("d", x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))

    def bytes(self):
        return HEAD + self.data


def test_a_twist_is_six_numbers_after_the_head():
    assert twist(TWIST, 0.5, -0.25, 0) == HEAD + struct.pack("<6d", 0.5, 0, 0, 0, 0, -0.25)


def test_a_stamped_twist_has_the_time_and_no_frame():
    expected = Cdr().put("I", 12, 5).text("").put("d", 0.5, 0, 0, 0, 0, -0.25).bytes()
    assert twist(TWIST_STAMPED, 0.5, -0.25, 12 * SECOND + 5) == expected


@pytest.mark.parametrize("frame", ["", "map", "odom", "bot1/odom"])
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != TF])
def test_a_pose_is_read_wherever_padding_puts_it(kind, frame):
    said = Cdr().header(frame)
    if kind == ODOMETRY:
        said.text("base_link")
    said.pose(1.5, -2.5, 2.0)
    if "Stamped" not in kind or "Covariance" in kind:
        said.put("d", *range(36))
    if kind == ODOMETRY:
        said.put("d", *range(42))
    assert pose_in(kind, said.bytes()) == pytest.approx((1.5, -2.5, 2.0))


def test_transforms_are_read_with_their_frames():
    said = Cdr().put("I", 2)
    said.header("map").text("odom").pose(1.0, 2.0, 0.5)
    said.header("odom").text("base_link").pose(3.0, 4.0, -0.5)
    (first, second) = transforms_in(said.bytes())
    assert first[:2] == ("map", "odom")
    assert second == ("odom", "base_link", pytest.approx((3.0, 4.0, -0.5)))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("payload", [b"", HEAD, HEAD + b"\xff" * 40, b"\xff" * 400])
def test_bytes_that_are_no_message_are_told_apart(kind, payload):
    with pytest.raises(ValueError, match="no _"):
        transforms_in(payload) if kind == TF else pose_in(kind, payload)


def test_keys_are_those_of_the_bridge():
    assert Bridge().key("/cmd_vel", TWIST) == "cmd_vel"
    assert Bridge("/bot1").key("cmd_vel", TWIST) == "bot1/cmd_vel"
    assert Bridge("/bot1").attachment() is None


def test_keys_are_those_of_rmw_zenoh():
    topics = RmwZenoh(3)
    hash_of_twist = "RIHS01_9c45bf16fe0983d80e3cfe750d6835843d265a9a6c46bd2e609fcddde6fb8d2a"
    expected = f"3/bot1/cmd_vel/geometry_msgs::msg::dds_::Twist_/{hash_of_twist}"
    assert topics.key("/bot1/cmd_vel", TWIST) == expected
    assert topics.key("odom", ODOMETRY) == "3/odom/nav_msgs::msg::dds_::Odometry_/*"


def test_what_is_attached_for_rmw_zenoh_counts_and_has_one_sender():
    topics = RmwZenoh()
    first, second = topics.attachment(), topics.attachment()
    assert (len(first), first[16]) == (33, 16)
    assert [struct.unpack_from("<q", one)[0] for one in (first, second)] == [1, 2]
    assert first[17:] == second[17:] != RmwZenoh().attachment()[17:]


def test_a_heading_comes_from_a_quaternion():
    for heading in (-3.0, 0.0, 0.5, 3.0):
        z, w = math.sin(heading / 2), math.cos(heading / 2)
        assert yaw_of(0.0, 0.0, z, w) == pytest.approx(heading)


def test_poses_are_put_one_after_the_other_and_back():
    first, second = (1.0, 2.0, math.pi / 2), (3.0, 1.0, math.pi)
    assert compose(first, second) == pytest.approx((0.0, 5.0, -math.pi / 2))
    assert compose(first, inverse(first)) == pytest.approx((0.0, 0.0, 0.0))


def test_a_pose_moves_on_along_an_arc():
    half = moved((1.0, 1.0, 0.0), math.pi, math.pi, 1.0)
    assert half == pytest.approx((1.0, 3.0, math.pi))
    assert moved((1.0, 1.0, 0.0), 0.5, 0.0, 0.1) == pytest.approx((1.05, 1.0, 0.0))


def test_tf_leads_from_the_base_to_the_map_once_all_is_told():
    frames = Frames()
    frames.hear("odom", "/base_link", (1.0, 0.0, 0.0), 5)
    assert frames.pose("map", "base_link") is None
    frames.hear("map", "odom", (2.0, 3.0, math.pi / 2), 3)
    pose, heard_ns = frames.pose("map", "base_link")
    assert pose == pytest.approx((2.0, 4.0, math.pi / 2))
    assert heard_ns == 5


def test_tf_that_leads_in_a_ring_leads_nowhere():
    frames = Frames()
    frames.hear("a", "b", (0.0, 0.0, 0.0), 1)
    frames.hear("b", "a", (0.0, 0.0, 0.0), 1)
    assert frames.pose("map", "b") is None


def travelled(arc, until_ns, step_ns=PERIOD_NS):
    """How far the base gets that obeys what it is told once a period."""
    return sum(arc.velocities(t)[0] * step_ns / SECOND for t in range(0, until_ns, step_ns))


@pytest.mark.parametrize("distance", [0.0, 0.001, 0.0123, 0.02, 0.5])
@pytest.mark.parametrize("speed", [0.0, 0.1, 0.7])
def test_a_base_never_goes_farther_than_it_was_told_and_no_longer_than_the_watchdog(
    distance, speed
):
    arc = Arc(1.0)
    arc.drive(0, speed, 0.0, distance)
    expected = min(distance, speed * 0.05)
    assert travelled(arc, SECOND) == pytest.approx(expected, abs=1e-12)


def test_an_arc_turns_with_its_curvature():
    arc = Arc(1.0)
    arc.drive(0, 0.5, -2.0, 1.0)
    assert arc.velocities(1) == pytest.approx((0.5, -1.0))


def test_a_turn_on_the_spot_gets_slow_at_its_end_and_a_new_command_ends_it():
    arc = Arc(0.8)
    arc.turn(0, -2.0)
    assert arc.velocities(1) == (0.0, -0.8)
    arc.turn(1, 0.05)
    assert arc.velocities(2) == pytest.approx((0.0, 0.2))
    arc.drive(2, 0.0, 0.0, 0.0)
    assert arc.velocities(3) == (0.0, 0.0)
