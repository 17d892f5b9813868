"""The folder of a local fleet, before anything is started."""

from coordinator.scenario_file import read_scenario
from sim.local_fleet import LocalFleet
from tests.sim.test_campaign import PAPER


def test_what_an_earlier_run_left_in_the_folder_does_not_mix_with_a_new_one(tmp_path):
    fleet = LocalFleet(read_scenario(PAPER), tmp_path, speed=1.0, effort=0, faults=[])
    (tmp_path / "blackbox").mkdir()
    stale = ("run.mcap", "run-2.mcap", "plan.json", "plan-3.json", "plan.svg", "summary.json")
    for name in (*stale, "blackbox/R9.csv", "notes.txt"):
        (tmp_path / name).write_text("old")
    fleet._prepare_folder()
    left = {path.relative_to(tmp_path).as_posix() for path in tmp_path.rglob("*") if path.is_file()}
    assert left == {"notes.txt", "scenario.json"}
