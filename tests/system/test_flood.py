"""A client that floods a running fleet with garbage and lies: everybody arrives all the same."""

from benchmarks.flood import ROBOTS, run_beside

SECONDS = 6.0
RATE = 20_000
MOST_GROWTH_MB = 50.0


def test_a_fleet_arrives_while_a_client_floods_it_and_its_coordinator_does_not_grow():
    told = run_beside(RATE, SECONDS)
    assert told["arrived"] == f"{ROBOTS} of {ROBOTS}"
    assert told["Commands"] > 10 * SECONDS
    assert told["sent"] > 10_000
    assert told["dropped"] > told["heard"]
    assert told["growth MB"] < MOST_GROWTH_MB
