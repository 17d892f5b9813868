"""A driver for bases that run ROS 2: `cmd_vel` out, a pose topic in, through Zenoh.

Needs pycdr2 (`pip install splinefleet[ros2]`), and nothing of ROS on this side.  `base.py` is the
driver, `arc.py` what it tells the base, `frames.py` poses and tf, `topics.py` names and keys,
`messages.py` the messages as CDR.
"""

from robot_agent.ros2.base import RosBase
from robot_agent.ros2.topics import Bridge, RmwZenoh

__all__ = ["Bridge", "RmwZenoh", "RosBase"]
