"""Operators' commands about orders and places by their names, some of which the fleet knows."""

from contextlib import contextmanager

import pytest
from typer.testing import CliRunner

from coordinator.cli import block_commands, order_commands
from coordinator.cli.fleet_line import FleetLine
from protocol import keys
from protocol.messages import UNDER_WAY, Block, Order, OrderState, Unblock
from tests.coordinator.desk.fake_fleet import FLEET, FakeFleet

WET = Block(9, "wet", ((1.0, 1.0), (2.0, 1.0), (2.0, 2.0)))


class KnownFleet(FakeFleet):
    """A fleet that has an order, first, and a closed place, wet."""

    def ask(self, key_expression, _handler):
        state = OrderState("first", UNDER_WAY, "R1")
        known = {keys.orders(FLEET, "first"): state, keys.blocks(FLEET, "wet"): WET}
        for key, message in known.items():
            if keys.fits(key_expression.split("/"), key.split("/")):
                self.tell(key, message)
        self.beat()


@pytest.fixture
def fleet(monkeypatch):
    found = KnownFleet()

    @contextmanager
    def line(_connect, _fleet, patience, _keys):
        yield FleetLine(found, FLEET, patience, "")

    for module in (order_commands, block_commands):
        monkeypatch.setattr(module, "fleet_line", line)
    return found


def invoke(commands, line):
    answer = CliRunner().invoke(commands, [*line.split(), "--connect", "tcp/127.0.0.1:9"])
    return answer.exit_code, " ".join(answer.output.split())


def test_a_place_that_is_not_closed_is_not_opened(fleet):
    told = "no place dry is closed; closed are wet"
    assert invoke(block_commands.commands, "unblock dry --patience 3") == (1, told)
    assert invoke(block_commands.commands, "unblock wet --patience 3") == (0, "wet is open")
    assert [one.id for one in fleet.said if isinstance(one, Unblock)][-1] == "wet"


def test_whoever_gives_an_order_with_the_id_of_another_one_is_told_where_that_one_leads(fleet):
    code, said = invoke(order_commands.commands, "order --to 3,1 --id taken --patience 3")
    assert code == 1
    assert said.endswith("taken is another order for R1, to (9, 5); use another id")
    assert any(isinstance(one, Order) and one.id == "taken" for one in fleet.said)
