"""Distances of many places from the first part of a polyline, exact and without trying every leg.

Decides: which legs are looked at.  Must not know: robots, plans, times.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from coordinator.curves.nurbs import Array

_BLOCK: Final = 64
"""So many legs share a circle; where the circle is too far away, none of them is looked at."""

_PLACES: Final = 512
"""So many places are looked at together, which limits the memory that this needs."""


class Polyline:
    """A polyline (m, 2) of at least one leg."""

    def __init__(self, line: Array) -> None:
        self._line = line
        self._legs = np.diff(line, axis=0)
        count = len(self._legs)
        self._first = np.arange(0, count, _BLOCK)
        ends = np.minimum(self._first + _BLOCK, count)
        points = np.minimum(self._first[:, None] + np.arange(_BLOCK + 1), count)
        self._centres = 0.5 * (line[self._first] + line[ends])
        self._radii = _lengths(line[points] - self._centres[:, None]).max(axis=1)

    def distances(self, places: Array, until: NDArray[np.intp]) -> Array:
        """Return the distance (n,) [m] of each place (n, 2) from the first `until` (n,) legs.

        `until` is at least 1.
        """
        parts = range(0, len(places), _PLACES)
        found = [self._some(places[i : i + _PLACES], until[i : i + _PLACES]) for i in parts]
        return np.concatenate(found) if found else np.empty(0)

    def _some(self, places: Array, until: NDArray[np.intp]) -> Array:
        begun = self._first < until[:, None]
        points = _lengths(places[:, None] - self._line[self._first])
        known: Array = np.where(begun, points, np.inf).min(axis=1)
        circles = _lengths(places[:, None] - self._centres) - self._radii
        place, block = np.nonzero(begun & (circles <= known[:, None]))
        leg = self._first[block, None] + np.arange(_BLOCK)
        is_counted = leg < until[place, None]
        leg = np.where(is_counted, leg, 0)
        apart = np.where(is_counted, self._apart(places[place, None], leg), np.inf)
        np.minimum.at(known, place, apart.min(axis=1))
        return known

    def _apart(self, places: Array, leg: NDArray[np.intp]) -> Array:
        """Return the distances of places from legs by their numbers."""
        legs, to_place = self._legs[leg], places - self._line[leg]
        square = np.maximum(np.einsum("...i,...i", legs, legs), 1e-18)
        part = np.clip(np.einsum("...i,...i", legs, to_place) / square, 0.0, 1.0)
        return _lengths(to_place - part[..., None] * legs)


def _lengths(vectors: Array) -> Array:
    lengths: Array = np.hypot(vectors[..., 0], vectors[..., 1])
    return lengths
