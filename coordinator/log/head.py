"""The head of a coordinator's log: metadata of the run, and the first attachments.

Decides: what a later coordinator and `replay --check` need to run the log again.  Must not know:
how the log is written.
"""

from __future__ import annotations

from coordinator.log import versions
from coordinator.log.log_file import RESUMED
from coordinator.log.log_writer import Attachment
from coordinator.plan.document import PlanDocument
from coordinator.plan.plan_file import plan_name, to_json
from coordinator.scenario.model import Scenario
from coordinator.scenario_files.scenario_reader import scenario_to_json

Head = tuple[dict[str, str], list[Attachment]]
"""Metadata and attachments."""


def first_head(
    scenario: Scenario,
    document: PlanDocument,
    *,
    boot: int,
    effort: int,
    speed: float = 1.0,
    stays: bool = False,
) -> Head:
    """Return the head of a run's first log; `stays`: whether the fleet waits for orders."""
    metadata = {
        "fleet": document.scenario,
        "policy": document.policy,
        "boot": str(boot),
        "effort": str(effort),
        "speed": str(speed),
        "stays": "yes" if stays else "no",
        **versions.ours(),
    }
    return metadata, [scenario_file(scenario), plan_file(document)]


def resumed(head: Head, before: bytes, began_ns: int) -> Head:
    """Return the head of a log that resumes another log, `before`, at `began_ns`.

    `head` is that of a first log, with the newest plan.  `before` is empty if the other log stands
    in the same folder.
    """
    metadata, files = head
    inner = [Attachment(RESUMED, "application/octet-stream", before)] if before else []
    return {**metadata, "began_ns": str(began_ns)}, [*files, *inner]


def scenario_file(scenario: Scenario) -> Attachment:
    """Return a scenario as an attachment."""
    return Attachment("scenario.json", "application/json", scenario_to_json(scenario))


def plan_file(document: PlanDocument) -> Attachment:
    """Return a plan as an attachment, named by its epoch."""
    name = plan_name(document.epoch)
    return Attachment(name, "application/json", to_json(document))
