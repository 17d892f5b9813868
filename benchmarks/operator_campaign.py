"""Small fleets in virtual time beside operators and faults that strike as courses change.

Each seed draws a hall, what operators say and which faults strike (operator_acts.py).  A run is
good if no two robots on the floor touch each other and none touches anything solid, every log gives
the same messages again and is proven (of every `--prove-each`th seed), no coordinator finds another
one in its place, and the fleet ends with every order done, cancelled or refused.

`python -m benchmarks.operator_campaign --count 500 --kept FILE` runs seeds; of one that fails it
prints what was said and struck.  `--shrink SEED` prints the few of these acts that are enough.
With `--floors` coordinators are started again more often, half of the time on a floor that has
changed.
Decides: how acts are carried out, and what a run is judged by.  Must not know: what is drawn, and
how courses are found.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations, product
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Final, NamedTuple

from msgspec.structs import replace

from benchmarks.campaign import in_turn, parser_of, record
from benchmarks.operator_acts import (
    Act,
    Admission,
    Adversary,
    Carry,
    Floors,
    NewFloor,
    Script,
    hall,
)
from benchmarks.table import Row
from coordinator.findings.log_proof import prove_log
from coordinator.log.log_file import logs_before, read_log
from coordinator.planning.planner import plan_scenario
from coordinator.service.replay import check_log
from protocol import keys
from protocol.codec import encode
from protocol.messages import (
    CANCELLED,
    END,
    GO_ON,
    ORDER_DONE,
    ORDER_STATES,
    REFUSED,
    UNDER_WAY,
    Admit,
    Block,
    Join,
    Leave,
    Message,
    Tell,
    Unblock,
)
from protocol.phases import COMMAND_NAMES
from protocol.timing import MILLISECOND, SECOND
from sim.judging.clearance import SolidGround
from sim.judging.judge import least_separation
from sim.world.fault_script import write_fault
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import USUAL_FLAWS, World

LASTS: Final = 45.0
"""Operators and faults begin something within this [s]."""
SETTLED: Final = LASTS + 40.0
"""From then on [s] operators open what is closed, and tell the fleet to go on and to end."""
PATIENCE: Final = 900.0
"""A run has to end within so long [s] after that, or after an order was done since then."""
STEP: Final = 0.05
"""How often [s] operators look at the fleet."""

_BOOTS: Final = 1_000_000
"""How far apart the boot ids of the programs of a robot that is carried or joins are."""


class Result(NamedTuple):
    """One run: what was wrong with it, and what was said and struck if anything was."""

    seed: int
    problems: tuple[str, ...]
    script: tuple[str, ...]
    acts: int
    given_up: int
    resumed: int


class Trial:
    """One run: the world of a seed, its operators, and when each robot was on the floor.

    With a `script` these acts happen, and otherwise what an adversary draws; `floors`: it draws
    floors that change, too.
    """

    def __init__(
        self, seed: int, logs: RunLogs, script: Script | None = None, *, floors: bool = False
    ) -> None:
        dice = Random(f"operators {seed}")
        self.scenario = hall(dice)
        self.world = World(
            self.scenario,
            plan_scenario(self.scenario),
            MemoryNetwork(seed),
            seed=seed,
            flaws=USUAL_FLAWS,
            planning_ns=dice.choice((100, 150, 300, 600)) * MILLISECOND,
            period_ns=20 * MILLISECOND,
            logs=logs,
            stays=True,
        )
        self.script: Script = []
        self.stays = {robot.id: [(-math.inf, math.inf)] for robot in self.scenario.robots}
        """By robot: from when until when [s since the first GO] it was on the floor."""

        self._coming = None if script is None else list(script)
        self._adversary = Adversary(dice, self.world, self.scenario)
        self._floors = (
            Floors(Random(f"floors {seed}"), self.world, self.scenario) if floors else None
        )
        self._session = self.world._network.session("operator")
        self._joins: set[str] = set()

    @property
    def now(self) -> float:
        """The time since the first GO [s]."""
        return (self.world.now_ns - self.world.began_ns) / SECOND

    def run(self) -> None:
        """Let acts happen, and the fleet come to its end."""
        world = self.world
        while not world.began_ns and world.now_ns < 60 * SECOND:
            world.run(STEP)
        asked = latest = SETTLED
        done = 0
        while self.now < latest + PATIENCE and not world.fleet.is_finished:
            for act in self._due():
                self.script.append((self.now, act))
                self._do(act)
            if self.now >= asked:
                self._end()
                asked += 5.0
            if self._orders_done() > done:
                done, latest = self._orders_done(), max(self.now, SETTLED)
            self._note_stays()
            world.run(STEP)
        world.go_on(1.0)

    def _orders_done(self) -> int:
        """Return how many orders of operators are done; not where robots made room for others."""
        tasks = self.world.fleet.orders.tasks.values()
        return sum(task.state == ORDER_DONE and not task.makes_room for task in tasks)

    def _due(self) -> list[Act]:
        if self._coming is None:
            acts = self._adversary.due(self.now, self.now < LASTS)
            return acts if self._floors is None else self._floors.with_new(acts, self.now, LASTS)
        acts = [act for time, act in self._coming if time <= self.now]
        del self._coming[: len(acts)]
        return acts

    def _do(self, act: Act) -> None:
        world = self.world
        if isinstance(act, Fault):
            world.strike(act)
        elif isinstance(act, NewFloor):
            floor = replace(self.scenario.workspace, obstacles=act.obstacles)
            world.coordinator.next_scenario = replace(self.scenario, workspace=floor)
        elif isinstance(act, Carry):
            member = world.fleet.members.get(act.robot)
            is_down = member is not None and member.gone and world.robots[act.robot].dead
            if is_down and self._is_there(act.robot):  # Not so if acts before it were left out.
                self._take_away(act.robot, self.now)
                self._put(act.robot, act.pose)
        elif isinstance(act, Admission):
            boot = len(self.script)
            door = world._network.session(f"door {boot}")
            door.put(keys.admit(world.fleet.name, act.robot), encode(Admit(boot)))
        else:
            if isinstance(act, Join):
                self._joins.add(act.robot)
            self._say(act)

    def _say(self, message: Message) -> None:
        kinds = {Tell: keys.tell, Block: keys.block, Unblock: keys.block}
        kinds |= {Join: keys.roster, Leave: keys.roster}
        key = kinds.get(type(message), keys.order)(self.world.fleet.name)
        self._session.put(key, encode(message))

    def _end(self) -> None:
        """Open all that is closed, and tell the fleet to go on and to end."""
        for name in self.world.fleet.blocks:
            self._say(Unblock(9, name))
        self._say(Tell(9, GO_ON))
        self._say(Tell(9, END))

    def _note_stays(self) -> None:
        """Take robots that have left off the floor, and put those that have joined there."""
        fleet = self.world.fleet
        for robot in self.stays:
            if robot not in fleet.members and self._is_there(robot):
                self.world.strike(Fault("kill", robot, self.now))
                self._take_away(robot, self.now - STEP)
        for robot in list(self._joins):
            task = fleet.orders.tasks.get(f"join-{robot}")
            if task is not None and task.state in (REFUSED, CANCELLED):
                self._joins.remove(robot)
            elif task is not None and task.state in (UNDER_WAY, ORDER_DONE):
                self._joins.remove(robot)
                is_in = robot in fleet.members and not self._is_there(robot)
                if is_in and task.joins is not None:
                    x, y, *heading = task.joins.start
                    self._put(robot, (x, y, heading[0]))

    def _is_there(self, robot: str) -> bool:
        return self.stays[robot][-1][1] == math.inf

    def _take_away(self, robot: str, time: float) -> None:
        self.stays[robot][-1] = (self.stays[robot][-1][0], time)

    def _put(self, robot: str, pose: tuple[float, float, float]) -> None:
        """Put a robot at a pose [m, m, rad], and start its program there."""
        boot = self.world.robots[robot].service.boot + _BOOTS
        self.world.renew(robot, boot, pose)
        self.stays[robot].append((self.now + STEP, math.inf))


def judged(trial: Trial, logs: RunLogs, is_proven: bool) -> Iterator[str]:
    """Yield what was wrong with a run, its kind first; with the proofs of its logs if asked."""
    fleet = trial.world.fleet
    yield from _touches(trial)
    if not fleet.is_finished:
        yield f"not over: {COMMAND_NAMES[fleet.phase]} at the end"
        for name, task in fleet.orders.tasks.items():
            if task.state not in (ORDER_DONE, CANCELLED, REFUSED):
                state = f"{ORDER_STATES[task.state]}: {task.reason}"
                yield f"not over: {name} of {task.robot} is {state}"
    if fleet.superseded:
        yield "superseded: a coordinator found another one in its place"
    if is_proven:
        for path in logs.paths:
            log = read_log(path)
            if difference := check_log(log).difference:
                yield f"replay: {path.name}: {difference}"
            for epoch in prove_log(log, before=logs_before(log)).epochs:
                yield from (f"proof: {path.name}: {failure}" for failure in epoch.failures[:3])
                if not epoch.proof.holds:
                    yield f"proof: {path.name}: the plan of epoch {epoch.epoch} does not hold"


def _touches(trial: Trial) -> Iterator[str]:
    """Yield which robots touched each other, or something solid, while they were on the floor.

    A robot that slides may come nearer by the distance of its slides: no plan can prevent that.
    """
    boxes, floor = trial.world.blackboxes(), trial.scenario.workspace
    least = {robot.id: robot.radius for robot in trial.scenario.robots}
    for struck in trial.world.struck:
        if struck.fault.kind == "skid":
            least[struck.fault.robot] -= abs(struck.fault.value)
    solid = SolidGround(floor.boundary, floor.obstacles)
    for name, stays in trial.stays.items():
        for since, until in stays:
            box = boxes[name].between(since, until, 0.0)
            if len(box.t):
                near, time = solid.nearest(box)
                if near < least[name]:
                    yield f"solid: {name} at {time:.2f} s: {near:.4f} m, needs {least[name]:.3f} m"
    for a, b in combinations(trial.stays, 2):
        for one, other in product(trial.stays[a], trial.stays[b]):
            since, until = max(one[0], other[0]), min(one[1], other[1])
            pair = [boxes[name].between(since, until, 0.0) for name in (a, b)]
            if all(len(box.t) for box in pair):
                near, time = least_separation(*pair)
                if near < least[a] + least[b]:
                    needs = least[a] + least[b]
                    yield f"touch: {a}, {b} at {time:.2f} s: {near:.4f} m, need {needs:.3f} m"


def _run(
    seed: int, is_proven: bool, script: Script | None = None, *, floors: bool = False
) -> tuple[Trial, list[str]]:
    """Run a seed, or other acts in its hall; return the run and what was wrong with it."""
    with TemporaryDirectory() as folder:
        logs = RunLogs(Path(folder), power_cuts=True)
        trial = Trial(seed, logs, script, floors=floors)
        try:
            trial.run()
            logs.close()
            return trial, list(judged(trial, logs, is_proven))
        except Exception as error:  # Whatever ends the coordinator is told with its seed.
            return trial, [f"crash: {type(error).__name__}: {error}"]


def run_seed(seed: int, prove_each: int = 4, *, floors: bool = False) -> Result:
    """Run one seed; its logs are replayed and proven if it is a multiple of `prove_each`."""
    trial, problems = _run(seed, seed % prove_each == 0, floors=floors)
    script = tuple(_text(one) for one in trial.script) if problems else ()
    told = [one.text for one in trial.world.fleet.incidents]
    return Result(
        seed,
        tuple(problems),
        script,
        len(trial.script),
        sum("others go around" in text for text in told),
        sum("resumed" in text for text in told),
    )


def shrunk(script: Script, fails: Callable[[Script], bool]) -> Script:
    """Return some of the acts that still fail: halves are left out, then ever smaller parts."""
    size = len(script)
    while size > 1:
        size = (size + 1) // 2
        for begin in reversed(range(0, len(script), size)):
            fewer = script[:begin] + script[begin + size :]
            if fails(fewer):
                script = fewer
    return script


def shrink(seed: int, *, floors: bool = False) -> list[str]:
    """Return what is wrong with a seed, and the few acts that are enough for that."""
    trial, problems = _run(seed, True, floors=floors)
    kinds = {problem.split(":")[0] for problem in problems}
    is_proven = not kinds.isdisjoint(("proof", "replay"))

    def fails(script: Script) -> bool:
        found = _run(seed, is_proven, script)[1]
        return not kinds.isdisjoint(problem.split(":")[0] for problem in found)

    return [*problems, *map(_text, shrunk(trial.script, fails) if problems else ())]


def _text(one: tuple[float, Act]) -> str:
    time, act = one
    return f"{time:.2f} s: {write_fault(act) if isinstance(act, Fault) else act}"


def main() -> None:
    """Run seeds and print what was wrong, or shrink one."""
    parser = parser_of(__doc__, 100)
    parser.add_argument(
        "--prove-each", type=int, default=4, help="prove the logs of every Nth seed"
    )
    parser.add_argument("--shrink", type=int, metavar="SEED", help="find the fewest acts that fail")
    parser.add_argument("--floors", action="store_true", help="change floors, too")
    asked = parser.parse_args()
    if asked.shrink is not None:
        sys.stdout.write("\n".join(shrink(asked.shrink, floors=asked.floors)) + "\n")
        return
    seeds = range(asked.from_seed, asked.from_seed + asked.count)
    run = partial(run_seed, prove_each=asked.prove_each)
    if asked.floors:
        run = partial(run, floors=True)
    results = in_turn(run, seeds, asked.jobs, asked.kept)
    bad = [one for one in results if one.problems]
    total: Row = {
        "runs": len(results),
        "bad": len(bad),
        "acts": sum(one.acts for one in results),
        "given up": sum(one.given_up for one in results),
        "resumed": sum(one.resumed for one in results),
    }
    wrong: list[Row] = [
        {"seed": one.seed, "problem": problem} for one in bad for problem in one.problems
    ]
    acts: list[Row] = [{"seed": one.seed, "act": text} for one in bad for text in one.script]
    tables = {"operators among faults": [total], "what was wrong": wrong, "its acts": acts}
    record("operator_campaign", tables)


if __name__ == "__main__":
    main()
