"""Mutation testing of what safety rests on: `python -m benchmarks.mutation --count 600 --seed 1`.

A mutant that no test notices survives.  Each runs, in a copy of the project, against those tests of
its room that can notice it (covering_tests.py).  Each result is a line of the file of results, and
a run that was stopped goes on after the last one.

Decides: what counts as detected.  A survivor that is known to change nothing stands in
benchmarks/mutation_verdicts.json with the reason.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

from benchmarks.covering_tests import (
    NO_COMPILING,
    PLAIN,
    PYTEST,
    Covering,
    covering,
    in_turn,
    tests_of,
)
from benchmarks.mutants import ROOMS, Mutant, drawn
from benchmarks.table import ROOT

VERDICTS: Final = Path(__file__).with_name("mutation_verdicts.json")
MEMORY: Final = 6 * 2**30
"""Bytes of address space that the tests of one mutant may take."""
FIRST: Final = 5.0
"""Time [s] of the quickest tests, which run before the others: most mutants do not outlive them."""

COPIED: Final = (
    "protocol", "coordinator", "robot_agent", "sim", "benchmarks", "tests", "examples", "docs",
    "firmware", "splinefleet.py", "pyproject.toml", "README.md", "CHANGELOG.md",
)  # fmt: skip


def copied(folder: Path) -> None:
    """Copy the project, with the machine code of its kernels."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            left_out = shutil.ignore_patterns("results")
            shutil.copytree(ROOT / name, folder / name, symlinks=True, ignore=left_out)
        else:
            shutil.copy(ROOT / name, folder / name)


def run(
    mutant: Mutant, folder: Path, tests: Sequence[Covering], compiled: Sequence[Covering] = ()
) -> str:
    """Return "detected", "timeout", or "survived" if the tests pass.

    compiled: tests that run last, with compilation, against a mutant of kernels: the thorough ones
    take too long without.
    """
    path = folder / mutant.file
    source = path.read_bytes()
    path.write_bytes(mutant.applied(source))
    quick, spent = 0, 0.0
    while quick < len(tests) and spent + tests[quick].seconds <= FIRST:
        spent += tests[quick].seconds
        quick += 1
    try:
        plain = mutant.is_plain
        for part, is_plain in ((tests[:quick], plain), (tests[quick:], plain), (compiled, False)):
            if part and (result := _result(folder, part, is_plain)) != "survived":
                return result
        return "survived"
    finally:
        path.write_bytes(source)


def _result(folder: Path, tests: Sequence[Covering], is_plain: bool) -> str:
    environment = os.environ | {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    if is_plain:
        environment[NO_COMPILING] = "1"
    names = folder / "tests.txt"
    names.write_text("".join(f"{one.name}\n" for one in tests))
    command = [sys.executable, "-m", "pytest", "-x", *PYTEST, *(PLAIN if is_plain else ())]
    process = subprocess.Popen(
        [*command, f"@{names}"], cwd=folder, env=environment, start_new_session=True,
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY)),
    )  # fmt: skip
    try:
        limit = 60.0 + 5.0 * sum(one.seconds for one in tests)
        return "detected" if process.wait(limit) else "survived"
    except subprocess.TimeoutExpired:
        return "timeout"
    finally:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


def main() -> None:
    """Run the mutants that were drawn and are not in the file of results yet, then sum up."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.mutation")
    parser.add_argument("--count", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--rooms", nargs="+", choices=ROOMS, default=list(ROOMS))
    parser.add_argument("--budget", type=float, default=60.0, help="seconds of tests a mutant")
    parser.add_argument("--minutes", type=float, default=1e9, help="begin no mutant after this")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--kept", type=Path, default=ROOT / "benchmarks/results/mutants.jsonl")
    asked = parser.parse_args()
    asked.kept.parent.mkdir(exist_ok=True)
    chosen = drawn(asked.count, asked.seed, asked.rooms)
    done = {row["name"]: row for row in _rows(asked.kept)}
    open_ones = [mutant for mutant in chosen if mutant.name not in done]
    kinds = sorted({(one.room, way) for one in open_ones for way in {False, one.is_plain}})
    tests = {kind: tests_of(*kind, asked.kept.with_suffix("")) for kind in kinds}
    end = time.monotonic() + 60.0 * asked.minutes
    folders: queue.SimpleQueue[Path] = queue.SimpleQueue()

    def tried(mutant: Mutant) -> dict[str, Any] | None:
        if time.monotonic() > end:
            return None
        folder = folders.get()
        began = time.monotonic()
        may_notice = covering(mutant, tests[mutant.room, mutant.is_plain], asked.budget)
        compiled = in_turn(tests[mutant.room, False], asked.budget) if mutant.is_plain else []
        result = run(mutant, folder, may_notice, compiled)
        folders.put(folder)
        before, after = mutant.diff((ROOT / mutant.file).read_bytes())
        return asdict(mutant) | {
            "name": mutant.name, "result": result, "before": before, "after": after,
            "tests": len(may_notice), "seconds": round(time.monotonic() - began, 1),
        }  # fmt: skip

    with (
        tempfile.TemporaryDirectory() as name,
        asked.kept.open("a") as kept,
        ThreadPoolExecutor(asked.jobs) as pool,
    ):
        for number in range(asked.jobs):
            folder = Path(name) / str(number)
            folder.mkdir()
            copied(folder)
            folders.put(folder)
        for row in pool.map(tried, open_ones):
            if row is not None:
                done[row["name"]] = row
                kept.write(json.dumps(row) + "\n")
                kept.flush()
    sys.stdout.write(summary([done[one.name] for one in chosen if one.name in done]))


def _rows(path: Path) -> list[dict[str, str]]:
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def summary(rows: Sequence[dict[str, str]]) -> str:
    """Return scores by room and the survivors as diffs.

    Adjusted: survivors that are known to change nothing are left out.
    """
    known = {(one["file"], one["before"], one["after"]): one for one in _verdicts()}
    lines = ["room       mutants  detected  survived  changes nothing  raw    adjusted"]
    survivors = [row for row in rows if row["result"] == "survived"]
    for room in [*ROOMS, "all"]:
        own = [row for row in rows if room in (row["room"], "all")]
        if not own:
            continue
        left = [row for row in own if row["result"] == "survived"]
        same = sum((row["file"], row["before"], row["after"]) in known for row in left)
        seen = len(own) - len(left)
        raw, adjusted = seen / len(own), seen / max(len(own) - same, 1)
        lines.append(
            f"{room:10} {len(own):7} {seen:9} {len(left):9} {same:16} {raw:6.1%} {adjusted:9.1%}"
        )
    for row in survivors:
        verdict = known.get((row["file"], row["before"], row["after"]))
        lines += ["", f"{row['file']}:{row['line']} ({row['kind']})"]
        lines += [f"- {row['before']}", f"+ {row['after']}"]
        lines += [f"  changes nothing: {verdict['why']}"] if verdict else ["  no verdict yet"]
    return "\n".join(lines) + "\n"


def _verdicts() -> list[dict[str, str]]:
    return json.loads(VERDICTS.read_text()) if VERDICTS.exists() else []


if __name__ == "__main__":
    main()
