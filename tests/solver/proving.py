"""Proofs by z3: a claim holds if its negation has no solution under the premises."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import z3

TIMEOUT_MS = 60_000

Premises = Mapping[str, Any]


def is_proven(premises: Premises, claim: Any) -> bool:
    """Return whether a claim follows; False if there is a counterexample.

    Raises AssertionError if z3 does not know, or if the premises contradict each other: from those
    anything follows.
    """
    solver = z3.Solver()
    solver.set("timeout", TIMEOUT_MS)
    solver.add(*premises.values())
    assert solver.check() == z3.sat, "the premises contradict each other, or z3 does not know"
    solver.add(z3.Not(claim))
    answer = solver.check()
    assert answer != z3.unknown, solver.reason_unknown()
    return bool(answer == z3.unsat)


def without(premises: Premises, name: str) -> Premises:
    """Return premises without one of them."""
    return {key: premise for key, premise in premises.items() if key != name}
