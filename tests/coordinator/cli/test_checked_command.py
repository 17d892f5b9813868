"""Every problem of a command line is told, one line each, whatever the command."""

import pytest
import typer
from typer.main import get_command
from typer.testing import CliRunner

from coordinator.base.errors import InputError
from coordinator.cli.checked_command import CheckedCommand
from coordinator.cli.usage import usage_lines
from splinefleet import app

FLEET = "--connect tcp/127.0.0.1:9"
NAME = "is not 1 to 32 of A-Z a-z 0-9 _ . -, not dots alone"
NUMBER = "is not a finite number from"
PLACE = "without spaces, each from -8000 to 8000"


def told_by(line):
    with pytest.raises(typer.TyperException) as caught:
        app(line.split(), standalone_mode=False, prog_name="splinefleet")
    return usage_lines(caught.value)


def commands_of(group):
    for one in group.commands.values():
        yield from commands_of(one) if hasattr(one, "commands") else [one]


def test_every_command_checks_its_whole_line():
    found = list(commands_of(get_command(app)))
    assert len(found) > 30
    assert {one.name for one in found if not isinstance(one, CheckedCommand)} == set()


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (
            "plan --csv x.json --step 0",
            [
                "SCENARIO is missing; usage: splinefleet plan [OPTIONS] SCENARIO",
                "--csv: x.json does not end in .csv",
                f"--step: 0.0 {NUMBER} 0.0001 to 1000",
            ],
        ),
        (
            "plan a.toml --csv x.csv --step -1 --effort -3",
            [
                f"--step: -1.0 {NUMBER} 0.0001 to 1000",
                "--effort: -3 is less than 0, the least allowed",
            ],
        ),
        (
            f"order {FLEET} --to 1 --id a/b --dwell -1 --priority x",
            [
                f"--to: '1' is not X,Y or X,Y,HEADING {PLACE}",
                f"--dwell: -1.0 {NUMBER} 0 to 86400",
                "--priority: 'x' is not a whole number",
                f"--id: 'a/b' {NAME}",
            ],
        ),
        (
            f"order {FLEET} --id a/b",
            ["--to: give a place, or --vda5050 FILE", f"--id: 'a/b' {NAME}"],
        ),
        (
            f"join cart-4 {FLEET} --at 6 --radius -1 --max-speed 0",
            [
                f"--at: '6' is not X,Y,HEADING {PLACE}",
                f"--radius: -1.0 {NUMBER} 0.001 to 100",
                f"--max-speed: 0.0 {NUMBER} 0.001 to 100",
            ],
        ),
        (
            "block --connect 7447 --polygon 1,1 2,2 --id a/b --patience 0",
            [
                "--polygon: 2 corners, a polygon has three or more",
                "--connect: '7447' is not an endpoint; it must be tcp/HOST:PORT, "
                "as in tcp/127.0.0.1:7447",
                f"--id: 'a/b' {NAME}",
                f"--patience: 0.0 {NUMBER} 0.5 to 86400",
            ],
        ),
        (
            "scenario open --size -4 0 --seed -1 --robots 0",
            [
                "--robots: 0 is less than 1, the least allowed",
                "--seed: -1 is less than 0, the least allowed",
                "--size: -4 m x 0 m is not from 1 m to 8000 m each way; "
                "it is --size W H, separated by spaces",
            ],
        ),
        (
            "simulate a.toml --seed -1 --box-rate 0 --page x",
            [
                "--seed: -1 is less than 0, the least allowed",
                f"--box-rate: 0.0 {NUMBER} 1 to 100",
                "--page: x is not HOST:PORT",
            ],
        ),
        (
            "agent a/b --connect x --at 1 nan 0 --blackbox no/x.csv",
            [
                f"ROBOT: 'a/b' {NAME}",
                "--connect: 'x' is not an endpoint; it must be tcp/HOST:PORT, "
                "as in tcp/127.0.0.1:7447",
                "--blackbox: no/x.csv: there is no folder no",
                "--at: 1 nan 0 is not a place; it is --at X Y HEADING, separated by spaces",
            ],
        ),
        (
            "keys coordinator --host a/b --days 0",
            [
                "--host: 'a/b': neither a name nor an address",
                "--days: 0 is less than 1, the least allowed",
            ],
        ),
        (
            "import a.map a.scen -o a.toml --radius 0 --max-speed -1",
            [
                f"--radius: 0.0 {NUMBER} 0.001 to 0.5",
                "--max-speed: -1.0 m/s is below 0.001 m/s",
            ],
        ),
    ],
)
def test_all_invalid_values_are_told(line, told):
    assert told_by(line) == told


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("plan a.toml --step 1", "--step: has no effect without --csv"),
        (
            f"order {FLEET} --vda5050 a.json --dwell 2",
            "--dwell: not together with --vda5050, because the file states it",
        ),
        ("coordinator a.toml --with-scenario", "--with-scenario: has no effect without --resume"),
        ("coordinator a.toml --log-size 2", "--log-size: has no effect without --log or --resume"),
        (
            "coordinator a.toml --listen tcp/127.0.0.1:9 --connect tcp/127.0.0.1:9",
            "--connect: not together with --listen",
        ),
        ("simulate a.toml --speed 2", "--speed: has no effect without --page"),
        ("campaign a.toml --faults kill --fault none", "--fault: not together with --faults"),
        ("campaign a.toml --faults fly", "--faults: 'fly': is not one of kill"),
        ("replay a.mcap --seed 2", "--seed: has no effect without --until"),
        ("replay a.mcap --until 3 --check", "--until: not together with --check"),
        ("replay a.mcap --check --speed 2", "--speed: not together with --check"),
        ("replay a.mcap --from 3 --to 2", "--to: 2 s is before --from 3"),
        ("view a.json --fleet one", "--fleet: has no effect without --connect"),
        ("plot a.json -o a.html --robots A", "--robots: has no effect on a page, a.html"),
        ("export a.json --to vda5050 -o a --step 1", "--step: has no effect with --to vda5050"),
        ("export a.json --to csv -o a.mcap", "--output: a.mcap does not end in .csv"),
        ("verify a.mcap --allow-unproven limits", "--allow-unproven: has no effect on a log"),
        (
            "agent R1 --connect tcp/127.0.0.1:9 --at 1,1,0",
            "Option '--at' requires 3 arguments; it is --at X Y HEADING, separated by spaces",
        ),
        (
            "join R1 --connect tcp/127.0.0.1:9 --at 1 1 0",
            "--at: '1' is not X,Y,HEADING without spaces",
        ),
        ("foo", "'foo' is not a command, the nearest one is "),
        ("pln a.toml", "'pln' is not a command, the nearest one is plan; usage: "),
        ("keys shw", "'shw' is not a command, the nearest one is show; usage: "),
        ("land", "'land' is not a command, the nearest one is plan; usage: "),
    ],
)
def test_an_option_that_would_be_ignored_and_an_unknown_command_are_told(line, told):
    (said,) = told_by(line)
    assert said.startswith(told)


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("splinefleet pla", ["plan"]),
        ("splinefleet plan --st", ["--step"]),
        ("splinefleet plan --csv x.json --st", ["--step"]),
        ("splinefleet unknown --st", []),
    ],
)
def test_a_shell_still_completes_lines(words, offered):
    count = str(len(words.split()) - 1)
    env = {"_SPLINEFLEET_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": count}
    done = CliRunner().invoke(app, [], env=env, prog_name="splinefleet")
    assert done.stdout.split() == offered, done.output


def test_options_in_another_order_and_beside_each_other_are_accepted():
    line = "plan nowhere.toml --step 1 --csv x.csv"
    with pytest.raises(InputError, match=r"nowhere\.toml"):
        app(line.split(), standalone_mode=False)
