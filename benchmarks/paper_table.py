# ruff: noqa: T201
"""The tables of docs/paper.md, in Markdown: `python -m benchmarks.paper_table`.

Decides: how Table 1, its consequences and our plans of the same floor are compared.  All
numbers are computed here from tests/golden/table1.csv and examples/paper_five.toml.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise
from pathlib import Path

from msgspec.structs import replace

from coordinator.plan.document import PlanDocument
from coordinator.planning.planner import plan_scenario
from coordinator.proof.verify import prove_document
from coordinator.scenario_files.scenario_reader import read_scenario
from coordinator.schedule.paper_policy import Encounter, algorithm_2

_ROOT = Path(__file__).parents[1]
_STOP_TIME, _TAU = 2.0, 0.5

Rows = Iterator[Sequence[str]]


@dataclass(frozen=True)
class Entry:
    """One robot at one printed crossing: arc length [m], speed [m/s], printed time [s]."""

    robot: str
    d: float
    v: float
    t: float


@dataclass(frozen=True)
class Row:
    """One printed crossing: place [m], robots R_i and R_p, and the printed verdict."""

    x: float
    y: float
    i: Entry
    p: Entry
    verdict: str

    @property
    def name(self) -> str:
        """The crossing's name in the paper, R_ip."""
        return f"R{self.i.robot[1:]}{self.p.robot[1:]}"


def read_table(path: Path) -> list[Row]:
    """Return the crossings of Table 1 in its order; decimetres become metres."""
    with path.open(encoding="utf-8") as table:
        return [_row(cells) for cells in csv.DictReader(table) if cells["x_dm"]]


def _row(cells: dict[str, str]) -> Row:
    i, p = (
        Entry(
            robot,
            0.1 * float(cells[f"d_{side}_dm"]),
            float(cells[f"v_{side}_mps"]),
            float(cells[f"t_{side}_s_printed"]),
        )
        for robot, side in zip(cells["pair"].split("-"), "ip", strict=True)
    )
    x, y = 0.1 * float(cells["x_dm"]), 0.1 * float(cells["y_dm"])
    return Row(x, y, i, p, cells["verdict_printed"])


def places(table: list[Row], plan: PlanDocument) -> Rows:
    """Yield the crossing points: printed, ours, how far apart."""
    yield "crossing", "printed x, y [m]", "ours x, y [m]", "apart [mm]"
    for row in table:
        for at in plan.crossings:
            if (at.a, at.b) == (row.i.robot, row.p.robot):
                apart = 1000.0 * math.dist((at.x, at.y), (row.x, row.y))
                yield (
                    row.name,
                    f"{row.x:.3f}, {row.y:.3f}",
                    f"{at.x:.3f}, {at.y:.3f}",
                    f"{apart:.1f}",
                )


def times(table: list[Row], plan: PlanDocument) -> Rows:
    """Yield arc lengths and times: printed, recomputed as t = d / V, ours alone and as planned."""
    yield (
        "crossing",
        "robot",
        "d printed [m]",
        "d ours",
        "t printed [s]",
        "d / V of the table",
        "printed less d / V",
        "d / V ours",
        "t in our plan",
    )
    ours = {(at.a, at.b): ((at.s_a, at.t_a), (at.s_b, at.t_b)) for at in plan.crossings}
    for row in table:
        both = ours[row.i.robot, row.p.robot]
        for entry, (s, t) in zip((row.i, row.p), both, strict=True):
            alone = entry.d / entry.v
            off = entry.t - alone
            yield (
                row.name,
                entry.robot,
                f"{entry.d:.3f}",
                f"{s:.3f}",
                f"{entry.t:.2f}",
                f"{alone:.3f}",
                f"**{off:+.2f}**" if abs(off) > 0.01 else "0",
                f"{s / entry.v:.2f}",
                f"{t:.2f}",
            )


def chords(table: list[Row]) -> Rows:
    """Yield the stretches whose printed arc length is shorter than the straight line."""
    yield "robot", "from", "to", "printed arc length [m]", "straight line [m]"
    for robot in ("R1", "R2", "R3", "R4", "R5"):
        stations = sorted(
            (entry.d, row.name, (row.x, row.y))
            for row in table
            for entry in (row.i, row.p)
            if entry.robot == robot
        )
        for (d0, start, here), (d1, end, there) in pairwise(stations):
            chord = math.dist(here, there)
            if d1 - d0 < chord - 0.005:
                yield robot, start, end, f"{d1 - d0:.3f}", f"{chord:.3f}"


def verdicts(table: list[Row], paper: PlanDocument, safe: PlanDocument) -> Rows:
    """Yield who stops at each crossing, according to five sources."""
    yield (
        "crossing",
        "printed",
        "Algorithm 2 as written, on the table",
        "the same, slower robot first",
        "Algorithm 2 on our floor",
        "our safe schedule",
    )
    on_table = [_on_table(table, slower_first=slower) for slower in (False, True)]
    planned = [{(at.a, at.b): at.verdict for at in plan.crossings} for plan in (paper, safe)]
    for number, row in enumerate(table):
        printed = row.verdict.replace("no collision", "no stop")
        pair = (row.i.robot, row.p.robot)
        yield row.name, printed, *(said[number] for said in on_table), *(p[pair] for p in planned)


def _on_table(table: list[Row], *, slower_first: bool) -> list[str]:
    meetings = [
        Encounter(int(r.i.robot[1:]), int(r.p.robot[1:]), r.i.d, r.p.d, r.i.v, r.p.v) for r in table
    ]
    decided = algorithm_2(meetings, _STOP_TIME, _TAU, slower_first=slower_first)
    return [
        "no stop" if one.stops is None else f"R{one.stops} stops {_STOP_TIME:.0f} s"
        for one in decided
    ]


def stops(plans: Iterable[tuple[str, PlanDocument]]) -> Rows:
    """Yield where and how long robots stand in each plan."""
    yield "plan", "robot", "stops at s [m]", "from [s]", "to [s]", "wait [s]", "for"
    for name, plan in plans:
        for robot in plan.robots:
            if robot.start_time > 0.0:
                wait = f"{robot.start_time:.2f}"
                yield name, robot.id, "0 (start)", "0.00", wait, wait, robot.start_yields_to
            for stop in robot.stops:
                times = (stop.s, stop.arrive, stop.depart, stop.depart - stop.arrive)
                yield name, robot.id, *(f"{number:.2f}" for number in times), stop.yields_to


def proofs(plans: Iterable[tuple[str, PlanDocument]]) -> Rows:
    """Yield the result of each plan's proof."""
    yield "plan", "tau [s]", "proof", "survives", "last arrival [s]", "tightest"
    for name, plan in plans:
        proof = plan.proof
        if proof is not None:
            finish = max(robot.finish_time for robot in plan.robots)
            holds = "holds" if proof.holds else "**fails**"
            survives = ", ".join(proof.survives) or "nothing"
            yield name, f"{plan.tau:.3g}", holds, survives, f"{finish:.2f}", proof.tightest


def separations(plans: Sequence[tuple[str, PlanDocument]]) -> Rows:
    """Yield how near each pair comes: on time, and when one is up to tau late."""
    yield "pair", *(f"{name}: {when}" for name, _ in plans for when in ("on time", "within tau"))
    robots = [plan.robots for _, plan in plans]
    for i, j in combinations(range(len(robots[0])), 2):
        cells = []
        for _, plan in plans:
            pair = replace(plan, robots=[plan.robots[i], plan.robots[j]], crossings=[])
            proofs = (prove_document(replace(pair, tau=tau)) for tau in (0.0, plan.tau))
            need = plan.margin + pair.robots[0].radius + pair.robots[1].radius
            cells += [_apart(proof.least_separation, need) for proof in proofs]
        yield f"{robots[0][i].id}-{robots[0][j].id}", *cells


def _apart(separation: float | None, need: float) -> str:
    if separation is None:
        return ""
    return f"**{separation:.3f}**" if separation < need - 1e-6 else f"{separation:.3f}"


def main() -> None:
    """Print all tables."""
    table = read_table(_ROOT / "tests" / "golden" / "table1.csv")
    scenario = read_scenario(_ROOT / "examples" / "paper_five.toml")
    safe, paper = plan_scenario(scenario), plan_scenario(replace(scenario, policy="paper"))
    real = plan_scenario(read_scenario(_ROOT / "examples" / "paper_five_real.toml"))
    plans = (("Algorithm 2", paper), ("safe", safe), ("safe, real robots", real))
    for title, rows in (
        ("Crossing points", places(table, safe)),
        ("Arc lengths and times", times(table, safe)),
        ("Printed arc lengths that no curve can have", chords(table)),
        ("Who stops", verdicts(table, paper, safe)),
        ("Stops", stops(plans)),
        ("Least distance between centres [m]", separations(plans[:2])),
        ("Proofs", proofs(plans)),
    ):
        print(f"### {title}\n")
        for number, cells in enumerate(rows):
            print("| " + " | ".join(cells) + " |")
            if number == 0:
                print("|" + " --- |" * len(cells))
        print()


if __name__ == "__main__":
    main()
