/* The curve by arc length, a rational B-spline: protocol/curve.py.

   Nothing is allocated; a curve is measured cell by cell, so that a tick can do a part of it. */

#include "core.h"

#define MOST_CELLS 2048
#define CELLS_PER_SPAN 16
#define LEAST_CELLS_PER_SPAN 5

static const sf_real GAUSS[5][2] = {
    {R(-0.9061798459386640), R(0.2369268850561891)},
    {R(-0.5384693101056831), R(0.4786286704993665)},
    {R(0.0), R(0.5688888888888889)},
    {R(0.5384693101056831), R(0.4786286704993665)},
    {R(0.9061798459386640), R(0.2369268850561891)},
};

/* Expand one axis of the span that begins at a knot in powers of u minus that: De Boor's algorithm on
   polynomials instead of numbers. */
static void expand(const sf_curve *curve, int axis, const sf_real *knot, sf_real *powers) {
    int degree = curve->degree, first = (int)(knot - curve->knots) - degree;
    sf_real rows[SF_DEGREE + 1][SF_DEGREE + 1];
    for (int i = 0; i <= degree; i++) rows[i][0] = curve->points[axis][first + i];
    int level = 1;
    do {
        for (int i = degree; i >= level; i--) {
            sf_real low = knot[i - degree], width = knot[1 + i - level] - low;
            sf_real part = (*knot - low) / width, above = R(0);
            sf_real *row = rows[i];
            const sf_real *before = rows[i - 1];
            for (int power = level - 1; power >= 0; power--) {
                sf_real apart = row[power] - before[power];
                row[power + 1] = above + apart / width;
                above = before[power] + part * apart;
            }
            row[0] = above;
        }
    } while (++level <= degree);
    for (int power = 0; power <= degree; power++) powers[power] = rows[degree][power];
}

/* The polynomials at u, from the two that are kept or newly expanded into the older one. */
static sf_piece *piece_at(sf_curve *curve, sf_real u) {
    sf_piece *piece = curve->piece;
    if (piece->begin <= u && u < piece->end) return piece;
    curve->piece = curve->spare;
    curve->spare = piece;
    piece = curve->piece;
    if (piece->begin <= u && u < piece->end) return piece;
    const sf_real *knot = curve->knots + curve->degree, *last = curve->knots + curve->count - 1;
    while (knot < last && u >= knot[1]) knot++;
    for (int axis = 0; axis < curve->axes; axis++)
        expand(curve, axis, knot, piece->powers[axis]);
    piece->begin = *knot;
    piece->end = knot < last ? knot[1] : SF_INF;
    return piece;
}

/* The value of a polynomial at t, and its derivative, by Horner's rule. */
static sf_real value_at(const sf_real *power, sf_real t, const sf_real *first, sf_real *slope) {
    sf_real value = *power, rate = value;
    if (power == first + 3) { /* As nearly always: the same, without a loop. */
        sf_real cubic = value * t, square = cubic + power[-1];
        value = square * t + power[-2];
        *slope = (cubic + square) * t + value;
        return value * t + *first;
    }
    while (--power > first) {
        value = value * t + *power;
        rate = rate * t + value;
    }
    *slope = rate;
    return value * t + *first;
}

SHARED static void evaluate(sf_curve *curve, sf_real u) {
    unsigned degree = curve->degree;
    const sf_piece *piece = piece_at(curve, u);
    sf_real t = u - piece->begin, *at = curve->at, *slope = curve->slope;
    for (int axis = 0; axis < curve->axes; axis++) {
        const sf_real *powers = piece->powers[axis];
        at[axis] = value_at(powers + degree, t, powers, &slope[axis]);
    }
    if (curve->axes < SF_AXES) return;
    for (int axis = 0; axis < SF_WEIGHT; axis++) {
        at[axis] /= at[SF_WEIGHT];
        slope[axis] = (slope[axis] - slope[SF_WEIGHT] * at[axis]) / at[SF_WEIGHT];
    }
}

SHARED sf_real sf_on_curve(const sf_curve *curve, sf_real s) {
    return sf_clamp(s, R(0), curve->length);
}

static const sf_cell *find_cell(const sf_curve *curve, sf_real s) {
    unsigned cell = 0, end = (unsigned)(curve->last - curve->table);
    while (end - cell > 1) {
        unsigned middle = (cell + end) / 2;
        if (s >= curve->table[middle].s) cell = middle;
        else end = middle;
    }
    return &curve->table[cell];
}

void sf_curve_place(sf_curve *curve, sf_real s) {
    s = sf_on_curve(curve, s);
    const sf_cell *cell = curve->cell;
    if (!(cell->s <= s && s < cell[1].s)) cell = curve->cell = find_cell(curve, s);
    sf_real size = cell[1].s - cell->s, part = (s - cell->s) / size, rest = R(1) - part;
    sf_real m0 = (sf_real)cell->slope * size, m1 = (sf_real)cell[1].slope * size;
    sf_real value = rest * rest * ((R(1) + R(2) * part) * cell->u + part * m0);
    sf_real more = (R(3) - R(2) * part) * cell[1].u - rest * m1;
    value += part * part * more;
    evaluate(curve, sf_least(sf_positive(value), curve->knots[curve->count + curve->degree]));
}

SHARED static sf_real speed(sf_curve *curve, sf_real u) {
    evaluate(curve, u);
    return sf_length(curve->slope[SF_X], curve->slope[SF_Y]);
}

/* The cell that ends the table: its parameter, arc length, and slope. */
SHARED static void end_table(sf_curve *curve, sf_real u, sf_real s) {
    sf_cell *cell = curve->last;
    cell->u = u;
    cell->s = s;
    cell->slope = (float)(R(1) / sf_most(speed(curve, u), R(1e-9)));
}

bool sf_curve_begin(sf_plan *plan, sf_curve *curve) {
    const sf_real *knots = curve->knots, *weights = curve->points[SF_WEIGHT];
    unsigned degree = curve->degree, count = curve->count, spans = 0;
    curve->axes = degree == 3 ? SF_WEIGHT : SF_AXES;
    for (unsigned i = 0; i < count + degree; i++) {
        sf_real size = knots[i + 1] - knots[i];
        if (!(size >= R(0))) return false;
        if (size > R(0)) spans++;
        if (i >= count) continue;
        if (i > 0 && !(knots[i] < knots[i + degree])) return false;
        if (!(weights[i] > R(0))) return false;
        if (weights[i] != R(1)) curve->axes = SF_AXES;
    }
    unsigned parts = SF_CELLS / spans, enough = MOST_CELLS / spans;
    if (enough < LEAST_CELLS_PER_SPAN) enough = LEAST_CELLS_PER_SPAN;
    if (SF_CELLS > MOST_CELLS && parts > enough) parts = enough;
    plan->parts = (uint16_t)(parts < CELLS_PER_SPAN ? parts : CELLS_PER_SPAN);
    plan->knot = &knots[degree + 1];
    curve->cell = curve->last = curve->table;
    curve->piece = &curve->pieces[0];
    curve->spare = &curve->pieces[1];
    curve->piece->begin = curve->spare->begin = SF_INF;
    end_table(curve, R(0), R(0));
    return true;
}

bool sf_measure_cell(sf_plan *plan, sf_curve *curve) {
    const sf_real *knot = plan->knot, *last = curve->knots + curve->count;
    curve->length = curve->last->s;
    if (knot > last) return false;
    unsigned part = plan->at++;
    sf_real step = (*knot - knot[-1]) / (sf_real)plan->parts, u0 = knot[-1] + (sf_real)part * step;
    sf_real u1 = u0 + step, size = R(0);
    if (plan->at >= plan->parts) { /* Go on with the next span, which ends at a greater knot. */
        u1 = *knot;
        plan->at = 0;
        do knot++;
        while (knot <= last && !(*knot > u1));
        plan->knot = knot;
    }
    sf_real middle = R(0.5) * (u0 + u1), half = R(0.5) * (u1 - u0);
    for (int i = 0; i < 5; i++) size += GAUSS[i][1] * speed(curve, middle + half * GAUSS[i][0]);
    size *= half;
    if (size > R(0)) {
        curve->last++;
        end_table(curve, u1, curve->length + size);
    }
    return true;
}
