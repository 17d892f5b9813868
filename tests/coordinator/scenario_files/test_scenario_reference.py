"""The tables of docs/scenarios.md against the keys, defaults and ranges that the code has."""

import re
from pathlib import Path

import msgspec
import pytest

from coordinator.scenario import checks, model, order_checks
from coordinator.scenario.model import Demand, GivenPath, Link, Order, Robot, Scenario
from coordinator.scenario_files import (
    orders_table,
    path_table,
    scenario_reader,
    table_reader,
    workspace_reader,
)

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "scenarios.md").read_text()
TABLES = {
    "The scenario": (Scenario, checks.SCENARIO_QUANTITIES),
    "`[link]`": (Link, scenario_reader.LINK_QUANTITIES),
    "`[workspace]`": (None, workspace_reader.MAP_QUANTITIES),
    "`[[robots]]`": (Robot, checks.ROBOT_QUANTITIES),
    "`path` of a robot": (GivenPath, path_table.ROUNDING),
    "`[[orders]]`": (Order, orders_table.ORDER_QUANTITIES),
    "`[demand]`": (Demand, orders_table.DEMAND_QUANTITIES),
}


def rows(title):
    """Key, unit, default and what is allowed of each row below a title."""
    part = PAGE.split(f"\n## {title}\n")[1].split("\n## ")[0]
    found = re.findall(r"^\| `(\w+)` \|(.*?)\|(.*?)\|(.*?)\|", part, re.MULTILINE)
    return {key: [cell.strip() for cell in cells] for key, *cells in found}


@pytest.mark.parametrize("title", TABLES)
def test_every_key_stands_in_its_table_and_no_other(title):
    struct, _ = TABLES[title]
    known = workspace_reader.KEYS if struct is None else struct.__struct_fields__
    assert sorted(rows(title)) == sorted(known)


@pytest.mark.parametrize("title", [title for title, (struct, _) in TABLES.items() if struct])
def test_defaults_are_those_of_the_code(title):
    table = rows(title)
    for field in msgspec.structs.fields(TABLES[title][0]):
        told = table[field.name][1]
        if isinstance(field.default, str | int | float) and field.default != "":
            assert told.strip('`"') == str(field.default)
        elif told == "required":
            assert field.required


def test_what_is_required_is_told_so():
    required = {
        "The scenario": scenario_reader.SCENARIO_REQUIRED,
        "`[[robots]]`": scenario_reader.ROBOT_REQUIRED,
        "`path` of a robot": path_table.PATH_REQUIRED,
        "`[[orders]]`": orders_table.ORDER_REQUIRED,
        "`[demand]`": orders_table.DEMAND_REQUIRED,
    }
    for title, keys in required.items():
        assert {key for key, row in rows(title).items() if row[1] == "required"} == set(keys)


@pytest.mark.parametrize("title", TABLES)
def test_units_and_ranges_are_those_of_the_code(title):
    for key, quantity in TABLES[title][1].items():
        unit, _, allowed = rows(title)[key]
        assert unit == quantity.unit
        limits = [float(number) for number in re.findall(r"\d[\d.]*", allowed.split(",")[0])]
        assert limits[0] == quantity.least
        assert ("above" in allowed) == (not quantity.from_least)
        most = limits[1] if len(limits) > 1 else checks.LARGEST
        assert most == quantity.most
        assert ("below" in allowed) == quantity.below_most
        assert (f"`{quantity.word}`" in allowed.replace('"', "")) == bool(quantity.word)


def test_limits_of_whole_files_are_those_of_the_code():
    text = " ".join(PAGE.split())
    assert f"1 to {model.MOST_ROBOTS:,} tables" in text
    assert text.count(f"-{table_reader.MOST_PRIORITY:,} to {table_reader.MOST_PRIORITY:,}") == 2
    assert f"up to {orders_table.MOST_ORDERS:,} tables" in text
    assert f"{order_checks.LEAST_FREE} to {orders_table.MOST_PLACES:,} of them" in text
    assert f"1 to {orders_table.MOST_PER_ROBOT:,}" in text
    assert f"0 to {orders_table.MOST_SEED:,}" in text
    assert f"numbers go up to {checks.LARGEST:,.0f}" in text
    assert f"coordinates up to {checks.FARTHEST:,.0f} m each way" in text
