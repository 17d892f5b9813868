"""The `orders` and `demand` tables of a scenario file: where robots are wanted while they drive.

Decides: which keys an order and a demand may have and the default of each key that is absent, and
which keys are written.  Must not know: what makes orders valid (scenario/order_checks.py), or when
they are given.
"""

from __future__ import annotations

from typing import Any, Final, cast

import msgspec

from coordinator.scenario.checks import Quantity
from coordinator.scenario.model import Demand, Order, Pose
from coordinator.scenario_files.table_reader import MOST_PRIORITY, Table, read_place

MOST_ORDERS: Final = 100_000
MOST_PLACES: Final = 10_000
MOST_PER_ROBOT: Final = 1_000_000
MOST_SEED: Final = 2**32 - 1
ORDER_REQUIRED: Final = ("goal",)
DEMAND_REQUIRED: Final = ("places",)
ORDER_QUANTITIES: Final = {
    "release": Quantity("s", from_least=True),
    "dwell": Quantity("s", from_least=True),
}
DEMAND_QUANTITIES: Final = {
    "first_within": Quantity("s", from_least=True),
    "dwell": Quantity("s", from_least=True),
}


def read_orders(top: Table) -> tuple[Order, ...]:
    """Return the orders of a scenario; one that has no id is called after its place in the list."""
    orders = top.items("orders", "tables", MOST_ORDERS)
    return tuple(_order(order, index, top.problems) for index, order in enumerate(orders))


def _order(value: object, index: int, problems: list[str]) -> Order:
    table = Table(value, f"orders[{index}]", Order.__struct_fields__, ORDER_REQUIRED, problems)
    if table.values.keys() >= {"release", "after"}:
        table.note("after", "is given as well as release; give only one")
    return Order(
        id=table.name("id") if "id" in table.values else f"order-{index + 1}",
        robot=table.name("robot"),
        after=table.name("after"),
        goal=cast(Pose, table.place("goal", 2, 3)),
        via=table.points("via"),
        priority=table.whole("priority", -MOST_PRIORITY, MOST_PRIORITY, default=0),
        **table.numbers(ORDER_QUANTITIES),
    )


def read_demand(top: Table) -> Demand | None:
    """Return the demand of a scenario; None if it has none."""
    if "demand" not in top.values:
        return None
    value, problems = top.values["demand"], top.problems
    table = Table(value, "demand", Demand.__struct_fields__, DEMAND_REQUIRED, problems)
    places = table.items("places", "places [[x, y], ...]", MOST_PLACES)
    if table.values.get("places") == []:
        table.note("places", "is empty; robots need places to go to")
    return Demand(
        places=tuple(
            cast(Pose, read_place(place, f"demand.places[{i}]", (2, 3), problems))
            for i, place in enumerate(places)
        ),
        per_robot=table.whole("per_robot", 1, MOST_PER_ROBOT, default=1),
        seed=table.whole("seed", 0, MOST_SEED, default=0),
        **table.numbers(DEMAND_QUANTITIES),
    )


def stated(table: Order | Demand) -> dict[str, Any]:
    """Return the fields that a file has to state: those that differ from their defaults."""
    fields = {field.name: field.default for field in msgspec.structs.fields(table)}
    values = {name: getattr(table, name) for name in fields}
    return {name: value for name, value in values.items() if value != fields[name]}
