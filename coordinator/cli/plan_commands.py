"""The coordinator's commands: plan, verify, coordinator, plot.

Decides: their options and exit codes.  Heavy modules are imported when a command needs them.
"""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypeVar

import msgspec
import typer

from coordinator.base.console import answer_json, answers, tell, write_file
from coordinator.base.errors import InputError
from coordinator.cli.option_checks import (
    cluster_at,
    given,
    if_given,
    not_with,
    one_of,
    only_with,
    reached,
    within,
    writable,
)
from coordinator.service.key_option import Insecure, Keys

if TYPE_CHECKING:
    from coordinator.log.records import Log
    from coordinator.plan.document import PlanDocument
    from coordinator.scenario.model import Scenario

commands = typer.Typer()
Value = TypeVar("Value")

ScenarioFile = Annotated[Path, typer.Argument(help="Scenario file, TOML or JSON.")]
PlanFile = Annotated[
    Path,
    typer.Argument(
        metavar="PLAN|LOG",
        help="Plan file, as written by `plan -o`, or log of a run: FILE.mcap, or its folder.",
    ),
]
LogFile = Annotated[Path, typer.Argument(help="Log of a run, MCAP.")]
Source = Annotated[
    Path, typer.Argument(metavar="PLAN|LOG", help="Log of a run (MCAP) or plan file (JSON).")
]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON on stdout.")]


def make_folder(folder: Path) -> None:
    """Make a folder unless it exists; raise InputError of one line if that fails."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError([f"{folder}: {error.strerror}; the output must be a folder"]) from None


def given_log(source: Path) -> Log:
    """Read the log that a person names, and tell them what they have to know of its files."""
    from coordinator.log.log_file import read_log

    log = read_log(source)
    tell_remarks(source, log.remarks)
    return log


def tell_remarks(source: Path, remarks: Iterable[str]) -> None:
    """Tell what whoever relies on a log has to know of its files."""
    for remark in remarks:
        tell(f"{source}: {remark}", "yellow")


def newest_plan(source: Path, what_for: str) -> PlanDocument:
    """Read a plan file, or the plan of a log's last epoch with the courses that robots got since.

    If the log holds plans of several epochs, a message says which one was taken.
    """
    from coordinator.exchange.motion_story import documents_of
    from coordinator.findings.plans_from_messages import in_force, plans_said
    from coordinator.log.log_file import readable_logs_before
    from coordinator.plan.plan_file import read
    from coordinator.scenario.file_kinds import is_log

    if not is_log(source):
        return read(source)
    log = given_log(source)
    documents = documents_of(log)
    said = plans_said(log, documents)
    documents |= said
    if not documents:
        raise InputError([f"{source}: holds no plan, so there is nothing {what_for}"])
    last = max(documents)
    if len(documents) > 1:
        tell(f"{source}: using the plan of epoch {last}, the last of {len(documents)} in the log")
    document = documents[last]
    newest = in_force(document, documents[min(documents)], [*readable_logs_before(log), log])
    known = () if last in said else document.notes
    for note in newest.notes[len(known) :]:
        tell(f"{source}: {note}")
    return newest


Speed = Annotated[
    float,
    typer.Option(
        callback=within(0.01, 1000.0),
        help="Speed of the fleet's clock, 0.01 to 1000; 1 is real time, 2 twice as fast.",
    ),
]


def _served(page: str) -> str:
    """Accept a host and a port; whether it may be reached by others depends on the keys."""
    from coordinator.service.desk_process import host_and_port

    try:
        host_and_port(page)
    except InputError as error:
        raise typer.BadParameter(str(error).removeprefix("--page: ")) from None
    return page


Page = Annotated[
    str | None,
    typer.Option(
        metavar="HOST:PORT",
        callback=if_given(_served),
        help="Serve the operator's page there; port 0 takes a free one.",
    ),
]

Effort = Annotated[
    int,
    typer.Option(
        min=0, max=100_000, help="How many tries the planner has to find a better robot order."
    ),
]

Cluster = Annotated[
    str | None,
    typer.Option(
        metavar="tcp://HOST:PORT",
        callback=cluster_at,
        help="Share the work with a Dask cluster, by its scheduler's address.",
    ),
]


@commands.command(rich_help_panel="Plan")
def plan(
    scenario: ScenarioFile,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="FILE.json", callback=writable(".json")),
    ] = None,
    csv: Annotated[
        Path | None,
        typer.Option(help="Also write the motions as CSV rows.", callback=writable(".csv")),
    ] = None,
    step: Annotated[
        float,
        typer.Option(
            callback=only_with("csv", check=within(1e-4, 1e3)),
            help="Seconds from one CSV row to the next.",
        ),
    ] = 0.02,
    policy: Annotated[
        Literal["safe", "paper"] | None,
        typer.Option(
            help="How robots wait; paper, Algorithm 2 as printed, is for study only. "
            "The default is the scenario's policy."
        ),
    ] = None,
    effort: Effort = 20,
    check_floor: Annotated[
        bool, typer.Option("--check-floor", help="Tell which places close a way for others.")
    ] = False,
    cluster: Cluster = None,
    as_json: Json = False,
) -> None:
    """Plan a scenario, prove the plan and write it.

    Example: splinefleet plan examples/paper_five.toml -o plan.json --csv plan.csv
    """
    from coordinator.findings.plan_table import render
    from coordinator.plan.plan_file import to_json
    from coordinator.plan.trajectory import csv_rows
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.service.cluster import executor_on
    from coordinator.service.planning import plan_here

    asked = read_scenario(scenario)
    if policy is not None:
        asked = msgspec.structs.replace(asked, policy=policy)
    if as_json:
        for note in asked.workspace.notes:
            tell(note)
    if check_floor:
        _tell_closed_ways(asked)
    with nullcontext() if cluster is None else executor_on(cluster) as executor:
        document = plan_here(asked, effort, executor=executor).document
    if output is not None:
        write_file(output, to_json(document))
    if csv is not None:
        write_file(csv, ("\n".join(csv_rows(document, step)) + "\n").encode())
    if as_json:
        answer_json(document)
    else:
        answers.print(render(document))
        for written in (output, csv):
            if written is not None:
                tell(f"wrote {written}")
    if document.proof is None or not document.proof.holds:
        tell("the proof does not hold; this plan is for study and is never sent to robots")
        raise typer.Exit(1)


def _tell_closed_ways(scenario: Scenario) -> None:
    """Tell which places close a way while a robot rests there."""
    from coordinator.planning.floor_check import closed_ways

    found = closed_ways(scenario)
    for closed in found:
        x, y = closed.place
        tell(
            f"{closed.name} ({x:.2f}, {y:.2f}): a robot that rests there closes the way between "
            f"{closed.one} and {closed.other}"
        )
    if not found:
        tell("the floor is well formed: no robot that rests closes a way")


@commands.command(rich_help_panel="Plan")
def verify(
    plan: PlanFile,
    scenario: Annotated[
        Path | None, typer.Option(help="Take the floor and the limits from this scenario.")
    ] = None,
    allow_unproven: Annotated[
        list[str] | None,
        typer.Option(
            help="Accept the plan even if its file holds too little to prove this: clearance or "
            "limits; repeatable.",
            callback=one_of("clearance", "limits"),
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Prove a plan again, or a log: its plans and every authority that it granted.

    The exit code is 1 if the proof does not hold, or if clearance or limits cannot be proven and
    --allow-unproven does not name them.

    Example: splinefleet verify plan.json --scenario examples/paper_five.toml
    """
    from coordinator.base.errors import InputError
    from coordinator.findings.plan_table import render_proof
    from coordinator.plan.plan_file import read
    from coordinator.plan.wire import packed
    from coordinator.proof.verify import prove_messages
    from coordinator.scenario.file_kinds import is_log
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.schedule.staircase_making import with_staircases

    site = None if scenario is None else read_scenario(scenario)
    if is_log(plan):
        if allow_unproven:
            raise typer.BadParameter("has no effect on a log", param_hint="--allow-unproven")
        _verify_log(plan, site, as_json)
        return
    document = read(plan)
    try:
        proof = prove_messages(with_staircases(packed(document)), site)
    except InputError as error:
        named = [problem.replace("plan:", f"{plan}:", 1) for problem in error.problems]
        raise InputError(named) from None
    if as_json:
        answer_json(proof)
    else:
        answers.print(render_proof(proof))
    missing = [name for name in proof.unproven if name not in (allow_unproven or [])]
    for name in missing:
        tell(
            f"{plan}: {name} is not proven: the file does not hold enough; give --scenario FILE, "
            f"or accept it with --allow-unproven {name}"
        )
    if missing or not proof.holds:
        raise typer.Exit(1)


def _verify_log(path: Path, site: Scenario | None, as_json: bool) -> None:
    """Prove a log and print the proof; exit code 1 if it does not hold."""
    from coordinator.findings.log_proof import prove_log
    from coordinator.findings.plan_table import render_log_proof
    from coordinator.log.log_file import logs_before

    log = given_log(path)
    proof = prove_log(log, site, logs_before(log, str(path)))
    if not proof.epochs:
        raise InputError([f"{path}: holds no plan that could be proven"])
    if as_json:
        answer_json(proof)
    else:
        answers.print(render_log_proof(proof))
    if not (log.complete or log.damage):
        tell(f"{path}: was not closed; what may have come after its end is not proven", "yellow")
    if not proof.holds:
        raise typer.Exit(1)


@commands.command(rich_help_panel="Run")
def coordinator(
    scenario: ScenarioFile,
    listen: Annotated[
        str | None,
        typer.Option(
            callback=reached, help="tcp/HOST:PORT to listen on; by default tcp/127.0.0.1:7447."
        ),
    ] = None,
    connect: Annotated[
        str | None,
        typer.Option(
            callback=not_with("listen", check=reached),
            help="tcp/HOST:PORT of a router, in place of --listen.",
        ),
    ] = None,
    keys: Keys = None,
    insecure: Insecure = False,
    log: Annotated[
        Path | None,
        typer.Option(
            help="Record all messages into this file, or into files in this folder (a name "
            "without a suffix): run-0001.mcap and so on.",
            callback=writable(),
        ),
    ] = None,
    log_size: Annotated[
        float,
        typer.Option(
            callback=only_with("log", "resume", check=within(0.1)),
            help="MB after which a folder gets its next file.",
        ),
    ] = 64.0,
    resume: Annotated[
        Path | None,
        typer.Option(
            help="Resume from this log of a coordinator that has ended; a folder is gone on with."
        ),
    ] = None,
    with_scenario: Annotated[
        bool,
        typer.Option(
            "--with-scenario",
            callback=only_with("resume"),
            help="With --resume: freeze, and plan anew on the scenario's floor, which has changed.",
        ),
    ] = False,
    plan_out: Annotated[
        Path | None, typer.Option(help="Write the plan to this file.", callback=writable(".json"))
    ] = None,
    speed: Speed = 1.0,
    effort: Effort = 20,
    wait: Annotated[
        float, typer.Option(callback=within(0.1), help="Seconds to wait for all robots.")
    ] = 60.0,
    stay: Annotated[
        bool, typer.Option("--stay", help="Wait for orders until the fleet is told to end.")
    ] = False,
    page: Page = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print events as JSON lines.")] = False,
) -> None:
    """Run only the coordinator; robots connect to it, or it and the robots to a router.

    Example: splinefleet coordinator site.toml --listen tcp/127.0.0.1:7447 --log run.mcap
    """
    from coordinator.scenario_files.scenario_reader import read_scenario
    from coordinator.service.desk_process import desk_place
    from coordinator.service.launch import Coordinator
    from coordinator.service.meeting_place import meeting_place

    place = meeting_place(listen, connect, keys, insecure)
    desk = None if page is None else desk_place(page, keys)
    asked = read_scenario(scenario)
    runner = Coordinator(asked, effort=effort, speed=speed, events=as_json, stays=stay)
    code = runner.run(
        place,
        log,
        plan_out,
        wait,
        resume,
        keys,
        log_size,
        with_scenario=with_scenario,
        desk=desk,
    )
    raise typer.Exit(code)


def _drawn(context: typer.Context, param: typer.CallbackParam, value: Value) -> Value:
    """Accept an option of pictures, which a page, FILE.html, ignores."""
    output = context.params.get("output")
    if given(context, str(param.name)) and output and output.suffix.lower() == ".html":
        raise typer.BadParameter(f"has no effect on a page, {output}")
    return value


@commands.command(rich_help_panel="Plan")
def plot(
    source: Annotated[Path, typer.Argument(metavar="PLAN|LOG", help="Plan file or log.")],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="FILE.svg, .png or .html.", callback=writable())
    ],
    robots: Annotated[
        str,
        typer.Option(
            callback=_drawn, help="Robots to draw in full, such as R1,R3; the others are faint."
        ),
    ] = "",
    detail: Annotated[
        bool | None,
        typer.Option(
            "--detail/--no-detail",
            callback=_drawn,
            help="Draw control polygons and curvature combs; by default for 8 robots or fewer.",
        ),
    ] = None,
) -> None:
    """Draw the floor with paths, crossings and stops, and the distance-time diagram.

    A line around each obstacle is its outline grown by radius + margin; no robot's centre may
    cross it.  Of a log, the plan of the last epoch is drawn, with the courses that robots got
    since.  An .html file is the page of `splinefleet view`, which plays the plan or the log.

    Example: splinefleet plot plan.json -o plan.svg --robots R1,R3
    """
    from coordinator.scenario.file_kinds import is_log
    from coordinator.view.scene_reader import read_scene

    if output.suffix.lower() == ".html":
        from coordinator.view.page import page_of

        scene = read_scene(source)
        for note in scene.notes:
            tell(f"{source}: {note}")
        write_file(output, page_of(scene).encode())
        tell(f"wrote {output}")
        return
    from coordinator.view.figure import draw_plan
    from coordinator.view.figure_left_behind import left_behind
    from coordinator.view.figure_selection import View

    document = newest_plan(source, "to draw")
    chosen = tuple(name.strip() for name in robots.split(",") if name.strip())
    view = View(chosen, detail)
    if is_log(source):
        scene = read_scene(source)
        fleet = tuple(robot.id for robot in scene.robots)
        view = View(chosen, detail, fleet, left_behind(scene))
    draw_plan(document, output, view)
    tell(f"wrote {output}")
