"""The whole comparison: `python -m tests.second_checker [--altered 10000] [--kept FILE]`.

First all plans of up to 17 robots, then altered ones of 6.  Each result is one line of FILE, and a
run that was stopped goes on after the last one.  Prints every disagreement and a summary.
"""

import argparse
import json
import sys
from pathlib import Path

from tests.second_checker.altered import altered
from tests.second_checker.comparing import compare
from tests.second_checker.plans import EXAMPLES, FEW, MORE, example, planned


def cases(count):
    """Yield the name of each comparison and how to make its PackedPlan."""
    for scene in (*FEW, *MORE):
        yield ":".join(map(str, scene[:3])), lambda scene=scene: planned(*scene)
    for name in EXAMPLES:
        yield name, lambda name=name: example(name)
    for seed in range(count):
        scene = FEW[seed % len(FEW)]

        def made(scene=scene, seed=seed):
            found = altered(planned(*scene), seed)
            return None if found is None else found[0]

        yield f"altered:{scene[0]}:{seed}", made


def main():
    """Compare, keep and sum up; exit code 1 when the two disagree."""
    parser = argparse.ArgumentParser(prog="python -m tests.second_checker")
    parser.add_argument("--altered", type=int, default=10_000, help="how many altered plans")
    parser.add_argument("--kept", type=Path, default=Path("second_checker.jsonl"))
    asked = parser.parse_args()
    done = set()
    if asked.kept.exists():
        done = {json.loads(line)["name"] for line in asked.kept.read_text().splitlines()}
    with asked.kept.open("a") as kept:
        for name, make in cases(asked.altered):
            if name in done:
                continue
            plan = make()
            row = {"name": name, "made": plan is not None}
            if plan is not None:
                row |= vars(compare(plan, name))
            kept.write(json.dumps(row) + "\n")
            kept.flush()
    rows = [json.loads(line) for line in asked.kept.read_text().splitlines()]
    return summary([row for row in rows if row["made"]])


def summary(rows):
    """Print what was found; return the exit code."""
    wrong = [row for row in rows if row["differences"]]
    above = [row["said"] - row["found"][0] for row in rows if row["said"] is not None]
    for row in wrong:
        sys.stdout.write("\n  ".join([row["name"], *row["differences"]]) + "\n")
    sys.stdout.write(
        f"{len(rows)} plans, {sum(row['holds'] for row in rows)} of them proven: {len(wrong)} "
        f"disagreements; least slack at most {1e3 * max(above):.3f} mm above the lower bound\n"
    )
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
