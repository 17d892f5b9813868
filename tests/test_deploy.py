"""The files of docs/deploy: what they call exists, and the router's settings are Zenoh's."""

import json
import re
import shlex

import pytest
import typer.main
import zenoh

from protocol.zenoh_transport import router_settings
from splinefleet import app
from tests.test_readme import ROOT

DEPLOY = ROOT / "docs" / "deploy"
UNITS = sorted(path for path in DEPLOY.glob("*.service") if path.name.startswith("splinefleet-"))
MAIN = typer.main.get_command(app)


def settings(unit):
    """The lines of a unit, NAME=VALUE, those that go on joined."""
    text = re.sub(r"\\\n\s*", " ", unit.read_text())
    return re.findall(r"^(\w+)=(.*)$", text, re.MULTILINE)


def command_of(unit):
    """The words of a unit's command as systemd and the shell make them, from `splinefleet` on."""
    found = settings(unit)
    (line,) = (value for name, value in found if name == "ExecStart")
    for name, value in found:
        if name == "Environment":
            for word in shlex.split(value):
                variable, _, content = word.partition("=")
                line = line.replace(f"${{{variable}}}", content)
    line = line.replace("%i", "R1").replace("$$(date +%%Y%%m%%dT%%H%%M%%S)", "20260101T000000")
    assert not re.search(r"[$%]", line), line
    words = shlex.split(line)
    if words[:2] == ["/bin/sh", "-c"]:
        words = shlex.split(words[2].removeprefix("exec "))
    return words


def parsed(words):
    """The command's name and options; an unknown option or a wrong value raises."""
    assert words[0].endswith("/splinefleet")
    context = MAIN.make_context("splinefleet", words[1:2])
    command = MAIN.get_command(context, words[1])
    return words[1], command.make_context(words[1], words[2:], parent=context).params


@pytest.mark.parametrize("unit", UNITS, ids=lambda unit: unit.name)
def test_a_units_command_line_is_one_of_ours(unit):
    name, options = parsed(command_of(unit))
    assert name in ("coordinator", "agent", "record")
    assert options["connect"] == "tcp/127.0.0.1:7447"


def test_a_unit_is_there_for_each_of_the_three_programs():
    assert {parsed(command_of(unit))[0] for unit in UNITS} == {"coordinator", "agent", "record"}


def test_a_robot_that_is_refused_is_not_started_again_and_again():
    (agent,) = (unit for unit in UNITS if "@" in unit.name)
    found = dict(settings(agent))
    assert (found["Restart"], found["RestartPreventExitStatus"]) == ("always", "2")
    assert parsed(command_of(agent))[1]["robot"] == "R1"


def test_the_routers_settings_are_taken_by_zenoh_and_nobody_is_looked_for():
    config = zenoh.Config.from_file(str(DEPLOY / "router.json5"))
    for name, value in {
        "mode": "router",
        "listen/endpoints": ["tcp/0.0.0.0:7447"],
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/link/tx/lease": 1000,
        "transport/shared_memory/enabled": False,
    }.items():
        assert json.loads(config.get_json(name)) == value, name
    ours = zenoh.Config()
    ours.insert_json5("qos/network", json.dumps(router_settings("")["qos/network"]))
    assert config.get_json("qos/network") == ours.get_json("qos/network")


def test_settings_to_copy_are_values_alone_since_systemd_keeps_a_comment_behind_one():
    page = (ROOT / "docs" / "deploy.md").read_text()
    lines = re.findall(r"^[A-Z]+=.*$", page, re.MULTILINE)
    assert len(lines) == 5
    assert [line for line in lines if re.search(r"[#\s]", line)] == []


def test_the_page_on_deployment_names_every_file():
    page = (ROOT / "docs" / "deploy.md").read_text()
    for file in DEPLOY.iterdir():
        assert f"(deploy/{file.name})" in page, file.name
