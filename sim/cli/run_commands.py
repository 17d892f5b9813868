"""The commands that make scenarios, and run, judge and test whole fleets on this machine.

Decides: options and exit codes.
"""

from __future__ import annotations

import difflib
import os
import time
from pathlib import Path
from typing import Annotated, cast, get_args

import typer

from coordinator.base.console import answer_json, answers, tell, write_file
from coordinator.base.errors import InputError
from coordinator.cli.option_checks import if_given, not_with, only_with, reached, within, writable
from coordinator.cli.plan_commands import Cluster, Effort, Json, Page, tell_remarks
from coordinator.scenario.model import MOST_ROBOTS
from coordinator.service.key_option import Keys
from sim.floors.layout import LEAST_SIDE, MOST_SIDE, Kind, Size
from sim.world.fault_script import fault_help as script_help
from sim.world.fault_script import known_kinds
from sim.world.fault_text import fault_help

commands = typer.Typer()

RunOut = Annotated[
    Path | None,
    typer.Option(help="Folder for the run; an earlier run of the same fleet there is replaced."),
]
Force = Annotated[bool, typer.Option("--force", help="Also replace the run of another fleet.")]


def _sized(size: Size) -> Size:
    """Accept the sides of a floor."""
    if not all(LEAST_SIDE <= side <= MOST_SIDE for side in size):
        limits = f"from {LEAST_SIDE:g} m to {MOST_SIDE:g} m each way"
        raise typer.BadParameter(f"{size[0]:g} m x {size[1]:g} m is not {limits}")
    return size


def known(kind: str) -> str:
    """Check that there is such a kind of floor; the error names the nearest one and lists all."""
    kinds = get_args(Kind)
    if kind not in kinds:
        (nearest,) = difflib.get_close_matches(kind[:40].lower(), kinds, n=1, cutoff=0.0)
        raise typer.BadParameter(
            f"{kind[:60]!r} is not a kind of floor, the nearest one is {nearest}; "
            f"the kinds are {', '.join(kinds)}"
        )
    return kind


@commands.command(rich_help_panel="Plan")
def scenario(
    kind: Annotated[
        str, typer.Argument(metavar="KIND", help=", ".join(get_args(Kind)) + ".", callback=known)
    ],
    robots: Annotated[int, typer.Option(min=1, max=MOST_ROBOTS, help="Number of robots.")] = 17,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the random choices.")] = 1,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="FILE.toml or FILE.json; by default stdout.",
            callback=writable(".toml", ".json"),
        ),
    ] = None,
    size: Annotated[
        Size | None,
        typer.Option(
            metavar="W H", callback=if_given(_sized), help="Width and height of the floor, metres."
        ),
    ] = None,
    obstacles: Annotated[int | None, typer.Option(min=0, help="Number of obstacles.")] = None,
    headings: Annotated[
        bool, typer.Option("--headings", help="Give every robot a start and a goal heading.")
    ] = False,
    vias: Annotated[int, typer.Option(min=0, max=20, help="Via points per robot.")] = 0,
    mixed: Annotated[
        bool, typer.Option("--mixed", help="Give robots different radii and speeds.")
    ] = False,
) -> None:
    """Make a scenario file: a floor of some kind with robots that have somewhere to go.

    Example: splinefleet scenario warehouse --robots 17 --seed 3 -o hall.toml
    """
    from coordinator.scenario_files.scenario_reader import scenario_to_json
    from coordinator.scenario_files.toml_writer import scenario_to_toml
    from sim.floors.generator import generate

    made = generate(
        cast(Kind, kind),
        robots,
        seed,
        size,
        obstacles=obstacles,
        headings=headings,
        vias=vias,
        mixed=mixed,
    )
    options = [f"--robots {robots} --seed {seed}"]
    options += [f"--size {size[0]:g} {size[1]:g}"] if size else []
    options += [] if obstacles is None else [f"--obstacles {obstacles}"]
    options += ["--headings"] if headings else []
    options += [f"--vias {vias}"] if vias else []
    options += ["--mixed"] if mixed else []
    command = f"splinefleet scenario {kind} {' '.join(options)}"
    if output is None:
        typer.echo(scenario_to_toml(made, f"Made by: {command}"), nl=False)
    elif output.suffix.lower() == ".json":
        write_file(output, scenario_to_json(made))
    else:
        write_file(output, scenario_to_toml(made, f"Made by: {command}"))
    if output is not None:
        many = f"{len(made.robots)} robots, {len(made.workspace.obstacles)} obstacles"
        tell(f"wrote {output}: {made.name}, {many}")


@commands.command(rich_help_panel="Run")
def run(
    scenario: Annotated[Path, typer.Argument(help="Scenario file, TOML or JSON.")],
    out: RunOut = None,
    speed: Annotated[
        float,
        typer.Option(
            callback=within(0.1, 20.0),
            help="Speed of the fleet's clock; 1 is real time. Robots that cannot keep up stop.",
        ),
    ] = 1.0,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC", help=f"A fault, SECONDS after GO, repeatable. {fault_help()}."
        ),
    ] = None,
    effort: Effort = 20,
    connect: Annotated[
        str | None,
        typer.Option(
            callback=reached,
            help="tcp/HOST:PORT of a router that the coordinator and the robots connect to.",
        ),
    ] = None,
    core: Annotated[
        list[str] | None,
        typer.Option(
            metavar="[ROBOT=]PROGRAM",
            help="A program that decides in place of the agent's core, for one robot or for all; "
            "repeatable.",
        ),
    ] = None,
    keys: Keys = None,
    page: Page = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a fleet: one coordinator and one process per robot, on this machine.

    With --page it takes orders until the mission is ended, on the page or by `splinefleet end`.

    Example: splinefleet run examples/paper_five.toml --fault kill:R3@8
    """
    from coordinator.scenario_files.scenario_reader import read_scenario
    from sim.processes.conclusion import conclude
    from sim.processes.local_fleet import LocalFleet
    from sim.processes.run_folder import RunFolder
    from sim.world.fault_text import parse_faults

    asked = read_scenario(scenario)
    names = [robot.id for robot in asked.robots]
    faults = parse_faults(fault or [], names)
    cores = _cores(core or [], names)
    folder = out or _new_folder(asked.name)
    place = RunFolder(folder, asked.name, force=force)
    fleet = LocalFleet(
        asked,
        folder,
        speed=speed,
        effort=effort,
        faults=faults,
        router=connect,
        keys=keys,
        page=page,
        cores=cores,
    )
    try:
        outcome = fleet.run()
    except KeyboardInterrupt:
        if fleet.has_started:
            tell(f"interrupted; {folder} holds what was recorded")
        raise
    finally:
        if not fleet.has_started:
            place.leave_nothing()
    if not outcome.started:
        raise typer.Exit(outcome.code or 1)
    conclude(folder, asked.name, outcome.code, as_json)


@commands.command(rich_help_panel="Run")
def simulate(
    scenario: Annotated[Path, typer.Argument(help="Scenario file, TOML or JSON.")],
    out: RunOut = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC", help=f"A fault, SECONDS after GO, repeatable. {script_help()}."
        ),
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, help="Seed of losses, delays, and errors of clocks and wheels.")
    ] = 0,
    box_rate: Annotated[
        float | None,
        typer.Option(
            metavar="HZ",
            callback=if_given(within(1.0, 100.0)),
            help="Rows per second of the black boxes; by default one per tick, 100.",
        ),
    ] = None,
    effort: Effort = 20,
    page: Page = None,
    speed: Annotated[
        float,
        typer.Option(
            callback=only_with("page", check=within(0.1, 20.0)),
            help="With --page: speed of the fleet's clock; 1 is real time.",
        ),
    ] = 1.0,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a fleet in virtual time, in one process: the files of `run`, the same for the same seed.

    With --page it keeps pace with the clock, and takes orders until it is told to end.

    Example: splinefleet simulate examples/paper_five.toml --fault kill:R3@8 --seed 2
    """
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.service.desk_process import desk_place
    from sim.campaigns.simulation import plan_run, simulate_run
    from sim.processes.conclusion import conclude
    from sim.processes.run_folder import RunFolder
    from sim.world.fault_script import read_faults

    desk = None if page is None else desk_place(page, None)
    asked = read_scenario(scenario)
    faults = read_faults(fault or [], [robot.id for robot in asked.robots])
    folder = out or _new_folder(asked.name)
    place = RunFolder(folder, asked.name, force=force)
    try:
        document = plan_run(folder, asked, effort)
    except BaseException:
        place.leave_nothing()
        raise
    try:
        arrived = simulate_run(
            folder,
            asked,
            document,
            faults,
            seed=seed,
            box_rate=box_rate,
            effort=effort,
            desk=desk,
            speed=speed,
        )
    except KeyboardInterrupt:
        tell(f"interrupted; {folder} holds what was recorded")
        raise
    conclude(folder, asked.name, 0 if arrived else 1, as_json)


def _cores(specs: list[str], names: list[str]) -> dict[str, Path]:
    """Return the programs of `--core` by robot; one that is for all gives way to a robot's own."""
    for_all: dict[str, Path] = {}
    own: dict[str, Path] = {}
    for spec in specs:
        robot, is_own, program = spec.rpartition("=")
        if not Path(program).is_file():
            raise typer.BadParameter(f"no file {program!r}", param_hint="--core")
        if is_own and robot not in names:
            known = ", ".join(names)
            raise typer.BadParameter(f"no robot {robot!r}, there are {known}", param_hint="--core")
        if is_own:
            own[robot] = Path(program)
        else:
            for_all = dict.fromkeys(names, Path(program))
    return for_all | own


def _new_folder(name: str) -> Path:
    """Return the folder of a run for which none is named."""
    return Path("runs") / f"{name}-{time.strftime('%Y%m%d-%H%M%S')}"


@commands.command(rich_help_panel="Inspect")
def judge(
    source: Annotated[Path, typer.Argument(help="Folder of a run, or its log.")],
    as_json: Json = False,
) -> None:
    """Find out from the black boxes what happened: collisions, arrivals, tracking errors.

    The folder holds plan.json or the coordinator's log, which has the plans in it, and ROBOT.csv or
    blackbox/ROBOT.csv of every robot.  If a log is named, its folder is used.

    Example: splinefleet judge runs/demo
    """
    from sim.judging.evidence import gather
    from sim.judging.judge import judge_evidence
    from sim.processes.summary import render_verdict

    found = gather(source)
    tell_remarks(source, found.remarks)
    verdict = judge_evidence(found)
    if as_json:
        answer_json(verdict)
    else:
        answers.print(render_verdict(verdict))
    if not verdict.is_good():
        raise typer.Exit(1)


def _fault_kinds(text: str) -> str:
    """Accept kinds of faults, separated by commas."""
    try:
        known_kinds(text)
    except InputError as error:
        raise typer.BadParameter(
            "; ".join(one.removeprefix("--faults ") for one in error.problems)
        ) from None
    return text


@commands.command(rich_help_panel="Run")
def campaign(
    scenario: Annotated[Path, typer.Argument(help="Scenario file, TOML or JSON.")],
    seeds: Annotated[int, typer.Option(min=1, help="Number of runs.")] = 100,
    from_seed: Annotated[int, typer.Option(min=0, help="Seed of the first run.")] = 0,
    faults: Annotated[
        str | None,
        typer.Option(
            metavar="KINDS",
            callback=if_given(_fault_kinds),
            help="Kinds of faults to draw from, separated by commas; by default all.",
        ),
    ] = None,
    fault: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SPEC",
            callback=not_with("faults"),
            help=f"A fault in place of random ones, repeatable; none: no fault. {script_help()}.",
        ),
    ] = None,
    loss: Annotated[
        float,
        typer.Option(
            callback=within(0.0, 0.3), help="Greatest share of messages that a link loses."
        ),
    ] = 0.3,
    delay_ms: Annotated[
        float,
        typer.Option(
            callback=within(0.0, 300.0), help="Greatest delay of a message, milliseconds."
        ),
    ] = 300.0,
    tau: Annotated[
        float | None,
        typer.Option(
            help="Tau of the plan, seconds; by default it covers all kinds of faults.",
            callback=if_given(within(0.0, 60.0)),
        ),
    ] = None,
    jobs: Annotated[
        int,
        typer.Option(
            min=1,
            callback=not_with("cluster"),
            help="Number of processes; by default one per core.",
        ),
    ] = (os.cpu_count() or 1),
    cluster: Cluster = None,
    as_json: Json = False,
) -> None:
    """Run a fleet many times in virtual time; seeds decide its links and faults.

    Example: splinefleet campaign examples/paper_five.toml --seeds 100
    """
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.service.cluster import executor_on
    from sim.campaigns.answer import render, say
    from sim.campaigns.campaign import Wish
    from sim.campaigns.pool import processes
    from sim.campaigns.shell import Campaign
    from sim.world.fault_script import USUAL

    kinds = known_kinds(faults) if faults else USUAL
    wish = Wish(kinds, loss, delay_ms / 1000.0, tau)
    asked = Campaign.asked(read_scenario(scenario), scenario, wish, fault)
    with processes(min(jobs, seeds)) if cluster is None else executor_on(cluster) as executor:
        answer = asked.run(range(from_seed, from_seed + seeds), executor)
    if as_json:
        answer_json(answer)
    else:
        answers.print(render(answer))
        for violation in answer.violations:
            answers.print(say(violation), markup=False)
    if answer.violations:
        raise typer.Exit(1)
