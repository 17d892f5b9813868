"""One run of a fleet in virtual time that leaves the files of a real one.

Decides: the link, the flaws of clocks and bodies, and what is told meanwhile.  Must not know:
options.  The same arguments give the same bytes, so nothing of this machine may enter: no time of
day, and no planning times.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

from coordinator.base.console import tell, tell_now, write_file
from coordinator.mission.aside_news import AsideNews
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import to_json
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import scenario_to_json
from coordinator.service.alarm_bell import AlarmBell
from coordinator.service.desk_process import DeskPlace, with_desk
from coordinator.service.planning import check_is_driven, plan_here
from protocol.timing import SECOND
from sim.campaigns.campaign import run_world
from sim.judging.blackbox import blackbox_text
from sim.processes.local_fleet import TROUBLE
from sim.processes.run_folder import clear_folder
from sim.world.desk_window import DESK, STEP_S, DeskWindow
from sim.world.fault_script import write_fault
from sim.world.fault_text import Fault
from sim.world.memory_transport import MemoryNetwork
from sim.world.run_logs import RunLogs
from sim.world.virtual_fleet import USUAL_FLAWS, World


def plan_run(folder: Path, scenario: Scenario, effort: int) -> PlanDocument:
    """Begin a run: replace an earlier one in `folder` by the scenario and its plan.

    Raises InputError or PlanError when the scenario is not driven or has no plan.
    """
    check_is_driven(scenario)
    document = plan_here(scenario, effort, timer=lambda: 0.0).document
    clear_folder(folder)
    write_file(folder / "scenario.json", scenario_to_json(scenario))
    write_file(folder / "plan.json", to_json(document))
    return document


def simulate_run(
    folder: Path,
    scenario: Scenario,
    document: PlanDocument,
    faults: Sequence[Fault],
    *,
    seed: int,
    box_rate: float | None,
    effort: int,
    desk: DeskPlace | None = None,
    speed: float = 1.0,
) -> bool:
    """Run a planned fleet on its scenario's link; return whether every robot has arrived.

    Logs, later plans and black boxes go into `folder`, also when the run is interrupted.  The boxes
    have `box_rate` rows per second, or one per tick.  With a desk the fleet stays until it is told
    to end, and `speed` of its seconds pass in one of this machine's.  Raises InputError if the desk
    cannot be served there.
    """
    network = MemoryNetwork(
        seed, loss=scenario.link.loss, delay_ns=(0, round(scenario.link.delay * SECOND))
    )
    with closing(RunLogs(folder)) as logs:
        world = World(
            scenario,
            document,
            network,
            seed=seed,
            faults=faults,
            flaws=USUAL_FLAWS,
            row_period_ns=1 if box_rate is None else round(SECOND / box_rate),
            effort=effort,
            logs=logs,
            stays=desk is not None,
        )
        teller = _Teller(world, by_day=desk is not None)
        try:
            if desk is None:
                over, _ = run_world(world, document, teller.tell_news)
            else:
                over = _run_before_people(world, document, network, desk, speed, teller)
        finally:
            _write_boxes(folder, world)
    teller.tell_end(over)
    return over and world.fleet.members.has_arrived


def _run_before_people(
    world: World,
    document: PlanDocument,
    network: MemoryNetwork,
    place: DeskPlace,
    speed: float,
    teller: _Teller,
) -> bool:
    """Run a world that a desk looks at; return whether the fleet reached OVER."""

    def told(_address: str, text: str) -> None:
        tell_now(text)

    with (
        with_desk(network.session(DESK), document, place, told) as link,
        ThreadPoolExecutor(1) as beside,
    ):
        world.coordinator.beside = beside  # People do not wait while a course is looked for.
        tell_now("orders are taken until the mission is ended: press end mission on the page")
        window = DeskWindow(world, link, speed)

        def watch() -> None:
            teller.tell_news()
            window.keep_pace()

        over, _ = run_world(world, document, watch, STEP_S)
        return over


def _write_boxes(folder: Path, world: World) -> None:
    for name, robot in world.robots.items():
        write_file(folder / "blackbox" / f"{name}.csv", blackbox_text(robot.written_rows()))


class _Teller:
    """Tells what happens in a world, with the time [s] since the first GO, or that of the day."""

    def __init__(self, world: World, *, by_day: bool) -> None:
        self._world, self._by_day = world, by_day
        self._aside_news = AsideNews()
        self._bell = AlarmBell()
        self._incidents = 0
        self._strikes = 0

    def tell_news(self) -> None:
        """Tell the trouble and the strikes since the last call, in the order of their times."""
        world = self._world
        incidents = world.fleet.incidents
        news = [
            (one.now_ns, one.text) for one in incidents[self._incidents :] if one.kind in TROUBLE
        ]
        news += [(one.now_ns, write_fault(one.fault)) for one in world.struck[self._strikes :]]
        news += [
            (world.now_ns, text) for _, text in self._aside_news.news(world.mission, world.now_ns)
        ]
        if self._by_day:
            alarms = self._bell.news(world.fleet, world.now_ns, time.time())
            news += [(world.now_ns, text) for _, text in alarms]
        self._incidents, self._strikes = len(incidents), len(world.struck)
        for now_ns, text in sorted(news, key=lambda one: one[0]):
            self._tell(now_ns, text)

    def tell_end(self, over: bool) -> None:
        """Tell which faults came too late, and that a fleet that is not over was given up."""
        struck = [one.fault for one in self._world.struck]
        for fault in self._world.faults:
            if fault not in struck:
                tell(f"{write_fault(fault)}: the run had ended before")
        if not over:
            self._tell(self._world.now_ns, "given up: the fleet does not come to its end")

    def _tell(self, now_ns: int, text: str) -> None:
        if self._by_day:
            tell_now(text)
        else:
            tell(f"{(now_ns - self._world.began_ns) / SECOND:.2f} s {text}")
