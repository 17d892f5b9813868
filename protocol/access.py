"""Who may send and receive what: the table of roles, and Zenoh's access control made from it.

Decides: the keys of each role; whatever is not in the table is refused.  Must not know: files,
certificates, links.

Zenoh compares common names literally, without patterns.  An empty list of common names would match
everybody, so a role that nobody has gets no policy at all.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from itertools import chain
from typing import Any, Final, NamedTuple

from protocol import keys
from protocol.badge import Badge

_EVERY_FLEET: Final = "*"

_TOLD: Final = (keys.command, *keys.TOLD)
"""Keys of a fleet that its coordinator hears, besides those of robots."""


class Rights(NamedTuple):
    """The key expressions on which a party may act, by what it may do on them.

    It may put messages on `puts`, declare itself alive on `alive`, and subscribe to `subscribes`;
    it receives what others put on `hears`.  It may watch the liveliness of `watches`, send queries
    on `asks`, and answer queries on `answers`.
    """

    puts: tuple[str, ...] = ()
    alive: tuple[str, ...] = ()
    subscribes: tuple[str, ...] = ()
    hears: tuple[str, ...] = ()
    watches: tuple[str, ...] = ()
    asks: tuple[str, ...] = ()
    answers: tuple[str, ...] = ()


def robot_rights(fleet: str, robot: str) -> Rights:
    """Return the rights of a robot: to send as itself, and receive its plan, clock and command.

    It may subscribe to every fleet's command, to learn its fleet's name, but receives only this
    fleet's.
    """
    own = (keys.plan(fleet, robot), keys.clock(fleet, robot), keys.command(fleet))
    return Rights(
        puts=tuple(kind(fleet, robot) for kind in (keys.hello, keys.report, keys.clock)),
        alive=(keys.alive(fleet, robot),),
        subscribes=(*own, keys.command(_EVERY_FLEET)),
        hears=own,
    )


def observer_rights(fleet: str) -> Rights:
    """Return the rights of a listener: to receive everything of the fleet, and to ask for it.

    It may ask for the plans, for what has become of the orders, and for closed places.
    """
    everything = f"{keys.ROOT}/{fleet}/**"
    return Rights(
        subscribes=(f"{keys.ROOT}/**",),
        hears=(everything,),
        watches=(everything,),
        asks=tuple(kind(fleet, "*") for kind in (keys.plan, keys.orders, keys.blocks)),
    )


def operator_rights(fleet: str, robots: Iterable[str]) -> Rights:
    """Return the rights of an operator: those of a listener, to admit robots, to give orders.

    Its keys contain no wildcard for the robot: Zenoh 1.10 crashes when it forwards a key longer
    than 65,535 bytes.
    """
    listener = observer_rights(fleet)
    admits = (keys.admit(fleet, robot) for robot in robots)
    return listener._replace(puts=(*admits, *(kind(fleet) for kind in keys.TOLD)))


def rights_of(fleet: str, robots: Iterable[str], badge: Badge) -> Rights | None:
    """Return the rights of a badge in a fleet of these robots; None when it has none."""
    robots = tuple(robots)
    if badge.role == "robot" and badge.name in robots:
        return robot_rights(fleet, badge.name)
    if badge.role == "observer":
        return observer_rights(fleet)
    return operator_rights(fleet, robots) if badge.role == "operator" else None


def coordinator_rights(fleet: str) -> Rights:
    """Return the rights of a coordinator at a router: to command, to answer, and to hear its fleet.

    It receives the command too, so that one of two coordinators of a fleet can give way.
    """
    hears = [kind(fleet, "*") for kind in (keys.hello, keys.report, keys.clock, keys.admit)]
    hears += [kind(fleet) for kind in _TOLD]
    told = [kind(fleet, "*") for kind in (keys.plan, keys.clock, keys.orders, keys.blocks)]
    return Rights(
        puts=(keys.command(fleet), *told),
        subscribes=tuple(hears),
        hears=tuple(hears),
        watches=(keys.alive(fleet, "*"),),
        answers=(keys.plan(fleet, "*"), keys.orders(fleet, "*"), keys.blocks(fleet, "*")),
    )


def router_rights(fleets: Mapping[str, Collection[str]], badge: Badge) -> Rights | None:
    """Return the rights of a badge at a router that serves these fleets; None when it has none.

    A robot's name must be in one fleet only, because a badge does not name the fleet.
    """
    if badge.role == "coordinator":
        found = [coordinator_rights(fleet) for fleet in fleets]
    else:
        rights = (rights_of(fleet, robots, badge) for fleet, robots in fleets.items())
        found = [right for right in rights if right is not None]
    if not found:
        return None
    return Rights(*(tuple(dict.fromkeys(chain(*parts))) for parts in zip(*found, strict=True)))


def player_rights(badge: Badge) -> Rights | None:
    """Return the rights of a badge where a log is played: only observers may receive it."""
    return Rights(subscribes=("**",), hears=("**",)) if badge.role == "observer" else None


def access_control(rights: Iterable[tuple[Badge, Rights]]) -> dict[str, Any]:
    """Return Zenoh's `access_control` that gives these badges these rights, and others none."""
    rules: list[dict[str, Any]] = []
    subjects: list[dict[str, Any]] = []
    policies: list[dict[str, Any]] = []
    for badge, right in rights:
        who = badge.common_name
        own = _rules(who, right)
        rules += own
        subjects.append({"id": who, "cert_common_names": [who], "link_protocols": ["tls"]})
        names = [rule["id"] for rule in own]
        policies.append({"id": who, "rules": names, "subjects": [who]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }


def _rules(who: str, rights: Rights) -> list[dict[str, Any]]:
    """Return the rules of one badge; `ingress` is what it sends, `egress` what it receives."""
    wanted = (
        ("puts", "ingress", ["put"], rights.puts),
        ("alive", "ingress", ["liveliness_token"], rights.alive),
        ("subscribes", "ingress", ["declare_subscriber"], rights.subscribes),
        ("hears", "egress", ["put"], rights.hears),
        (
            "watches",
            "ingress",
            ["declare_liveliness_subscriber", "liveliness_query"],
            rights.watches,
        ),
        ("sees", "egress", ["liveliness_token"], rights.watches),
        ("asks", "ingress", ["query"], rights.asks),
        ("learns", "egress", ["reply"], rights.asks),
        ("offers", "ingress", ["declare_queryable"], rights.answers),
        ("is asked", "egress", ["query"], rights.answers),
        ("answers", "ingress", ["reply"], rights.answers),
    )
    return [
        {
            "id": f"{who} {name}",
            "permission": "allow",
            "flows": [flow],
            "messages": messages,
            "key_exprs": list(expressions),
        }
        for name, flow, messages, expressions in wanted
        if expressions
    ]
