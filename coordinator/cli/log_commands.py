"""The commands about logs: record, recover, export; replay is sim/cli/replay_commands.py.

Decides: their options and exit codes.  Heavy modules are imported when a command needs them.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Final, Literal, TypeVar, cast

import typer

from coordinator.base.console import answer_json, answers, errors, tell, tell_now, write_file
from coordinator.base.errors import InputError, PlanError
from coordinator.cli.fleet_line import Connect, FleetName
from coordinator.cli.option_checks import given, within, writable
from coordinator.cli.plan_commands import Json, LogFile, Source, Speed, given_log
from coordinator.exchange.vda5050 import Version
from coordinator.service.key_option import Keys, given_keys

commands = typer.Typer()

Item = TypeVar("Item")
_SUFFIXES: Final = {"csv": ".csv", "foxglove": ".mcap"}
Force = Annotated[bool, typer.Option("--force", help="Replace an existing file.")]


@commands.command(rich_help_panel="Operate")
def record(
    connect: Connect,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.mcap", callback=writable(".mcap"))
    ] = Path("beside.mcap"),
    fleet: FleetName = None,
    wait: Annotated[
        float, typer.Option(callback=within(0.1, 86_400.0), help="Seconds to wait for a link.")
    ] = 10.0,
    speed: Speed = 1.0,
    keys: Keys = None,
    force: Force = False,
) -> None:
    """Record all traffic of a fleet by listening only, until its mission is over or Ctrl-C.

    Example: splinefleet record --connect tcp/127.0.0.1:7447 -o beside.mcap
    """
    from coordinator.log.listening import Recording
    from protocol.zenoh_transport import ZenohTransport, use_few_threads

    _refuse_existing(output, force)
    files = given_keys(keys, "observer")
    use_few_threads()
    why = "" if files is None else ", or this key may not listen: was it revoked?"
    quiet = (
        f"connected, but no messages arrive: no fleet is active here{why}; waiting, Ctrl-C ends it"
    )

    def say_unheard(robots: Sequence[str]) -> None:
        names = ", ".join(robots)
        tell_now(f"plan not heard: {names}; the recording does not contain it", "yellow")

    recording = Recording(
        output, speed, replace=force, silence=lambda: tell_now(quiet), unheard=say_unheard
    )
    try:
        with ZenohTransport.connect(connect, timeout_s=wait, keys=files) as transport:
            name = recording.begin(transport, fleet)
            tell_now(f"{name}: recording into {output}, Ctrl-C ends it")
            recording.wait()
    finally:
        count = recording.close()
        if recording.listener is not None:
            tell_now(f"{output}: {count} messages")


def _refuse_existing(output: Path, force: bool) -> None:
    if output.exists() and not force:
        raise InputError([f"--output: {output} already exists; --force replaces it"])


def shown(items: Sequence[Item], what: str) -> Iterable[Item]:
    """Yield the items; show a progress bar if standard error is a terminal."""
    from rich.progress import track

    return track(items, what, console=errors, transient=True, disable=not errors.is_terminal)


@commands.command(rich_help_panel="Inspect")
def recover(
    log: LogFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="File for the repaired log; by default LOG-whole.mcap beside LOG.mcap.",
            callback=writable(".mcap"),
        ),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Repair a truncated or damaged log: save all complete chunks and attachments, and close it.

    Example: splinefleet recover runs/demo/run.mcap -o whole.mcap
    """
    from coordinator.log.log_file import load
    from coordinator.log.recover import make_whole

    place = output or log.with_name(f"{log.stem}-whole.mcap")
    if place.resolve() == log.resolve():
        raise InputError([f"--output: {place} is the log itself; name another file"])
    _refuse_existing(place, force)
    whole = make_whole(load(log), str(log))
    _write_at_once(place, whole.data)
    if as_json:
        told = whole._asdict()
        del told["data"]
        answer_json({"output": str(place), **told})
        return
    was = "was whole" if whole.complete and not whole.damage else "was not closed"
    tell(f"{log}: {whole.damage or was}")
    if whole.lost:
        tell(f"{whole.lost} messages are lost because their channel was in a damaged chunk")
    files = f"{whole.attachments} attachments"
    answers.print(f"{place}: {whole.messages} messages in {whole.chunks} chunks and {files} kept")


def _write_at_once(path: Path, content: bytes) -> None:
    """Write a file atomically: a reader finds either all of it or the previous file."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        write_file(part, content)
        part.replace(path)
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    finally:
        with suppress(OSError):
            part.unlink()


def _fits_format(context: typer.Context, output: Path) -> Path:
    """Accept an output whose name suits the format, in an existing folder."""
    suffix = _SUFFIXES.get(context.params.get("to", ""))
    return cast(Path, writable(*([suffix] if suffix else []))(output))


def _only_to(
    *formats: str, check: Callable[[Item], Item] | None = None
) -> Callable[[typer.Context, typer.CallbackParam, Item], Item]:
    """Return a callback that refuses an option that other formats than these would ignore."""

    def checked(context: typer.Context, param: typer.CallbackParam, value: Item) -> Item:
        value = value if check is None else check(value)
        to = context.params.get("to", formats[0])
        if given(context, str(param.name)) and to not in formats:
            raise typer.BadParameter(f"has no effect with --to {to}")
        return value

    return checked


@commands.command(rich_help_panel="Inspect")
def export(
    source: Source,
    to: Annotated[Literal["csv", "foxglove", "vda5050"], typer.Option(help="Format to write.")],
    output: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="FILE.csv, FILE.mcap or, for vda5050, a folder.",
            callback=_fits_format,
        ),
    ],
    step: Annotated[
        float,
        typer.Option(
            callback=_only_to("csv", "foxglove", check=within(1e-3, 1e3)),
            help="Seconds from one CSV row or Foxglove frame to the next.",
        ),
    ] = 0.05,
    order_version: Annotated[
        Version,
        typer.Option(callback=_only_to("vda5050"), help="VDA 5050 version to state in the orders."),
    ] = "2.1.0",
) -> None:
    """Write the robots' motions for other tools, from the plans in a plan file or a log.

    csv: rows of robot,t,x,y,heading,s,v.  foxglove: an MCAP file for Foxglove, Lichtblick and
    Rerun.  vda5050: a folder with one order per robot, from the newest plan.

    Example: splinefleet export runs/demo/run.mcap --to foxglove -o scene.mcap
    """
    from coordinator.cli.vda5050_commands import write_orders
    from coordinator.exchange.motion_story import csv_lines, story_of_log, story_of_plan
    from coordinator.plan.plan_file import read

    if source.exists() and output.exists() and source.samefile(output):
        raise InputError([f"--output: {output} is the source itself; name another file"])
    if to == "vda5050":
        write_orders(source, output, order_version)
        return
    is_plan = source.suffix == ".json"
    story = story_of_plan(read(source)) if is_plan else story_of_log(given_log(source))
    if not story.legs:
        raise PlanError(f"{source}: no robot was sent on its way, so there is no motion to export")
    if to == "csv":
        write_file(output, ("\n".join(csv_lines(story, step)) + "\n").encode())
    else:
        from coordinator.exchange.foxglove import write_scene

        _write_at_once(output, write_scene(story, step, shown))
    tell(f"wrote {output}")
