"""Bounds on rounding: what an operation on floating-point numbers may add to the error.

Each number is known by a bound on its magnitude and a bound on its error.  One operation multiplies
its exact result by 1 + d with |d| <= U (IEEE 754, round to nearest; no underflow matters here).
The bounds themselves are rational, so nothing is rounded on the way to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

U = Fraction(1, 2**53)
"""The unit roundoff of double precision."""


@dataclass(frozen=True)
class Number:
    """A computed number: its exact value is at most `most` in magnitude, its error `error`."""

    most: Fraction
    error: Fraction = Fraction(0)

    @property
    def reach(self) -> Fraction:
        """The greatest magnitude that the computed number may have."""
        return self.most + self.error

    def __add__(self, other: Number) -> Number:
        carried = self.error + other.error
        return Number(self.most + other.most, carried + U * (self.reach + other.reach))

    __sub__ = __add__

    def __mul__(self, other: Number) -> Number:
        carried = self.most * other.error + other.most * self.error + self.error * other.error
        return Number(self.most * other.most, carried + U * self.reach * other.reach)

    def within(self, most: Fraction) -> Number:
        """Return the number where its exact value is known to be at most `most`."""
        return Number(min(self.most, most), self.error)


def share(relative: int = 2) -> Number:
    """Return a quotient in [0, 1] of two differences of given numbers.

    Each of `relative` operations before the division is off by a factor 1 + d.
    """
    return Number(Fraction(1), (1 + U) ** (relative + 1) / (1 - U) - 1)


def length(x: Number, y: Number) -> Number:
    """Return the root of x^2 + y^2.

    Lengths differ by no more than their components do together.  Two squares, their sum and the
    root each multiply by 1 + d; under the root this counts half.
    """
    most = x.most + y.most
    carried = x.error + y.error
    return Number(most, carried + 3 * U * (most + carried))
