"""docs/first-fleet.md driven as it is printed, four times as fast and at a free port."""

import json
import shlex

from sim.processes.local_fleet import free_port
from tests.system.fleet_tools import splinefleet, started
from tests.test_first_fleet import COMMANDS, SCENARIO

DRIVING = ("coordinator", "agent")


def test_two_terminals_drive_the_first_fleet(tmp_path):
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    hall = tmp_path / "hall.toml"
    hall.write_text(SCENARIO)

    def words_of(command):
        here = {"hall.toml", "run.mcap", "R1.csv", "R2.csv"}
        words = [word.replace("tcp/127.0.0.1:7447", endpoint) for word in shlex.split(command)[1:]]
        speed = ["--speed", "4"] if words[0] in DRIVING else []
        return [str(tmp_path / word) if word in here else word for word in words] + speed

    driving = [words_of(command) for command in COMMANDS if shlex.split(command)[1] in DRIVING]
    coordinator, first, second = driving[:3]
    with started(*coordinator) as leading, started(*first) as one, started(*second) as two:
        told = [program.communicate(timeout=90.0)[1] for program in (leading, one, two)]
        assert [program.returncode for program in (leading, one, two)] == [0, 0, 0], told
    judged = json.loads(splinefleet("judge", tmp_path, "--json").stdout)
    assert judged["collisions"] == 0
    assert [robot["arrived"] for robot in judged["robots"]] == [True, True]
    checked = splinefleet("replay", tmp_path / "run.mcap", "--check")
    assert "every byte agrees" in checked.stdout + checked.stderr
