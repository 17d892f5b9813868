"""The command that replays a log: publishes it again, checks it, or continues from a moment.

Decides: options and exit codes.  It is in sim/ because continuing a log needs a simulated world.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import typer

from coordinator.base.console import answer_json, answers, tell
from coordinator.cli.log_commands import shown
from coordinator.cli.option_checks import if_given, not_with, only_with, reached, within
from coordinator.cli.plan_commands import Json, LogFile, given_log, make_folder, tell_remarks
from coordinator.service.key_option import Insecure, given_keys, where_to_listen
from protocol.keys import NAME
from sim.world.fault_script import fault_help

commands = typer.Typer()

_LINGER_S: Final = 0.2
"""How long the session stays open after the last message, which closing it might lose."""


def key_pattern(pattern: str) -> str:
    """Check a key pattern before any work."""
    from coordinator.log.traffic_replay import key_filter

    try:
        key_filter(pattern)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None
    return pattern


def key_prefix(prefix: str) -> str:
    """Check the prefix of keys before any work."""
    if prefix and not all(NAME.fullmatch(part) for part in prefix.split("/")):
        raise typer.BadParameter(f"{prefix!r} is not a prefix of keys; an example is replay/one")
    return prefix


def _published(check: Callable[[Any], Any] | None = None) -> Callable[..., Any]:
    """Return a callback for an option of publishing, which `--check` and `--until` ignore."""
    return not_with("check", "until", check=check)


def _after_start(
    context: typer.Context, param: typer.CallbackParam, to: float | None
) -> float | None:
    """Accept an end that is not before `--from`, where the log is published."""
    to = _published()(context, param, to)
    since = context.params.get("since", 0.0)
    if to is not None and not since <= to:
        raise typer.BadParameter(f"{to:g} s is before --from {since:g}")
    return to


@commands.command(rich_help_panel="Inspect")
def replay(
    log: LogFile,
    check: Annotated[
        bool,
        typer.Option(
            "--check",
            help="Compute the coordinator's messages again from the log and compare them.",
        ),
    ] = False,
    speed: Annotated[
        float,
        typer.Option(
            callback=_published(within(0.01, 1000.0)),
            help="Speed of the fleet's clock, 0.01 to 1000; 1 is real time, 2 twice as fast.",
        ),
    ] = 1.0,
    listen: Annotated[
        str | None,
        typer.Option(
            callback=_published(if_given(reached)),
            help="tcp/HOST:PORT to listen on; by default tcp/127.0.0.1:7447.",
        ),
    ] = None,
    since: Annotated[
        float,
        typer.Option(
            "--from",
            callback=_published(within(0.0)),
            help="Begin this many seconds into the log.",
        ),
    ] = 0.0,
    to: Annotated[
        float | None,
        typer.Option(min=0.0, callback=_after_start, help="End this many seconds into the log."),
    ] = None,
    keys: Annotated[
        str,
        typer.Option(
            callback=_published(key_pattern),
            help="Publish only these keys; * is one part of a key, ** any number.",
        ),
    ] = "**",
    prefix: Annotated[
        str,
        typer.Option(
            callback=_published(key_prefix), help="Put this and a slash before every key."
        ),
    ] = "",
    wait_listener: Annotated[
        float,
        typer.Option(
            callback=_published(within(0.0, 86_400.0)),
            help="Wait this many seconds for a listener.",
        ),
    ] = 0.0,
    until: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            callback=not_with("check"),
            help="Continue the run in virtual time from this many seconds after GO.",
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            callback=only_with("until"),
            help=f"With --until: a fault, repeatable. {fault_help()}.",
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(callback=only_with("until"), help="With --until: folder for the new run."),
    ] = None,
    seed: Annotated[
        int,
        typer.Option(
            min=0,
            callback=only_with("until"),
            help="With --until: seed of losses, delays and clock errors.",
        ),
    ] = 0,
    key_folder: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            callback=_published(),
            help="Folder of the fleet's keys; only its observers may listen, over TLS.",
        ),
    ] = None,
    insecure: Insecure = False,
    as_json: Json = False,
) -> None:
    """Publish a log again, check it (--check), or continue the run from a moment (--until).

    If nobody listens after --wait-listener seconds, nothing is published and the exit code is 1.

    Example: splinefleet replay runs/demo/run.mcap --until 8 --fault kill:R3@9 --out runs/what-if
    """
    if check:
        _check(log, as_json)
    elif until is not None:
        _carry_on(log, until, fault or [], out, seed, as_json)
    else:
        endpoint = where_to_listen(listen, key_folder, insecure)
        asked = Playing(endpoint, speed, since, to, keys, prefix, wait_listener, key_folder)
        _play(log, asked, as_json)


class Playing(NamedTuple):
    """The options of `replay`: which part of a log is played, how fast, and who may listen."""

    listen: str
    speed: float
    since: float
    to: float | None
    keys: str
    prefix: str
    wait_listener: float
    key_folder: Path | None


def _play(log: Path, asked: Playing, as_json: bool) -> None:
    from coordinator.log.traffic_replay import Wish, cues, play
    from coordinator.security.link_admission import player_access
    from protocol.zenoh_transport import ZenohTransport

    since, to, prefix, patience = asked.since, asked.to, asked.prefix, asked.wait_listener
    recorded = given_log(log)
    found = cues(recorded, Wish(since, math.inf if to is None else to, asked.keys, prefix))
    own = given_keys(asked.key_folder, "coordinator")
    access = None if asked.key_folder is None else player_access(asked.key_folder)
    with ZenohTransport.listen(asked.listen, own, access) as transport:
        if patience > 0.0:
            tell(f"waiting for a listener on {asked.listen}")
            if not transport.wait_for_listener(f"{prefix}/**" if prefix else "**", patience):
                tell(f"nobody listens after {patience:g} s; nothing was played", "red")
                raise typer.Exit(1)
        tell(f"playing {len(found)} messages on {asked.listen}")
        begin = time.monotonic()

        def wait_until(seconds: float) -> None:
            time.sleep(max(0.0, begin + seconds - time.monotonic()))

        count = play(shown(found, "playing"), transport.put_patiently, wait_until, asked.speed)
        time.sleep(_LINGER_S)
    if as_json:
        answer_json({"messages": count})


def _carry_on(
    log: Path, until: float, faults: list[str], out: Path | None, seed: int, as_json: bool
) -> None:
    from sim.processes.conclusion import conclude
    from sim.what_if.shell import carry_on

    folder = out or Path("runs") / f"what-if-{time.strftime('%Y%m%d-%H%M%S')}"
    make_folder(folder / "blackbox")
    name, arrived = carry_on(log, until, folder, faults, seed)
    conclude(folder, name, 0 if arrived else 1, as_json)


def _check(log: Path, as_json: bool) -> None:
    from coordinator.log.log_file import read_log
    from coordinator.service.replay import Check, check_log

    recorded = read_log(log)
    damage = recorded.damage
    if recorded.is_recording:
        damage = damage or "a listener's recording; only a coordinator's own log can be checked"
    result = Check(0, 0, damage) if damage else check_log(recorded)
    tell_remarks(log, [one for one in recorded.remarks if one not in result.difference])
    if as_json:
        answer_json(result._asdict())
    elif not result.difference:
        answers.print(f"{result.plans} plans and {result.commands} commands: every byte agrees")
    if result.note:
        tell(f"{log}: {result.note}")
    if result.difference:
        tell(f"{log}: {result.difference}")
        raise typer.Exit(1)
