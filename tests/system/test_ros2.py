"""A base that speaks the bytes of ROS 2 over real Zenoh is driven by the agent to its goal."""

import math
import struct
import threading
import time

import pytest

from protocol.zenoh_transport import ZenohTransport
from tests.robot_agent.test_ros2 import HEAD, Cdr
from tests.system.fleet_tools import free_endpoint, line_with, started

pytest.importorskip("pycdr2")

START, GOAL = (1.0, 1.0, 0.5), (2.2, 1.6)
WATCHDOG_S = 0.1
PERIOD_S = 0.01
TRIES = 2
DEADLINE_S = 40.0

SCENARIO = f"""
name = "ros"
margin = 0.2
[workspace]
bounds = [0.0, 0.0, 4.0, 3.0]
[[robots]]
id = "R1"
start = {list(START)}
goal = {list(GOAL)}
radius = 0.2
max_speed = 0.5
"""

DRIVER = """
from robot_agent.ros2 import Bridge, RmwZenoh, RosBase
from robot_agent.ros2.messages import TF


class Base(RosBase):
    def __init__(self, max_accel):
        """
ODOMETRY = {
    "command": "bot1/cmd_vel",
    "pose": "bot1/odom",
    "driver": 'RosBase.__init__(self, "%s", Bridge("/bot1"))',
}
TF = {
    "command": "0/cmd_vel/geometry_msgs::msg::dds_::TwistStamped_/"
    "RIHS01_5f0fcd4f81d5d06ad9b4c4c63e3ea51b82d6ae4d0558f1d475229b1121db6f64",
    "pose": "0/tf/tf2_msgs::msg::dds_::TFMessage_/RIHS01_of_its_own",
    "driver": "RosBase.__init__(self, '%s', RmwZenoh(), pose_kind=TF, stamped=True)",
}


class Base(threading.Thread):
    """A unicycle that obeys the newest Twist for WATCHDOG_S and tells its pose at 50 Hz."""

    def __init__(self, link, form):
        super().__init__(daemon=True)
        self.x = self.y = self.heading = 0.0
        self.attached = []
        self._link, self._form = link, form
        self._told, self._heard = (0.0, 0.0), 0.0
        self._over = threading.Event()
        link.subscribe(form["command"], self._hear)

    def _hear(self, _key, payload, _sent_ns):
        assert payload[:4] == HEAD
        told = struct.unpack("<6d", payload[-48:])
        assert len(payload) == (52 if self._form is ODOMETRY else 68)
        self._told, self._heard = (told[0], told[5]), time.monotonic()

    def run(self):
        ticks = 0
        while not self._over.wait(PERIOD_S):
            speed, rate = self._told
            if time.monotonic() - self._heard < WATCHDOG_S:
                self.heading += rate * PERIOD_S
                self.x += speed * PERIOD_S * math.cos(self.heading)
                self.y += speed * PERIOD_S * math.sin(self.heading)
            ticks += 1
            if ticks % 2:
                self._link.put(self._form["pose"], self._pose())

    def _pose(self):
        here = (self.x, self.y, self.heading)
        if self._form is ODOMETRY:
            said = Cdr().header("odom").text("base_link").pose(*here).put("d", *[0.0] * 78)
        else:
            said = Cdr().put("I", 2)
            said.header("map").text("odom").pose(*START)
            said.header("odom").text("base_link").pose(*here)
        return said.bytes()

    def end(self):
        self._over.set()
        self.join()

    def on_floor(self):
        """Where it is on the floor, as it began at START."""
        ahead, right = math.cos(START[2]), math.sin(START[2])
        return START[0] + ahead * self.x - right * self.y, START[
            1
        ] + right * self.x + ahead * self.y


def drive(folder, form):
    """Drive the base; return how far [m] from its goal it ends, and what a failing agent said."""
    folder.mkdir()
    (folder / "ros.toml").write_text(SCENARIO)
    bridge, fleet = free_endpoint(), free_endpoint()
    (folder / "base.py").write_text(DRIVER + form["driver"] % bridge)
    with ZenohTransport.listen(bridge) as link:
        base = Base(link, form)
        base.start()
        coordinating = ("coordinator", folder / "ros.toml", "--listen", fleet, "--json")
        with started(*coordinating) as coordinator:
            line_with(coordinator, "listening", 60.0)
            driver = f"{folder / 'base.py'}:Base"
            with started("agent", "R1", "--connect", fleet, "--driver", driver) as agent:
                watch = threading.Timer(DEADLINE_S, agent.kill)
                watch.start()
                said = agent.communicate()[1]
                watch.cancel()
                agent_code = agent.returncode
        base.end()
    return math.dist(base.on_floor(), GOAL), said if agent_code else ""


@pytest.mark.parametrize("form", [ODOMETRY, TF], ids=["bridge", "rmw_zenoh"])
def test_a_base_of_ros_2_is_driven_to_its_goal(tmp_path, form):
    for attempt in range(TRIES):  # A machine that stalls lets the base's watchdog stop it.
        off, trouble = drive(tmp_path / f"{attempt}", form)
        if not trouble:
            break
    assert trouble == ""
    assert off < 0.03
