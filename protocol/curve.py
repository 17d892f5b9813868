"""The curve as a robot evaluates it: a rational B-spline by arc length, in plain Python.

Decides: how the numbers on the wire become points on the floor.  Firmware: it imports only `array`
and `math`; `evaluate` and `place` allocate nothing and leave their results in attributes.  The
coordinator has a vectorised version of it in coordinator/curves/nurbs.py.
"""

from array import array
from math import inf, sqrt

_GAUSS = (
    (-0.9061798459386640, 0.2369268850561891),
    (-0.5384693101056831, 0.4786286704993665),
    (0.0, 0.5688888888888889),
    (0.5384693101056831, 0.4786286704993665),
    (0.9061798459386640, 0.2369268850561891),
)
_MOST_CELLS = 2048
_CELLS_PER_SPAN = 16
_LEAST_CELLS_PER_SPAN = 5


def clamped_knots(degree: int, wire_knots: list[float]) -> list[float]:
    """Return the full clamped knot vector from the wire's inner knots and last knot."""
    return [0.0] * (degree + 1) + wire_knots[:-1] + [wire_knots[-1]] * (degree + 1)


def cells_per_span(spans: int) -> int:
    """Return how many cells each span has in the table of arc lengths; with many spans, fewer."""
    return min(max(_MOST_CELLS // spans, _LEAST_CELLS_PER_SPAN), _CELLS_PER_SPAN)


class _Piece:
    """One span's polynomials, homogeneous, in powers of u - begin; for begin <= u < end."""

    def __init__(self, degree: int) -> None:
        self.begin = self.end = inf
        self.xs = [0.0] * (degree + 1)
        self.ys = [0.0] * (degree + 1)
        self.ws = [0.0] * (degree + 1)


class Curve:
    """A planar NURBS curve C(u), Eq. (5) with the rational basis of Eq. (7).

    degree k, `knots` of length n + k + 1 (clamped, not decreasing, first 0), control points
    (xs[i], ys[i]) [m] and positive weights, n of each.  Raises ValueError when these do not fit.
    After `evaluate(u)` or `place(s)` the attributes x, y [m] and dx, dy (derivative by u) hold
    the result.
    """

    def __init__(
        self,
        degree: int,
        knots: list[float],
        xs: list[float],
        ys: list[float],
        weights: list[float],
    ) -> None:
        count = len(xs)
        if count <= degree:
            raise ValueError(f"{count} control points are too few for degree {degree}")
        if len(ys) != count or len(weights) != count or len(knots) != count + degree + 1:
            raise ValueError(
                f"{count} control points need {count} weights and {count + degree + 1} knots, "
                f"not {len(weights)} and {len(knots)}"
            )
        if knots[0] != 0.0 or not knots[-1] > 0.0:
            raise ValueError(f"knots run from {knots[0]} to {knots[-1]}, not from 0 upwards")
        if any(not a <= b for a, b in zip(knots, knots[1:])):  # noqa: B905, RUF007
            raise ValueError("knots decrease")
        if any(not knots[i] < knots[i + degree] for i in range(1, count)):
            raise ValueError("an inner knot occurs more often than the degree, so the curve jumps")
        if not min(weights) > 0.0:
            raise ValueError(f"weight {min(weights)} is not positive")
        self.degree = degree
        self.knots = array("d", knots)
        self._last = knots[-1]
        self.x = self.y = self.dx = self.dy = 0.0
        self._hx = array("d", [x * w for x, w in zip(xs, weights)])  # noqa: B905
        self._hy = array("d", [y * w for y, w in zip(ys, weights)])  # noqa: B905
        self._hw = array("d", weights)
        self._is_plain = degree == 3 and min(weights) == max(weights) == 1.0
        self._span = degree
        self._powers = tuple(range(degree, -1, -1))
        self._piece, self._spare = _Piece(degree), _Piece(degree)
        self._rows = [[0.0] * (degree + 1) for _ in self._powers]
        self._cell = 0
        self._cell_begin = self._cell_end = inf
        self._hermite = [0.0] * 5
        self._cell_u = array("d", [0.0])
        self._cell_s = array("d", [0.0])
        self._cell_slope = array("f", [])
        self._measure()
        self.length = self._cell_s[-1]
        if not 0.0 < self.length < 1e6:
            raise ValueError(f"a curve of length {self.length} m is not a path")

    def evaluate(self, u: float) -> None:
        """Evaluate C(u) and C'(u) by Horner's rule; u is clamped into the domain."""
        u = min(max(u, 0.0), self.knots[-1])
        piece = self._piece
        if not piece.begin <= u < piece.end:
            piece = self._piece_at(u)
        self._evaluate(piece, u - piece.begin)

    def place(self, s: float) -> None:
        """Evaluate the curve at arc length s [m], clamped to [0, length].

        A robot does so several times a tick, nearly always on a cubic whose weights are all 1:
        that case is spelled out.  The result is that of `evaluate` to the last bit.
        """
        u = self.parameter_at(s)
        piece = self._piece
        if not (self._is_plain and piece.begin <= u < piece.end and u <= self._last):
            self.evaluate(u)
            return
        t = u - piece.begin
        x0, x1, x2, x3 = piece.xs
        cubic = x3 * t
        square = cubic + x2
        slope = square * t + x1
        self.x = slope * t + x0
        self.dx = (cubic + square) * t + slope
        y0, y1, y2, y3 = piece.ys
        cubic = y3 * t
        square = cubic + y2
        slope = square * t + y1
        self.y = slope * t + y0
        self.dy = (cubic + square) * t + slope

    def parameter_at(self, s: float) -> float:
        """Return the parameter u at arc length s: a cubic Hermite piece per cell of the table."""
        if s < 0.0:
            s = 0.0
        elif s > self.length:
            s = self.length
        if not self._cell_begin <= s < self._cell_end:
            self._find_cell(s)
        size, u0, u1, m0, m1 = self._hermite
        part = (s - self._cell_begin) / size
        rest = 1.0 - part
        value = rest * rest * ((1.0 + 2.0 * part) * u0 + part * m0)
        return value + part * part * ((3.0 - 2.0 * part) * u1 - rest * m1)

    def _evaluate(self, piece: _Piece, t: float) -> None:
        xs, ys, ws = piece.xs, piece.ys, piece.ws
        x = y = w = dx = dy = dw = 0.0
        for i in self._powers:
            dx = dx * t + x
            dy = dy * t + y
            dw = dw * t + w
            x = x * t + xs[i]
            y = y * t + ys[i]
            w = w * t + ws[i]
        self.x = x = x / w
        self.y = y = y / w
        self.dx = (dx - dw * x) / w
        self.dy = (dy - dw * y) / w

    def _find_cell(self, s: float) -> None:
        """Go to the cell of an arc length in the table, and keep its numbers."""
        table_s, table_u, slopes, cell = self._cell_s, self._cell_u, self._cell_slope, self._cell
        last = len(table_s) - 2
        while cell < last and s >= table_s[cell + 1]:
            cell += 1
        while cell > 0 and s < table_s[cell]:
            cell -= 1
        self._cell = cell
        size, hermite = table_s[cell + 1] - table_s[cell], self._hermite
        hermite[0], hermite[1], hermite[2] = size, table_u[cell], table_u[cell + 1]
        hermite[3], hermite[4] = slopes[cell] * size, slopes[cell + 1] * size
        self._cell_begin = table_s[cell]
        self._cell_end = table_s[cell + 1] if cell < last else inf

    def _piece_at(self, u: float) -> _Piece:
        """Return the polynomials at u, from the cache or newly expanded into the older piece.

        Two pieces are cached, because a robot near a knot evaluates both sides of it in every tick.
        """
        piece, self._spare = self._spare, self._piece
        self._piece = piece
        if piece.begin <= u < piece.end:
            return piece
        knots, span, last = self.knots, self._span, len(self._hw) - 1
        while span < last and u >= knots[span + 1]:
            span += 1
        while span > self.degree and u < knots[span]:
            span -= 1
        self._span = span
        self._expand(self._hx, piece.xs)
        self._expand(self._hy, piece.ys)
        self._expand(self._hw, piece.ws)
        piece.begin, piece.end = knots[span], knots[span + 1] if span < last else inf
        return piece

    def _expand(self, points: array, powers: list[float]) -> None:  # type: ignore[type-arg]
        """Expand one coordinate of the span in powers of u minus the span's first knot.

        This is De Boor's algorithm on polynomials instead of numbers: row i holds the polynomial
        of point i.
        """
        degree, knots, span, rows = self.degree, self.knots, self._span, self._rows
        first = span - degree
        for i in range(degree + 1):
            rows[i][0] = points[first + i]
        for level in range(1, degree + 1):
            for i in range(degree, level - 1, -1):
                low = knots[first + i]
                width = knots[span + 1 + i - level] - low
                part, row, before = (knots[span] - low) / width, rows[i], rows[i - 1]
                above = 0.0
                for power in range(level - 1, -1, -1):
                    apart = row[power] - before[power]
                    row[power + 1] = above + apart / width
                    above = before[power] + part * apart
                row[0] = above
        for power in range(degree + 1):
            powers[power] = rows[degree][power]

    def _speed(self, u: float) -> float:
        self.evaluate(u)
        return sqrt(self.dx * self.dx + self.dy * self.dy)

    def _measure(self) -> None:
        """Fill the table of arc lengths: Gauss quadrature with 5 nodes over the cells of a span."""
        cells = cells_per_span(sum(a < b for a, b in zip(self.knots, self.knots[1:])))  # noqa: B905
        self._cell_slope.append(1.0 / max(self._speed(0.0), 1e-9))
        previous = 0.0
        for knot in self.knots:
            step = (knot - previous) / cells
            if step <= 0.0:
                continue
            for cell in range(cells):
                u0 = previous + cell * step
                u1 = knot if cell == cells - 1 else u0 + step
                size = 0.0
                for node, weight in _GAUSS:
                    size += weight * self._speed(0.5 * (u0 + u1) + 0.5 * (u1 - u0) * node)
                size *= 0.5 * (u1 - u0)
                end = self._cell_s[-1] + size
                if end > self._cell_s[-1]:  # A cell so short that its length is lost is none.
                    self._cell_u.append(u1)
                    self._cell_s.append(end)
                    self._cell_slope.append(1.0 / max(self._speed(u1), 1e-9))
            previous = knot
