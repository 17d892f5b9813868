"""The command that shows a plan, a log or a running fleet in a browser: view.

Decides: its options and exit codes.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from coordinator.base.console import answers, tell
from coordinator.cli.fleet_line import sender
from coordinator.cli.option_checks import named, only_with, reached
from coordinator.service.key_option import Keys, given_keys
from protocol.key_files import read_key_files
from protocol.transport import TransportError

if TYPE_CHECKING:
    from starlette.applications import Starlette

commands = typer.Typer()


@commands.command(rich_help_panel="Inspect")
def view(
    source: Annotated[
        Path | None,
        typer.Argument(
            metavar="PLAN|LOG",
            help="Log or plan file; with --connect, the plan file that shows the floor.",
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65_535, help="Port of the page; 0 takes a free one.")
    ] = 0,
    open_: Annotated[
        bool, typer.Option("--open/--no-open", help="Open the page in a browser.")
    ] = True,
    connect: Annotated[
        str | None,
        typer.Option(
            callback=reached,
            help="Follow a running fleet: tcp/HOST:PORT of the coordinator or router.",
        ),
    ] = None,
    fleet: Annotated[
        str | None,
        typer.Option(
            callback=only_with("connect", check=named),
            help="With --connect: name of the fleet; by default the first one heard.",
        ),
    ] = None,
    keys: Keys = None,
) -> None:
    """Show a plan, a log or a running fleet on a page served by this machine until Ctrl-C.

    Example: splinefleet view runs/demo/run.mcap
    """
    from coordinator.desk.web import page_app, served
    from coordinator.view.page import page_of
    from coordinator.view.scene_reader import read_scene

    if source is None and connect is None:
        raise typer.BadParameter("give a log or plan file, or --connect", param_hint="SOURCE")
    with ExitStack() as stack:
        if connect is None and source is not None:
            scene = read_scene(source)
            for note in scene.notes:
                tell(f"{source}: {note}")
            page = page_of(scene)
            app = page_app(lambda: page)
        else:
            app = _live(stack, connect or "", fleet, source, keys)
        address = stack.enter_context(served(app, port=port))
        answers.print(address)
        if open_:
            import webbrowser

            if not webbrowser.open(address):
                tell("no browser was found; open the address in one")
        threading.Event().wait()


def _live(
    stack: ExitStack, connect: str, fleet: str | None, plan: Path | None, folder: Keys
) -> Starlette:
    """Return the desk of a running fleet; it may command with an operator's keys, or without any.

    `plan`: a plan file with the floor and the first epoch.
    """
    from coordinator.desk.line import Line
    from coordinator.desk.web import Desk
    from coordinator.plan.plan_file import read
    from coordinator.view.live_course import LiveCourse
    from coordinator.view.page import page_of
    from protocol.zenoh_transport import ZenohTransport

    document = None if plan is None else read(plan)
    files = given_keys(folder, "operator" if _has_operator(folder) else "observer")
    course = LiveCourse(fleet or (document.scenario if document else None), document)
    link = stack.enter_context(ZenohTransport.connect(connect, keys=files))
    line = Line(link, course, sender(files))
    desk = Desk(
        line,
        lambda may: page_of(line.scene(), live=True, may_command=may),
        may_command=files is None or files.badge.role == "operator",
    )
    return desk.app()


def _has_operator(folder: Path | None) -> bool:
    """Return whether a folder of keys is an operator's, or a fleet's that has an operator."""
    if folder is None:
        return False
    try:
        read_key_files(folder, "operator")
    except TransportError:
        return False
    return True
