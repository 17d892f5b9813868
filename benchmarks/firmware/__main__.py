"""Trials of the C agent that take hours, a part at a time.

    python -m benchmarks.firmware fleets --count 500 --kept FILE
    python -m benchmarks.firmware events --count 300 --kept FILE

With `--kept FILE` an interrupted run goes on where it stopped, as long as the code is the same.
"""

from benchmarks.campaign import parser_of, record
from benchmarks.firmware.trials import TRIALS


def main() -> None:
    """Run the trials named on the command line."""
    parser = parser_of(__doc__, 0)
    parser.add_argument("what", choices=sorted(TRIALS))
    asked = parser.parse_args()
    measure, whole = TRIALS[asked.what]
    seeds = range(asked.from_seed, asked.from_seed + (asked.count or whole))
    record(f"firmware-{asked.what}", {asked.what: measure(seeds, asked.jobs, asked.kept)})


if __name__ == "__main__":
    main()
