"""Operators' commands with words that make no sense: exit code 2 and one line, before any link."""

import pytest
from typer.testing import CliRunner

from protocol.messages import FARTHEST
from splinefleet import app

NAME = "is not 1 to 32 of A-Z a-z 0-9 _ . -, not dots alone"
PLACE = f"each from {-FARTHEST:g} to {FARTHEST:g}"
ORDERS = [
    ("order --to nan,1", PLACE),
    ("order --to 1", PLACE),
    ("order --to 1,2,3,4", PLACE),
    ("order --to 8001,1", PLACE),
    ("order --to 1,1 --via 1,inf", PLACE),
    ("order", "give a place, or --vda5050 FILE"),
    ("order --to 1,1 --vda5050 a.json", "give a place, or --vda5050 FILE"),
    ("order --vda5050 a.json --via 1,1", "not together with --vda5050, because the file states it"),
    ("order --to 1,1 --robot a/b", NAME),
    ("order --to 1,1 --id ..", NAME),
    ("order --to 1,1 --id ü", NAME),
    ("order --to 1,1 --dwell -1", "is not a finite number from 0 to 86400"),
    ("order --to 1,1 --dwell nan", "is not a finite number from 0 to 86400"),
    ("order --to 1,1 --priority 2147483648", "equal to 2147483647"),
    ("order --to 1,1 --fleet a/b", NAME),
    ("order --to 1,1 --patience nan", "is not a finite number from 0.5 to 86400"),
    ("cancel a/b", NAME),
]
BLOCKS = [
    ("block --polygon 1,1 2,2", "2 corners, a polygon has three or more"),
    ("block --polygon 1,1 2,2 1,2 2,1", "crosses or touches itself"),
    ("block --polygon 1,1 2,1 3,1", "lie on one line"),
    ("block --polygon -1,-1 -2,nan -3,3", PLACE),
    ("block --polygon 1,1 2,1 2,2 --nosuch", "'--nosuch' is not X,Y"),
    ("unblock a/b", NAME),
]
ROSTER = [
    ("join R9 --at 1,1", PLACE),
    ("join R9 --at 1,1,0 --max-accel -1", "is not a finite number from 0.001 to 1000"),
    ("join R9 --at 1,1,0 --max-accel nan", "is not a finite number from 0.001 to 1000"),
    ("join R9 --at 1,1,0 --radius 0", "is not a finite number from 0.001 to 100"),
    ("join a/b --at 1,1,0", NAME),
    ("leave a/b", NAME),
]


@pytest.mark.parametrize(("line", "told"), [*ORDERS, *BLOCKS, *ROSTER])
def test_what_makes_no_sense_is_told_before_anybody_is_asked(line, told):
    answer = CliRunner().invoke(app, [*line.split(), "--connect", "tcp/127.0.0.1:9"])
    assert answer.exit_code == 2
    said = " ".join(answer.output.replace("│", " ").split())
    assert told in said, said
