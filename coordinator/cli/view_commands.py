"""The command that shows a plan, a log or a running fleet in a browser: view.

Decides: its options and exit codes.
"""

from __future__ import annotations

import threading
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer

from coordinator.base.console import answers, tell
from coordinator.service.key_option import Keys, given_keys

commands = typer.Typer()


@commands.command(rich_help_panel="Inspect")
def view(
    source: Annotated[
        Path | None,
        typer.Argument(
            help="Log or plan file; with --connect, the plan file that shows the floor."
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
        typer.Option(help="Follow a running fleet: tcp/HOST:PORT of the coordinator or router."),
    ] = None,
    fleet: Annotated[
        str | None, typer.Option(help="Name of the fleet; by default the first one heard.")
    ] = None,
    keys: Keys = None,
) -> None:
    """Show a plan, a log or a running fleet on a page served by this machine until Ctrl-C.

    Example: splinefleet view runs/demo/run.mcap
    """
    from coordinator.view.page import page_of
    from coordinator.view.server import read_scene, served

    if source is None and connect is None:
        raise typer.BadParameter("give a log or plan file, or --connect", param_hint="SOURCE")
    with ExitStack() as stack:
        if connect is None and source is not None:
            scene = read_scene(source)
            for note in scene.notes:
                tell(f"{source}: {note}")
            page = page_of(scene)
            address = stack.enter_context(served(lambda: page, port))
        else:
            from coordinator.view.live import followed

            feed = stack.enter_context(
                followed(connect or "", fleet, source, given_keys(keys, "observer"))
            )
            address = stack.enter_context(
                served(lambda: page_of(feed.scene(), live=True), port, feed.events)
            )
        answers.print(address)
        if open_:
            import webbrowser

            if not webbrowser.open(address):
                tell("no browser was found; open the address in one")
        threading.Event().wait()
