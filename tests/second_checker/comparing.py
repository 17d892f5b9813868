"""The product's proof and the second checker on the same plan, and where they disagree.

Decides: what counts as a disagreement.  This module alone knows both sides.
"""

from dataclasses import dataclass

from coordinator.base.errors import InputError
from coordinator.proof.verify import prove_messages
from tests.second_checker.checker import TOLERANCE, Terms, check

ALLOWED = 2.5e-4
"""By how much [m] the two may disagree."""

FLAT = 4e-4
"""By how much more [m] the proof may understate a clearance: it flattens curves more coarsely."""

_SAYS = {
    "speed": "drives faster",
    "acceleration": "changes speed faster",
    "begin": "does not begin and end at rest",
    "brakes": "is told to brake",
    "corner": "has a corner",
    "bend": "takes a bend",
    "turn": "turns tighter",
    "turn rate": "turns faster",
    "margin": "the margin is",
}
"""What a sentence of the proof says about a demand that is not met."""


@dataclass(frozen=True)
class Compared:
    """One plan: what was altered, whether the proof holds, both slacks [m], disagreements."""

    name: str
    holds: bool
    said: float | None
    found: tuple
    differences: list


def terms_of(plan):
    """Return the Terms of a PackedPlan: what its document says, as plain numbers."""
    document, stairs, knots = plan.document, plan.staircases, None
    names = [robot.id for robot in document.robots]
    if stairs is not None:
        knots = {
            (names[behind], names[ahead]): stairs.knots_of(pair) / 1000.0
            for pair, (behind, ahead) in enumerate(zip(stairs.behind, stairs.ahead, strict=True))
        }
    floor = document.workspace
    return Terms(
        tau=document.tau,
        margin=document.margin,
        radii={robot.id: robot.radius for robot in document.robots},
        limits={robot.id: robot.limits for robot in document.robots},
        walls=None if floor is None else list(floor.boundary),
        solids=None if floor is None else list(map(list, floor.obstacles)),
        staircases=knots,
    )


def compare(plan, name=""):
    """Return what both say about a PackedPlan."""
    found = check(plan.messages, terms_of(plan))
    try:
        proof = prove_messages(plan)
    except InputError:
        return Compared(name, False, None, found.separation, [])
    differences = _refused_in_vain(proof, found)
    if proof.holds and found.broken:
        differences.append(f"accepted in spite of {', '.join(found.broken)}")
    low, high = found.separation
    if proof.least_slack is not None and not proof.least_slack <= high + ALLOWED:
        differences.append(f"slack {proof.least_slack:.6f}, truth {low:.6f} to {high:.6f}")
    low, high = found.clearance
    said = proof.least_clearance
    if said and not low - FLAT - ALLOWED <= said <= high + ALLOWED:
        differences.append(f"clearance {said:.6f}, truth {low:.6f} to {high:.6f}")
    return Compared(name, proof.holds, proof.least_slack, found.separation, differences)


def _refused_in_vain(proof, found):
    """Return what the proof refuses although the second checker is certain that it is met."""
    doubts = " ".join([*found.broken, *found.open])
    said = " ".join(proof.failures)
    wrong = [
        f"{demand} refused: {said}"
        for demand, text in _SAYS.items()
        if text in said and demand not in doubts
    ]
    if "apart near" in said and found.separation[0] > ALLOWED - TOLERANCE:
        wrong.append(f"separation refused, truth above {found.separation[0]:.6f}")
    return wrong
