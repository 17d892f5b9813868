"""From a scenario to a fleet in motion: the only package that plans.

The names below are for other programs and stay as they are (planning/library.py, docs/tutorial.md).
They are loaded when they are first used: commands that plan nothing start quickly.
"""

from typing import TYPE_CHECKING

__all__ = [
    "GivenPath",
    "InputError",
    "Plan",
    "PlanError",
    "Proof",
    "Robot",
    "Scenario",
    "Workspace",
    "motion_of",
    "plan_scenario",
    "plan_to_json",
    "prove_plan",
    "read_plan",
    "read_scenario",
    "scenario_from",
]

if TYPE_CHECKING:
    from coordinator.planning.library import (
        GivenPath,
        InputError,
        Plan,
        PlanError,
        Proof,
        Robot,
        Scenario,
        Workspace,
        motion_of,
        plan_scenario,
        plan_to_json,
        prove_plan,
        read_plan,
        read_scenario,
        scenario_from,
    )
else:

    def __getattr__(name: str) -> object:
        """Return one of the names above."""
        if name not in __all__:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        from coordinator.planning import library

        return getattr(library, name)
