"""The commands about keys: keys init, robot, observer, operator, coordinator, router, revoke, show.

Decides: their options and exit codes.
"""

from __future__ import annotations

import datetime
import ipaddress
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from coordinator.base.console import answer_json, answers, tell, write_file
from coordinator.base.errors import InputError
from coordinator.cli.checked_command import CommandGroup
from coordinator.cli.option_checks import reached, writable
from coordinator.cli.plan_commands import Json
from protocol.badge import ROLES, Role
from protocol.endpoint import endpoint_of
from protocol.key_files import WARNING, own_place, read_key_files
from protocol.keys import NAME, NAME_IN_WORDS

if TYPE_CHECKING:
    from coordinator.security.certificate_register import Issued

commands = typer.Typer()
keys_commands = typer.Typer(
    cls=CommandGroup,
    help="Make, revoke and show the keys of a fleet: docs/keys.md.",
    no_args_is_help=True,
)
commands.add_typer(keys_commands, name="keys", rich_help_panel="Keys")

_USUAL: Final = Path("keys")
_HOST: Final = re.compile(r"[A-Za-z0-9]([A-Za-z0-9.-]{0,251}[A-Za-z0-9])?")


def _hosts(given: list[str] | None) -> list[str] | None:
    """Accept names and addresses of hosts."""
    if bad := [host[:60] for host in given or [] if not _is_host(host)]:
        shown = " and ".join(repr(host) for host in bad)
        raise typer.BadParameter(f"{shown}: neither a name nor an address")
    return given


def _is_host(text: str) -> bool:
    """Return whether a text is a host's name or address.

    A text whose last label is a number is not a name (RFC 1123).
    """
    if ":" in text or text.rpartition(".")[2].isdecimal():
        try:
            ipaddress.ip_address(text)
        except ValueError:
            return False
        return True
    return _HOST.fullmatch(text) is not None


def _fits(name: str) -> bool:
    """Return whether a name is valid and can also name a folder."""
    return NAME.fullmatch(name) is not None and name.strip(".") != ""


def _all_named(names: list[str]) -> list[str]:
    """Accept names that can also name folders."""
    if bad := [name[:60] for name in names if not _fits(name)]:
        shown = " and ".join(repr(name) for name in bad)
        raise typer.BadParameter(f"{shown}: not a name of {NAME_IN_WORDS}")
    return names


Keys = Annotated[
    Path, typer.Option("--keys", metavar="DIR", help="Folder that `keys init` has made.")
]
Days = Annotated[int, typer.Option(min=1, max=3650, help="Days until the new keys expire.")]
Names = Annotated[
    list[str],
    typer.Argument(metavar="NAME...", callback=_all_named, help="One name or several."),
]
Hosts = Annotated[
    list[str] | None,
    typer.Option(
        "--host",
        callback=_hosts,
        help="Name or address under which the coordinator can be reached, in addition to those of "
        "this machine; repeatable.",
    ),
]


@keys_commands.command()
def init(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder to make.")] = _USUAL,
    host: Hosts = None,
    days: Days = 365,
) -> None:
    """Make a fleet's authority, and keys for its coordinator, an observer and an operator.

    Example: splinefleet keys init keys --host hall-3.local --host 192.168.7.2
    """
    from coordinator.security.key_store import KeyStore

    store = KeyStore(folder)
    store.begin(_now())
    made = store.issue("coordinator", ["coordinator"], _now(), days, host or ())
    for role in ("observer", "operator"):
        made += store.issue(role, [role], _now(), days)
    _tell_made(folder, made)
    tell(f"{folder / 'authority'} signs further keys: keep it secret; no fleet needs it to run")


@keys_commands.command()
def robot(
    names: Names,
    keys: Keys = _USUAL,
    days: Days = 365,
    may_join: Annotated[
        bool,
        typer.Option(
            "--may-join", help="Robots of no scenario, which join a fleet while it drives."
        ),
    ] = False,
) -> None:
    """Make keys for robots; give each robot its own folder and nothing else.

    Coordinators and routers let robots with keys made with --may-join in from their next start on.

    Example: splinefleet keys robot R1 R2 R3 --keys keys
    """
    _issue("robot", names, keys, days, may_join=may_join)


@keys_commands.command()
def observer(names: Names, keys: Keys = _USUAL, days: Days = 365) -> None:
    """Make keys for programs that only listen: record, view.

    Example: splinefleet keys observer office
    """
    _issue("observer", names, keys, days)


@keys_commands.command()
def operator(names: Names, keys: Keys = _USUAL, days: Days = 365) -> None:
    """Make keys for operators, who give orders, close places, and take robots in and out.

    Example: splinefleet keys operator shift-1
    """
    _issue("operator", names, keys, days)


@keys_commands.command()
def coordinator(keys: Keys = _USUAL, host: Hosts = None, days: Days = 365) -> None:
    """Make a new key for the coordinator, before the old one expires or when its hosts change.

    Example: splinefleet keys coordinator --host hall-3.local
    """
    _issue("coordinator", ["coordinator"], keys, days, tuple(host or ()))


@keys_commands.command()
def router(
    scenarios: Annotated[
        list[Path],
        typer.Argument(
            metavar="SCENARIO...", help="Scenarios of all fleets that connect to the router."
        ),
    ],
    keys: Keys = _USUAL,
    host: Annotated[
        list[str] | None,
        typer.Option(
            callback=_hosts,
            help="Name or address under which the router can be reached; makes a new key for it; "
            "repeatable.",
        ),
    ] = None,
    days: Days = 365,
    listen: Annotated[
        str, typer.Option(callback=reached, help="Endpoint on which the router listens.")
    ] = "tls/0.0.0.0:7447",
    files: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder of the router's keys on its host; by default the same path as here.",
        ),
    ] = None,
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.json5", callback=writable(".json5"))
    ] = Path("router.json5"),
) -> None:
    """Write the configuration of zenohd, the router.

    Run this command again whenever a key is made or revoked or a fleet gets a new robot.

    Example: splinefleet keys router hall.toml yard.toml --host router.local
    """
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.security.key_store import KeyStore
    from coordinator.security.router_file import meeting_fleets, router_file

    endpoint_of(listen, locked=True)
    register, now = KeyStore(keys).register(), _now()
    asked = [read_scenario(scenario) for scenario in scenarios]
    fleets = meeting_fleets(asked, register.joiners(now))
    if host:
        _issue("router", ["router"], keys, days, tuple(host or ()))
    elif "router" not in register.names("router"):
        raise InputError([f"{keys}: holds no key of a router; --host NAME makes one"])
    own = read_key_files(keys, "router")
    warnings = [own.warning(now)]
    warnings += register.keyless((name for robots in fleets.values() for name in robots), now)
    for warning in filter(None, warnings):
        tell(warning)
    write_file(output, router_file(listen, own.moved_to(files), fleets, register.valid(now)))
    tell(f"wrote {output}; it takes effect when the router is started with it")


@keys_commands.command()
def revoke(
    who: Annotated[
        str, typer.Argument(metavar="WHO", help="ROBOT, observer/NAME or operator/NAME.")
    ],
    keys: Keys = _USUAL,
    generation: Annotated[
        int | None,
        typer.Option(min=1, help="Revoke only the key of this number, as `keys show` lists it."),
    ] = None,
) -> None:
    """Revoke all keys that a name has now; the coordinator refuses them from its next start on.

    Example: splinefleet keys revoke R1
    """
    from coordinator.security.key_store import KeyStore

    role, name = _who(who)
    store = KeyStore(keys)
    hit = store.revoke(role, name, _now(), generation)
    if not hit:
        which = "" if generation is None else f" number {generation}"
        raise InputError([f"{who}: has no valid key{which}; splinefleet keys show lists all keys"])
    for one in hit:
        tell(f"{one.badge.who}: revoked; a running coordinator refuses it only after a restart")
    if hit:
        tell("for a router, run splinefleet keys router and restart it with the new file")


@keys_commands.command()
def show(keys: Keys = _USUAL, as_json: Json = False) -> None:
    """Show who has keys, until when, and which are revoked.

    Example: splinefleet keys show --keys keys
    """
    from rich.text import Text

    from coordinator.base.text_table import plain_table
    from coordinator.security.key_store import KeyStore

    issued, now = KeyStore(keys).register().issued, _now()
    if as_json:
        answer_json([_row(one, now) for one in issued])
        return
    table = plain_table("role", "name", "key", "expires", "state")
    for one in issued:
        table.add_row(*(Text(str(cell)) for cell in _row(one, now).values()))
    answers.print(table)


def _row(one: Issued, now: datetime.datetime) -> dict[str, str | int]:
    state = one.state(now)
    if one.may_join:
        state = f"{state}, may join"
    if one.revoked is not None:
        state = f"revoked {one.revoked:%Y-%m-%d}"
    elif one.state(now) == "valid" and one.expires - now <= WARNING:
        state = f"{state}, expires in {(one.expires - now).days} days"
    return {
        "role": one.role,
        "name": one.name,
        "key": one.generation,
        "expires": f"{one.expires:%Y-%m-%d}",
        "state": state,
    }


def _issue(
    role: Role,
    names: list[str],
    folder: Path,
    days: int,
    hosts: tuple[str, ...] = (),
    *,
    may_join: bool = False,
) -> None:
    from coordinator.security.key_store import KeyStore

    store = KeyStore(folder)
    made = store.issue(role, dict.fromkeys(names), _now(), days, hosts, may_join=may_join)
    _tell_made(folder, made)
    for badge in store.register().valid(_now()):
        latest = store.register().next_generation(role, badge.name) - 1
        if badge.role == role and badge.name in names and badge.generation < latest:
            tell(f"{badge.who}: the older key stays valid until it expires or is revoked")


def _tell_made(folder: Path, made: list[Issued]) -> None:
    for one in made:
        place = folder / own_place(one.role, one.name)
        tell(f"{one.badge.who}: {place}, until {one.expires:%Y-%m-%d}")


def _who(text: str) -> tuple[Role, str]:
    """Return the role and name that ROBOT or ROLE/NAME states; raise InputError if invalid."""
    head, _, rest = text.rpartition("/")
    role = next((role for role in ROLES if role == (head or "robot")), None)
    if role is None or not _fits(rest):
        raise InputError([f"{text[:60]!r} is not ROBOT, observer/NAME or operator/NAME"])
    if role in ("coordinator", "router"):
        text = "robots would not learn of it; make a new authority with splinefleet keys init"
        raise InputError([f"the {role}'s key cannot be revoked: {text}"])
    return role, rest


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)
