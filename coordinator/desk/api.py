"""The table of what a program can ask over HTTP; routes and the OpenAPI document come from it.

Decides: paths, methods, bodies, answers and who may use them.  Must not know: how requests travel.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any, Final, NamedTuple

import msgspec

from coordinator.desk.answers import FleetAnswer, Phase, Place, PreviewAnswer, Told
from coordinator.desk.bodies import BlockBody, JoinBody, NoBody, OrderBody
from coordinator.desk.commands import Commands
from coordinator.desk.rights import Right
from coordinator.exchange.vda5050_state import State
from coordinator.findings.info_fields import OrderSummary

Handler = Callable[[Commands, str, Any, str], Awaitable[object]]
"""Called as handler(commands, name in the path, body, who sends it)."""


class Endpoint(NamedTuple):
    """A method on a path; `answer`: the type of the answer; `statuses`: what else may come.

    `takes_any`: whatever the body is, it is not looked at.
    """

    method: str
    path: str
    summary: str
    answer: Any
    handler: Handler
    body: type[msgspec.Struct] = NoBody
    right: Right = Right.COMMAND
    status: int = 200
    statuses: tuple[int, ...] = ()
    takes_any: bool = False


async def _now(answer: object) -> object:
    return answer


def _acknowledged(commands: Commands, name: str) -> FleetAnswer:
    commands.acknowledge(name)
    return commands.fleet()


_ASKED = (409, 504)
ENDPOINTS: Final = (
    Endpoint(
        "GET",
        "/api/fleet",
        "The fleet as it is known",
        FleetAnswer,
        lambda commands, *_: _now(commands.fleet()),
        right=Right.LOOK,
    ),
    Endpoint(
        "GET",
        "/api/orders",
        "All orders",
        list[OrderSummary],
        lambda commands, *_: _now(commands.orders()),
        right=Right.LOOK,
    ),
    Endpoint(
        "GET",
        "/api/orders/{name}",
        "One order",
        OrderSummary,
        lambda commands, name, *_: _now(commands.order(name)),
        right=Right.LOOK,
        statuses=(404,),
    ),
    Endpoint(
        "POST",
        "/api/orders",
        "Give an order",
        OrderSummary,
        lambda commands, _, body, by: commands.give_order(body, by),
        OrderBody,
        status=201,
        statuses=_ASKED,
    ),
    Endpoint(
        "POST",
        "/api/preview",
        "Ask what an order would come to, without giving it",
        PreviewAnswer,
        lambda commands, _, body, __: commands.preview(body),
        OrderBody,
        right=Right.LOOK,
        statuses=_ASKED,
    ),
    Endpoint(
        "DELETE",
        "/api/orders/{name}",
        "Take an order back",
        OrderSummary,
        lambda commands, name, _, by: commands.cancel(name, by),
        statuses=(404, *_ASKED),
    ),
    Endpoint(
        "POST",
        "/api/freeze",
        "Stop the fleet at once",
        Phase,
        lambda commands, _, __, by: commands.freeze(by),
        statuses=_ASKED,
        takes_any=True,
    ),
    Endpoint(
        "POST",
        "/api/resume",
        "Let a fleet that was stopped go on",
        Phase,
        lambda commands, _, __, by: commands.resume(by),
        statuses=_ASKED,
    ),
    Endpoint(
        "POST",
        "/api/end",
        "End the mission when all rest",
        Phase,
        lambda commands, _, __, by: commands.end(by),
        status=202,
        statuses=_ASKED,
    ),
    Endpoint(
        "POST",
        "/api/robots/{name}/admit",
        "Let a robot that came back take part again",
        Told,
        lambda commands, name, _, by: commands.admit(name, by),
        statuses=(404, *_ASKED),
    ),
    Endpoint(
        "POST",
        "/api/robots/{name}/join",
        "Take a robot into the fleet",
        Told,
        lambda commands, name, body, by: commands.join(name, body, by),
        JoinBody,
        status=202,
        statuses=(404, *_ASKED),
    ),
    Endpoint(
        "POST",
        "/api/robots/{name}/leave",
        "Take a robot out of the fleet",
        Told,
        lambda commands, name, _, by: commands.leave(name, by),
        statuses=(404, *_ASKED),
    ),
    Endpoint(
        "GET",
        "/api/blocks",
        "The places that are closed",
        list[Place],
        lambda commands, *_: _now(commands.blocks()),
        right=Right.LOOK,
    ),
    Endpoint(
        "POST",
        "/api/blocks",
        "Close a place of the floor",
        Place,
        lambda commands, _, body, by: commands.block(body, by),
        BlockBody,
        status=201,
        statuses=_ASKED,
    ),
    Endpoint(
        "DELETE",
        "/api/blocks/{name}",
        "Open a place again",
        Place,
        lambda commands, name, _, by: commands.unblock(name, by),
        statuses=(404, *_ASKED),
    ),
    Endpoint(
        "GET",
        "/api/vda5050",
        "VDA 5050 state messages of all robots",
        list[State],
        lambda commands, *_: _now(commands.states()),
        right=Right.LOOK,
    ),
    Endpoint(
        "GET",
        "/api/vda5050/{name}",
        "The VDA 5050 state message of one robot",
        State,
        lambda commands, name, *_: _now(commands.states(name)[0]),
        right=Right.LOOK,
        statuses=(404,),
    ),
    Endpoint(
        "POST",
        "/api/alarms/{name}/acknowledge",
        "Say that somebody has seen an alarm",
        FleetAnswer,
        lambda commands, name, *_: _now(_acknowledged(commands, name)),
        statuses=(404,),
    ),
)
