"""The commands about logs: record, replay, recover, export.

Decides: options and exit codes.  Heavy modules are imported when a command needs them.
"""

from __future__ import annotations

import math
import os
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Annotated, Literal, TypeVar

import typer

from coordinator.commands import Json, LogFile, Source, Speed, within, writable
from coordinator.console import answer_json, answers, errors, tell, write_file
from coordinator.errors import InputError, PlanError
from coordinator.vda5050 import Version
from protocol.keys import NAME

commands = typer.Typer()

Item = TypeVar("Item")


def key_pattern(pattern: str) -> str:
    """Check a key pattern before any work."""
    from coordinator.playing import key_filter

    try:
        key_filter(pattern)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    return pattern


def key_prefix(prefix: str) -> str:
    """Check what is to be put before keys."""
    if prefix and not all(NAME.fullmatch(part) for part in prefix.split("/")):
        raise typer.BadParameter(f"{prefix!r} is no prefix of keys; one looks like replay/one")
    return prefix


def fleet_name(name: str | None) -> str | None:
    """Check the name of a fleet."""
    if name is not None and not NAME.fullmatch(name):
        raise typer.BadParameter(f"{name[:60]!r} is no fleet's name")
    return name


@commands.command()
def record(
    connect: Annotated[str, typer.Option(help="tcp/HOST:PORT of the coordinator.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.mcap", callback=writable(".mcap"))
    ] = Path("run.mcap"),
    fleet: Annotated[
        str | None, typer.Option(help="Fleet; without it the first heard.", callback=fleet_name)
    ] = None,
    wait: Annotated[
        float, typer.Option(callback=within(0.1, 86_400.0), help="Seconds to wait for a link.")
    ] = 10.0,
    speed: Speed = 1.0,
) -> None:
    """Record all of a fleet's traffic, listening only, until it is over or Ctrl-C.

    Example: splinefleet record --connect tcp/127.0.0.1:7447 -o beside.mcap
    """
    from coordinator.record import Recording, first_fleet
    from protocol.zenoh_transport import ZenohTransport

    recording = Recording(output, speed)
    try:
        with ZenohTransport.connect(connect, timeout_s=wait) as transport:
            name = fleet or first_fleet(transport)
            recording.begin(transport, name)
            tell(f"{name}: recording into {output}, Ctrl-C ends it")
            recording.wait()
    finally:
        count = recording.close()
        if recording.listener is not None:
            tell(f"{output}: {count} messages")


@commands.command()
def replay(
    log: LogFile,
    check: Annotated[bool, typer.Option("--check", help="Run the log again, compare.")] = False,
    speed: Speed = 1.0,
    listen: Annotated[str, typer.Option(help="tcp/HOST:PORT")] = "tcp/127.0.0.1:7447",
    since: Annotated[
        float, typer.Option("--from", callback=within(0.0), help="Seconds into the log.")
    ] = 0.0,
    until: Annotated[
        float | None, typer.Option("--to", min=0.0, help="Seconds into the log.")
    ] = None,
    keys: Annotated[
        str, typer.Option(callback=key_pattern, help="Only these; * is a part, ** any number.")
    ] = "**",
    prefix: Annotated[
        str, typer.Option(callback=key_prefix, help="Put before every key, with a slash.")
    ] = "",
    wait_listener: Annotated[
        float, typer.Option(callback=within(0.0, 86_400.0), help="Seconds to wait for a listener.")
    ] = 0.0,
    as_json: Json = False,
) -> None:
    """Publish a log's traffic again in time, or check that it can be reproduced byte for byte.

    Without a listener after --wait-listener seconds nothing is played, exit code 1.

    Example: splinefleet replay runs/demo/run.mcap --from 5 --to 9 --keys "splinefleet/*/report/*"
    """
    if check:
        _check(log, as_json)
        return
    from coordinator.logbook import read_log
    from coordinator.playing import Wish, cues, play
    from protocol.zenoh_transport import ZenohTransport

    if until is not None and not since <= until:
        raise typer.BadParameter(f"{until:g} s is before --from {since:g}", param_hint="--to")
    recorded = read_log(log)
    if recorded.damage:
        tell(f"{log}: {recorded.damage}; what is whole is played")
    found = cues(recorded, Wish(since, math.inf if until is None else until, keys, prefix))
    transport = ZenohTransport.listen(listen)
    with transport:
        if wait_listener > 0.0:
            tell(f"waiting for a listener on {listen}")
            if not transport.wait_for_listener(f"{prefix}/**" if prefix else "**", wait_listener):
                tell(f"nobody listens after {wait_listener:g} s; nothing was played", "red")
                raise typer.Exit(1)
        tell(f"playing {len(found)} messages on {listen}")
        begin = time.monotonic()

        def wait_until(seconds: float) -> None:
            time.sleep(max(0.0, begin + seconds - time.monotonic()))

        count = play(_shown(found, "playing"), transport.put, wait_until, speed)
    if as_json:
        answer_json({"messages": count})


def _shown(items: Sequence[Item], what: str) -> Iterable[Item]:
    """Yield the items with a progress bar for people on a terminal."""
    from rich.progress import track

    return track(items, what, console=errors, transient=True, disable=not errors.is_terminal)


def _check(log: Path, as_json: bool) -> None:
    from coordinator.logbook import check_bytes, read_log
    from coordinator.replay import Check, check_log

    damage, recorded = check_bytes(log), read_log(log)
    if recorded.metadata.get("passive") == "yes":
        damage = damage or "was recorded from beside; only the coordinator's own log can be checked"
    result = Check(0, 0, damage) if damage else check_log(recorded)
    if as_json:
        answer_json(result._asdict())
    elif not result.difference:
        answers.print(f"{result.plans} plans and {result.commands} commands: every byte agrees")
    if result.note:
        tell(f"{log}: {result.note}")
    if result.difference:
        tell(f"{log}: {result.difference}")
        raise typer.Exit(1)


@commands.command()
def recover(
    log: LogFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="WHOLE.mcap; by default LOG-whole.mcap beside it.",
            callback=writable(".mcap"),
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that is there.")] = False,
    as_json: Json = False,
) -> None:
    """Make a cut or damaged log whole: every complete chunk, attachments, a proper end.

    Example: splinefleet recover runs/demo/run.mcap -o whole.mcap
    """
    from coordinator.logbook import load
    from coordinator.recover import make_whole

    place = output or log.with_name(f"{log.stem}-whole.mcap")
    if place.resolve() == log.resolve():
        raise InputError([f"--output: {place} is the log itself; name another file"])
    if place.exists() and not force:
        raise InputError([f"--output: {place} is there already; --force replaces it"])
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
        tell(f"{whole.lost} messages are lost whose channel was in a damaged chunk")
    files = f"{whole.attachments} attachments"
    answers.print(f"{place}: {whole.messages} messages in {whole.chunks} chunks and {files} kept")


def _write_at_once(path: Path, content: bytes) -> None:
    """Write a file so that there is either all of it or what was there before."""
    part = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        write_file(part, content)
        part.replace(path)
    except OSError as error:
        raise InputError([f"{path}: {error.strerror}"]) from None
    finally:
        with suppress(OSError):
            part.unlink()


@commands.command()
def export(
    source: Source,
    to: Annotated[Literal["csv", "foxglove", "vda5050"], typer.Option(help="For which tools.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.csv, FILE.mcap, DIR", callback=writable())
    ],
    step: Annotated[
        float, typer.Option(callback=within(1e-3, 1e3), help="Seconds a row or a frame.")
    ] = 0.05,
    order_version: Annotated[Version, typer.Option(help="Said in VDA 5050 orders.")] = "2.1.0",
) -> None:
    """Write the robots' motions, by the plans in a plan file or a log, for other tools.

    csv: robot,t,x,y,heading,s,v.  foxglove: an MCAP for Foxglove and Lichtblick.
    vda5050: an order per robot into DIR, of the newest plan.

    Example: splinefleet export runs/demo/run.mcap --to foxglove -o scene.mcap
    """
    from coordinator.export import csv_lines, read_story
    from coordinator.export_foxglove import write_scene
    from coordinator.vda5050_commands import write_orders

    if source.exists() and output.exists() and source.samefile(output):
        raise InputError([f"--output: {output} is the source itself; name another file"])
    if to == "vda5050":
        write_orders(source, output, order_version)
        return
    story = read_story(source)
    if not story.legs:
        raise PlanError(f"{source}: no robot was sent on its way, there is no motion to export")
    if to == "csv":
        write_file(output, ("\n".join(csv_lines(story, step)) + "\n").encode())
    else:
        _write_at_once(output, write_scene(story, step, _shown))
    tell(f"wrote {output}")
