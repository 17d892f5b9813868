"""The robot's command: agent.

Decides: options, and which driver stands behind the agent.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

commands = typer.Typer()


@commands.command()
def agent(
    robot: Annotated[str, typer.Argument(help="The robot's name in the scenario.")],
    connect: Annotated[str, typer.Option(help="tcp/HOST:PORT of the coordinator.")],
    fleet: Annotated[str | None, typer.Option(help="Fleet; without it the first heard.")] = None,
    driver: Annotated[str, typer.Option(help="MODULE:CLASS of the driver.")] = (
        "sim.body:SimulatedBody"
    ),
    radius: Annotated[float, typer.Option(min=0.0, help="Metres; 0: as planned.")] = 0.0,
    max_speed: Annotated[float, typer.Option(min=0.0, help="m/s; 0: as planned.")] = 0.0,
    max_accel: Annotated[float, typer.Option(min=0.0, help="m/s^2; inf: starts at once.")] = 0.0,
    blackbox: Annotated[Path | None, typer.Option(help="Write true poses to this CSV.")] = None,
    speed: Annotated[float, typer.Option(min=0.01, max=1000.0, help="Times real time.")] = 1.0,
    wait: Annotated[float, typer.Option(min=0.0, help="Seconds to wait for a coordinator.")] = 10.0,
) -> None:
    """Run one robot; its body is simulated unless another driver is named.

    Example: splinefleet agent R1 --connect tcp/127.0.0.1:7447
    """
    from robot_agent.service import Robot, run_robot
    from protocol.zenoh_transport import ZenohTransport
