"""The commands by which an operator gives orders to a running fleet, stops it and ends it.

Decides: their options and exit codes.
"""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Annotated, Final, NamedTuple

import msgspec
import typer

from coordinator.base.console import answer_json, answers, tell
from coordinator.cli.fleet_line import Connect, FleetLine, FleetName, Patience, fleet_line
from coordinator.cli.option_checks import (
    given,
    named,
    not_with,
    numbers_of,
    only_with,
    place_of,
    within,
)
from coordinator.cli.plan_commands import Json
from coordinator.service.key_option import Keys
from protocol import keys as keys_of
from protocol.messages import (
    CANCELLED,
    END,
    GO_ON,
    HALT,
    MOST_PRIORITY,
    MOST_VIAS,
    ORDER_DONE,
    REFUSED,
    WAITING,
    Cancel,
    Command,
    Message,
    Order,
    OrderState,
    Tell,
)
from protocol.phases import COMMAND_NAMES, FREEZE, GO, HOLD, OVER, STOP

commands = typer.Typer()

_STANDS: Final = {
    HOLD: "the fleet has not set out yet",
    STOP: "the fleet is stopped: splinefleet resume lets it go on",
}
"""Why all orders wait, by the phase of the fleet."""

_IN_FILE: Final = ", because the file states it"
_SETTLES_S: Final = 1.5
"""For so long an order is waited for to be begun or refused, so that its first answer says more."""
_SAYS_STOP: Final = 4
"""A STOP to a fleet that stands is said until so many Commands were heard: two or three times."""


def _one_source(context: typer.Context, file: Path | None) -> Path | None:
    """Accept --vda5050 in place of --to, and one of the two."""
    if given(context, "to") == given(context, "vda5050"):
        raise typer.BadParameter("give a place, or --vda5050 FILE", param_hint="--to")
    return file


def _few_vias(via: list[str] | None) -> list[str] | None:
    """Accept a list of places X,Y that fits into an Order."""
    if len(via or []) > MOST_VIAS:
        raise typer.BadParameter(f"more than {MOST_VIAS} places")
    for place in via or []:
        numbers_of(place, 2)
    return via


@commands.command(rich_help_panel="Operate")
def order(
    connect: Connect,
    to: Annotated[
        str | None,
        typer.Option(callback=place_of(2, 3), help="X,Y or X,Y,HEADING in m and rad."),
    ] = None,
    vda5050: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            callback=_one_source,
            help="A VDA 5050 order: its robot, released nodes and wait.",
        ),
    ] = None,
    fleet: FleetName = None,
    robot: Annotated[
        str | None,
        typer.Option(callback=named, help="Which robot; by default the coordinator chooses."),
    ] = None,
    via: Annotated[
        list[str] | None,
        typer.Option(
            callback=not_with("vda5050", why=_IN_FILE, check=_few_vias),
            help="X,Y to pass on the way; repeatable, in order.",
        ),
    ] = None,
    dwell: Annotated[
        float,
        typer.Option(
            callback=not_with("vda5050", why=_IN_FILE, check=within(0.0, 86_400.0)),
            help="Seconds that it stands at the goal.",
        ),
    ] = 0.0,
    priority: Annotated[
        int,
        typer.Option(
            min=-MOST_PRIORITY,
            max=MOST_PRIORITY,
            help="Of orders that wait, the higher goes first.",
        ),
    ] = 0,
    order_id: Annotated[
        str | None,
        typer.Option("--id", callback=named, help="The same id again is the same order."),
    ] = None,
    now: Annotated[
        bool,
        typer.Option(
            "--now",
            callback=only_with("robot", "vda5050"),
            help="The robot leaves what it does for this order.",
        ),
    ] = False,
    wait: Annotated[
        bool, typer.Option("--wait", help="Wait until the order is over; tell its states.")
    ] = False,
    patience: Patience = 20.0,
    keys: Keys = None,
    as_json: Json = False,
) -> None:
    """Give an order to a running fleet and print what becomes of it.

    A robot's second order waits behind its first.  The exit code is 1 if the order is refused or
    cancelled, if its id is that of another order, or if no coordinator is heard for --patience.

    Example: splinefleet order --connect tcp/127.0.0.1:7447 --to 9,5 --robot R1 --wait
    """
    wanted = _wanted(to, via or [], dwell, vda5050)
    name, whose = order_id or wanted.id, robot or wanted.robot
    state: OrderState | None = None
    is_over = False
    with fleet_line(connect, fleet, patience, keys) as line:
        wish = Order(
            boot=line.boot,
            id=name,
            goal=wanted.goal,
            robot=whose,
            via=wanted.via,
            dwell_ms=round(1000.0 * wanted.dwell),
            priority=priority,
            now=now,
        )
        began = time.monotonic()

        def say(known: str) -> None:
            if state is None:
                line.put(keys_of.order(known), wish)

        for message in line.messages(say, lasts=wait):
            _refuse_another(message, wish)
            if isinstance(message, OrderState) and message.id == name:
                before, state = state, message
                is_over = state.state in (ORDER_DONE, CANCELLED, REFUSED)
                if is_over:
                    break
                if wait:
                    _tell_change(before, state)
            settled = state is not None and state.state != WAITING
            is_late = state is not None and time.monotonic() - began > _SETTLES_S
            if not wait and (settled or is_late):
                break
            if state is None and time.monotonic() - began > patience:
                break
            if line.phase == OVER and state is not None:
                break
    if state is None:
        raise line.unanswered(f"order {name}")
    if state.state == WAITING:
        _tell_why_all_wait(line)
    _conclude(name, state, as_json)
    _fail_if_cut_off(wait and not is_over)


def _tell_why_all_wait(line: FleetLine) -> None:
    if line.phase in _STANDS:
        tell(_STANDS[line.phase], "yellow")


def _refuse_another(message: Message, wish: Order) -> None:
    """Exit with code 1 if a message says that the id is that of another order."""
    if isinstance(message, Order) and (message.id, message.boot) == (wish.id, wish.boot):
        from coordinator.view.order_lines import another_order

        tell(another_order(message), "red")
        raise typer.Exit(1)


def _fail_if_cut_off(is_cut_off: bool) -> None:
    """Exit with code 1 if an order that is waited for is not over."""
    if is_cut_off:
        tell("the coordinator has ended, or is not heard any more", "red")
        raise typer.Exit(1)


def _tell_change(before: OrderState | None, now: OrderState) -> None:
    """Tell what becomes of an order, but not each new estimate of its arrival."""
    from coordinator.view.order_lines import order_line

    known = None if before is None else (before.state, before.robot, before.reason)
    if known != (now.state, now.robot, now.reason):
        tell(order_line(now))


class _Wanted(NamedTuple):
    """Where a robot is wanted, as options or a file say: places [m], and how long it stays [s]."""

    id: str
    robot: str
    goal: tuple[float, ...]
    via: tuple[tuple[float, float], ...]
    dwell: float


def _wanted(to: str | None, via: list[str], dwell: float, file: Path | None) -> _Wanted:
    if file is not None:
        return _read_wanted(file)
    goal = numbers_of(to or "", 2, 3)
    places = [numbers_of(one, 2) for one in via]
    name = f"order-{os.urandom(4).hex()}"
    return _Wanted(name, "", goal, tuple((x, y) for x, y in places), dwell)


def _read_wanted(file: Path) -> _Wanted:
    """Return what a VDA 5050 order wants; raise InputError with all that is wrong with it."""
    from coordinator.base.errors import InputError
    from coordinator.exchange.vda5050_wishes import read_wished

    problems: list[str] = []
    try:
        found = read_wished(file.read_bytes(), str(file), problems)
    except OSError as error:
        raise InputError([f"{file}: {error.strerror}"]) from None
    if found is None:
        raise InputError(problems)
    if found.later:
        tell(f"{found.later} nodes are not released yet, and are left out")
    return _Wanted(*found[:-1])


def _conclude(name: str, state: OrderState, as_json: bool) -> None:
    from coordinator.findings.info_fields import OrderSummary

    shown = OrderSummary.of(state)
    if as_json:
        answer_json(shown)
    else:
        why = f": {shown.reason}" if shown.reason else ""
        robot = shown.robot or ("no robot yet" if state.state == WAITING else "")
        words = " ".join(filter(None, (name, robot, shown.state)))
        answers.print(f"{words}{why}", markup=False)
    if state.state in (CANCELLED, REFUSED):
        raise typer.Exit(1)


@commands.command(rich_help_panel="Operate")
def orders(
    connect: Connect,
    fleet: FleetName = None,
    patience: Patience = 5.0,
    keys: Keys = None,
    as_json: Json = False,
) -> None:
    """List all orders of a running fleet and what has become of them.

    Example: splinefleet orders --connect tcp/127.0.0.1:7447
    """
    with fleet_line(connect, fleet, patience, keys) as line:
        states = line.states()
        line.must_be_heard()
    _tell_why_all_wait(line)
    from coordinator.findings.info_fields import OrderSummary
    from coordinator.findings.info_table import orders_table

    found = [OrderSummary.of(state) for state in states.values()]
    found.sort(key=lambda one: (one.released or 0.0, one.id))
    if as_json:
        answer_json(msgspec.to_builtins(found))
    elif found:
        answers.print(orders_table(found))
    else:
        tell(f"{line.fleet} has no orders")


@commands.command(rich_help_panel="Operate")
def cancel(
    order_id: Annotated[
        str, typer.Argument(metavar="ORDER", callback=named, help="The id of the order.")
    ],
    connect: Connect,
    fleet: FleetName = None,
    patience: Patience = 20.0,
    keys: Keys = None,
    as_json: Json = False,
) -> None:
    """Take an order back.

    The exit code is 1 if there is no such order, or if it is done already.

    Example: splinefleet cancel o1 --connect tcp/127.0.0.1:7447
    """
    from coordinator.findings.info_fields import OrderSummary

    name = order_id

    def is_over(answer: Message) -> bool:
        if not isinstance(answer, OrderState) or answer.id != name:
            return False
        return answer.state in (ORDER_DONE, CANCELLED, REFUSED)

    with fleet_line(connect, fleet, patience, keys) as line:
        state = line.ask_until(keys_of.order, Cancel(line.boot, name), is_over)
    if not isinstance(state, OrderState):
        raise line.unanswered()
    if state.state == CANCELLED:
        why = f": {state.reason}" if state.reason else ""
        tell(f"{name} is cancelled{why}")
        if as_json:
            answer_json(OrderSummary.of(state))
        return
    why = f": {state.reason}" if state.reason else f" is {OrderSummary.of(state).state} already"
    tell(f"{name}{why}", "red")
    raise typer.Exit(1)


def _tell_fleet(
    what: int, wanted: tuple[int, ...], connect: str, fleet: str | None, patience: float, keys: Keys
) -> None:
    """Tell the fleet something until its Commands state one of these phases.

    A fleet that has yet to set out takes a STOP without an answer: it is said several times.
    """
    phase: int | None = None
    heard = 0
    with fleet_line(connect, fleet, patience, keys) as line:

        def say(known: str) -> None:
            line.put(keys_of.tell(known), Tell(line.boot, what))

        for message in line.messages(say):
            if isinstance(message, Command):
                phase = message.phase
                heard += what == HALT and phase in (HOLD, FREEZE)
                if phase in wanted or heard >= _SAYS_STOP:
                    later = "" if phase in wanted else "; it will not set out before a resume"
                    tell(f"{line.fleet}: {COMMAND_NAMES[phase]}{later}")
                    return
    if phase is None:
        raise line.unanswered()
    tell(f"{line.fleet} has been told; it is still {COMMAND_NAMES[phase]}", "red")
    raise typer.Exit(1)


@commands.command(rich_help_panel="Operate")
def freeze(
    connect: Connect, fleet: FleetName = None, patience: Patience = 20.0, keys: Keys = None
) -> None:
    """Stop a fleet at once; its robots keep their courses.

    Example: splinefleet freeze --connect tcp/127.0.0.1:7447
    """
    _tell_fleet(HALT, (STOP, OVER), connect, fleet, patience, keys)


@commands.command(rich_help_panel="Operate")
def resume(
    connect: Connect, fleet: FleetName = None, patience: Patience = 20.0, keys: Keys = None
) -> None:
    """Let a fleet that was stopped go on where it was.

    Example: splinefleet resume --connect tcp/127.0.0.1:7447
    """
    _tell_fleet(GO_ON, (GO, OVER), connect, fleet, patience, keys)


@commands.command(rich_help_panel="Operate")
def end(
    connect: Connect, fleet: FleetName = None, patience: Patience = 600.0, keys: Keys = None
) -> None:
    """End a fleet's mission: it takes no further orders, and ends when all robots rest.

    The exit code is 1 if that is not so within --patience; it ends later then.

    Example: splinefleet end --connect tcp/127.0.0.1:7447
    """
    _tell_fleet(END, (OVER,), connect, fleet, patience, keys)
