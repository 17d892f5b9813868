"""The commands `splinefleet keys ...`: what they leave and what they say."""

import json

import pytest
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.keys_commands import keys_commands
from protocol.key_files import read_key_files


def run(*arguments):
    return CliRunner().invoke(keys_commands, [str(one) for one in arguments])


def ran(*arguments):
    done = run(*arguments)
    assert done.exit_code == 0, done.output
    return done


@pytest.fixture
def folder(tmp_path):
    ran("init", tmp_path / "keys", "--host", "hall.local", "--host", "192.0.2.7")
    return tmp_path / "keys"


def states(folder):
    rows = json.loads(ran("show", "--keys", folder, "--json").stdout)
    return {(row["role"], row["name"], row["key"]): row["state"] for row in rows}


def test_a_fleets_keys_are_made_revoked_and_shown(folder):
    ran("robot", "R1", "R2", "--keys", folder, "--days", 20)
    ran("revoke", "R1", "--keys", folder)
    ran("robot", "R1", "--keys", folder)
    ran("observer", "office", "--keys", folder)
    ran("operator", "shift-1", "--keys", folder)
    ran("revoke", "observer/office", "--keys", folder)
    ran("coordinator", "--keys", folder)
    found = states(folder)
    assert found.pop(("robot", "R1", 1)).startswith("revoked")
    assert found.pop(("observer", "office", 1)).startswith("revoked")
    assert found.pop(("robot", "R2", 1)) in (
        "valid, expires in 19 days",
        "valid, expires in 20 days",
    )
    assert set(found) == {
        ("coordinator", "coordinator", 1), ("coordinator", "coordinator", 2),
        ("observer", "observer", 1), ("operator", "operator", 1), ("operator", "shift-1", 1),
        ("robot", "R1", 2),
    }  # fmt: skip
    assert set(found.values()) == {"valid"}
    assert read_key_files(folder, "robot", "R1").badge.generation == 2


def test_a_key_that_counts_beside_its_successor_is_told_and_can_be_revoked_alone(folder):
    ran("robot", "R1", "--keys", folder)
    assert "robot R1, key 1: the older key stays" in ran("robot", "R1", "--keys", folder).output
    ran("revoke", "R1", "--generation", 1, "--keys", folder)
    assert states(folder)[("robot", "R1", 2)] == "valid"


def test_the_table_for_people_names_everybody(folder):
    told = ran("show", "--keys", folder).stdout
    for word in ("coordinator", "observer", "operator", "valid"):
        assert word in told


def told(done):
    """The words of the panel in which Typer shows what is wrong with a value."""
    return " ".join(done.output.replace("│", " ").split())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["robot", ".."], "not a name"),
        (["robot", "R 1", "a/b"], "not a name"),
        (["robot", "*"], "not a name"),
        (["revoke", "R9"], "no valid key"),
        (["revoke", "coordinator/coordinator"], "new authority"),
        (["revoke", "router/router"], "new authority"),
        (["revoke", "king/R1"], "is not ROBOT"),
        (["revoke", "../R1"], "is not ROBOT"),
        (["coordinator", "--host", "a b"], "neither a name nor an address"),
        (["coordinator", "--host", "300.1.1.1"], "neither a name nor an address"),
        (["coordinator", "--host", "fe80:::1"], "neither a name nor an address"),
        (["show", "--keys", "nowhere"], "keys init nowhere"),
    ],
)
def test_what_does_not_fit_is_told_in_one_line_each(folder, arguments, said):
    options = [] if "--keys" in arguments else ["--keys", folder]
    done = run(*arguments, *options)
    assert done.exit_code != 0
    lines = done.exception.problems if isinstance(done.exception, InputError) else [told(done)]
    assert all(said in line for line in lines)
    assert len(states(folder)) == 3


def test_hosts_are_names_and_addresses_of_both_kinds(folder):
    hosts = ("hall-3.local", "192.168.7.2", "fe80::1", "7th.floor")
    ran("coordinator", "--keys", folder, *(f"--host={host}" for host in hosts))
    assert states(folder)[("coordinator", "coordinator", 2)] == "valid"


def test_a_folder_that_is_there_keeps_its_mode(tmp_path):
    home = tmp_path / "home"
    home.mkdir(mode=0o755)
    home.chmod(0o755)
    ran("init", home)
    assert home.stat().st_mode & 0o777 == 0o755
    assert (home / "authority").stat().st_mode & 0o777 == 0o700


def test_an_authority_that_is_there_is_kept(folder):
    assert isinstance(run("init", folder).exception, InputError)


def test_a_key_that_lets_a_robot_join_says_so_until_it_is_revoked(folder):
    ran("robot", "R9", "--may-join", "--keys", folder)
    ran("robot", "R1", "--keys", folder)
    assert states(folder)["robot", "R9", 1] == "valid, may join"
    assert states(folder)["robot", "R1", 1] == "valid"
    ran("revoke", "R9", "--keys", folder)
    assert states(folder)["robot", "R9", 1].startswith("revoked")
