"""Which plans the two are compared on.

Decides: the scenes; those of more than a few robots are planned for the full comparison only.
"""

from functools import lru_cache

from coordinator.planning.planner import plan_fleet
from coordinator.scenario_files.scenario_reader import read_scenario
from sim.floors.generator import generate
from tests.test_readme import ROOT

KINDS = ("polygons", "warehouse", "corridors", "rooms", "u-traps", "maze", "grid", "ring", "circle",
         "open", "cross-town")  # fmt: skip
FEW = tuple((kind, 6, 1, ()) for kind in KINDS)
MORE = (
    *((kind, 17, 2, ()) for kind in KINDS),
    ("polygons", 12, 4, ("headings",)),
    ("open", 12, 5, ("mixed",)),
    ("polygons", 9, 6, ("vias",)),
)
EXAMPLES = ("paper_five", "paper_five_real", "circle_swap", "u_trap", "map_ros", "map_movingai")


@lru_cache(maxsize=len(FEW))
def planned(kind, robots, seed, more=()):
    """Return the PackedPlan of a generated scene."""
    options = {name: 2 if name == "vias" else True for name in more}
    return plan_fleet(generate(kind, robots, seed, **options))


def example(name):
    """Return the PackedPlan of an example that can be proven, else None."""
    scenario = read_scenario(ROOT / "examples" / f"{name}.toml")
    return plan_fleet(scenario) if scenario.policy == "safe" else None
