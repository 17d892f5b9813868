"""The loop of a MicroPython robot.

Decides: when the next tick is due, and that a tick that fails stops the base.
"""

from collections.abc import Callable


def run(
    robot: object,
    base: object,
    clock_ns: Callable[[], int],
    sleep_us: Callable[[int], None],
    period_ns: int = 10_000_000,
) -> None:
    """Tick a robot at a fixed rate until it may end; a tick that fails stops the base.

    `base` has `pose()`, which returns x, y [m] and heading [rad]; `drive(speed, curvature,
    distance)`, `turn(angle)` and `stop()`, with the obligations of robot_agent/driver.py.
    """
    agent, due_ns = robot.agent, clock_ns()
    going = True
    while going:
        now_ns = clock_ns()
        try:
            going = robot.tick(now_ns, *base.pose())
            if agent.drive_turn:
                base.turn(agent.drive_turn)
            else:
                base.drive(agent.drive_speed, agent.drive_curvature, agent.drive_distance)
        except Exception:
            base.stop()
            agent.hear_driver_error(now_ns)
        due_ns += period_ns
        left_ns = due_ns - clock_ns()
        if left_ns > 0:
            sleep_us(left_ns // 1000)
        else:
            due_ns -= left_ns
    base.stop()
