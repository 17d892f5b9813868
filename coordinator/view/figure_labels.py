"""Places labels so that they do not cover each other.

Decides: the place of a label, by comparing places around its anchor.  Places near the anchor are
preferred.  Must not know: what the labels say.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.text import Text

from coordinator.curves.nurbs import Array

_RINGS: Final = (3.0, 9.0, 17.0, 27.0, 40.0, 56.0, 75.0, 100.0)
_ANGLES: Final = 16
_HIDDEN: Final = 8.0
"""Greatest number of busy points that an optional label may cover."""
_FARTHEST: Final = 27.0
"""Greatest distance of an optional label from its anchor [pt]."""
_AIR: Final = 1.2
"""Room around a label's text [pt]."""
_STEPS: Final = np.linspace(0.0, 1.0, 16)
"""Positions along a line to a label at which it is tested against other labels."""
_LEADER: Final = 6.0
"""Labels farther than this from their anchor [pt] get a line to it."""


NO_POINTS: Final = np.empty((0, 2))


class Labels:
    """The labels of one pair of axes whose limits and size are final.

    `busy`, `marks`: points (n, 2) in data units.  Labels should not cover busy points and must not
    cover marks.
    """

    def __init__(self, axes: Axes, busy: Array, marks: Array = NO_POINTS) -> None:
        axes.apply_aspect()
        figure = axes.get_figure(root=True)
        assert figure is not None
        self._axes = axes
        self._renderer = FigureCanvasAgg(figure).get_renderer()  # type: ignore[no-untyped-call]
        self._pixel = figure.dpi / 72.0
        self._busy = axes.transData.transform(busy)
        self._marks = axes.transData.transform(marks)
        self._taken = np.empty((0, 4))
        box = axes.bbox
        self._frame = np.array([box.x0, box.y0, box.x1, box.y1])

    def place(
        self,
        text: str,
        anchor: tuple[float, float],
        *,
        size: float,
        colour: str,
        away: float = 0.0,
        heading: float = 0.5 * math.pi,
        optional: bool = False,
        weight: str = "normal",
    ) -> bool:
        """Put a label at least `away` [data units] from its anchor, towards `heading` if possible.

        An optional label is left out if it would cover another label, a mark or many busy points.
        Return whether the label was placed.
        """
        label = self._axes.text(
            *anchor,
            text,
            size=size,
            color=colour,
            weight=weight,
            ha="center",
            va="center",
            zorder=9,
            bbox={"boxstyle": "square,pad=0.08", "fc": "white", "ec": "none", "alpha": 0.75},
        )
        center = self._axes.transData.transform(anchor)
        boxes, gaps = self._candidates(label, center, away, heading)
        hidden, overlap = self._covered(boxes)
        overlap += self._run_over(center, boxes, away)
        spoilt = np.where(overlap > 0.0, 60.0 + 400.0 * overlap, 0.0)
        best = int(np.argmin(gaps + 6.0 * hidden + spoilt))
        crowded = overlap[best] > 0.0 or hidden[best] > _HIDDEN or gaps[best] > _FARTHEST
        if optional and crowded:
            label.remove()
            return False
        box = boxes[best]
        middle = np.array([0.5 * (box[0] + box[2]), 0.5 * (box[1] + box[3])])
        x, y = self._axes.transData.inverted().transform(middle).tolist()
        label.set_position((x, y))
        self._taken = np.vstack((self._taken, box))
        if gaps[best] > _LEADER:
            self._lead(center, box, away, colour)
        return True

    def keep_free(self, anchor: tuple[float, float], radius: float) -> None:
        """Reserve a disc that no label may cover; anchor and radius are in data units."""
        x, y = self._axes.transData.transform(anchor)
        half = 0.9 * self._pixels(radius)
        self._taken = np.vstack((self._taken, [x - half, y - half, x + half, y + half]))

    def _pixels(self, length: float) -> float:
        ends = self._axes.transData.transform([(0.0, 0.0), (length, 0.0)])
        return float(ends[1, 0] - ends[0, 0])

    def _candidates(
        self, label: Text, center: Array, away: float, heading: float
    ) -> tuple[Array, Array]:
        """Return candidate boxes (n, 4) [px] around a center, and how far each is from it [pt]."""
        extent = label.get_window_extent(self._renderer)
        half = np.array([0.5 * extent.width, 0.5 * extent.height]) + _AIR * self._pixel
        start = self._pixels(away)
        boxes, gaps = [], []
        for gap in _RINGS:
            for turn in range(_ANGLES):
                angle = heading + (turn + 1) // 2 * (-1) ** turn * 2.0 * math.pi / _ANGLES
                way = np.array([math.cos(angle), math.sin(angle)])
                # A box touches a circle around the center when pushed out by its own reach.
                reach = start + gap * self._pixel + float(np.min(half / np.maximum(abs(way), 1e-9)))
                middle = center + reach * way
                boxes.append(np.concatenate((middle - half, middle + half)))
                gaps.append(gap + 0.6 * ((turn + 1) // 2))
        return np.array(boxes), np.array(gaps)

    def _covered(self, boxes: Array) -> tuple[Array, Array]:
        """Return how many busy points each box covers, and how much of it is badly placed.

        That is the share of the box on other labels, on marks or outside the axes.
        """
        area = (boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1])
        covered = _overlaps(boxes, self._taken).sum(axis=1) / area
        outside = 1.0 - _overlaps(boxes, self._frame[None])[:, 0] / area
        overlap = covered + np.where(outside > 1e-6, outside, 0.0)
        return _inside(self._busy, boxes), overlap + _inside(self._marks, boxes)

    def _leaders(self, center: Array, boxes: Array, away: float) -> Array:
        """Return points (n, k, 2) [px] from the anchor's edge to the nearest place of each box."""
        way = np.clip(center, boxes[:, :2], boxes[:, 2:]) - center
        length = np.maximum(np.hypot(*way.T), 1e-9)
        since = np.minimum(self._pixels(away) / length, 1.0)[:, None]
        return np.asarray(
            center + (since + (1.0 - since) * _STEPS)[..., None] * way[:, None, :], dtype=np.float64
        )

    def _run_over(self, center: Array, boxes: Array, away: float) -> Array:
        """Return the share of each box's leader (n,) that runs over other labels."""
        x, y = np.moveaxis(self._leaders(center, boxes, away), 2, 0)[..., None]
        x0, y0, x1, y1 = self._taken.T
        over = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        return np.asarray(over.any(axis=2).mean(axis=1), dtype=np.float64)

    def _lead(self, center: Array, box: Array, away: float, colour: str) -> None:
        """Draw a thin line from the anchor's edge to the nearest place of a box [px]."""
        points = self._leaders(center, box[None], away)[0]
        line = self._axes.transData.inverted().transform(points[[0, -1]])
        self._axes.plot(*line.T, color=colour, lw=0.7, alpha=0.9, zorder=8)
        self._marks = np.vstack((self._marks, points))


def _overlaps(boxes: Array, others: Array) -> Array:
    """Return the areas (n, m) that boxes (n, 4) share with others (m, 4)."""
    low = np.maximum(boxes[:, None, :2], others[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], others[None, :, 2:])
    sides = np.maximum(high - low, 0.0)
    return np.asarray(sides[..., 0] * sides[..., 1])


def _inside(points: Array, boxes: Array) -> Array:
    """Return how many of points (m, 2) each of boxes (n, 4) holds."""
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    x, y = points[np.all((points > low) & (points < high), axis=1)].T
    held = (x > boxes[:, 0:1]) & (x < boxes[:, 2:3])
    held &= (y > boxes[:, 1:2]) & (y < boxes[:, 3:4])
    return np.asarray(held.sum(axis=1), dtype=np.float64)
