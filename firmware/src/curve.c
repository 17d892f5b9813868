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
static void expand(const sf_course *course, int axis, const sf_real *knot, sf_real *powers) {
    enum { ROW = SF_DEGREE + 1 };
    int degree = course->degree, level = 1;
    sf_real rows[ROW * ROW];
    const sf_real *point = course->points[axis] + (knot - course->knots) - degree;
    for (int i = 0; i <= degree; i++) rows[ROW * i] = *point++;
    do {
        int i = degree;
        do {
            sf_real low = knot[i - degree], width = knot[1 + i - level] - low;
            sf_real part = (*knot - low) / width, above = R(0);
            sf_real *first = rows + ROW * i, *at = first + level;
            do {
                at--;
                sf_real apart = at[0] - at[-ROW];
                at[1] = above + apart / width;
                above = at[-ROW] + part * apart;
            } while (at > first);
            *at = above;
        } while (--i >= level);
    } while (++level <= degree);
    for (int power = 0; power <= degree; power++) powers[power] = rows[ROW * degree + power];
}

/* The polynomials at u, from the two that are kept or newly expanded into the older one. */
static sf_piece *piece_at(sf_course *course, sf_real u) {
    sf_curve *curve = &course->curve;
    sf_piece *piece = curve->piece;
    const sf_real *knot = curve->knot;
    while (knot + 1 < curve->end && u >= knot[1]) knot++;
    while (u < *knot) knot--;
    curve->knot = knot;
    if (piece->knot == knot) return piece;
    curve->piece = curve->spare;
    curve->spare = piece;
    piece = curve->piece;
    if (piece->knot == knot) return piece;
    piece->knot = knot;
    for (int axis = 0; axis < course->axes; axis++)
        expand(course, axis, knot, piece->powers[axis]);
    return piece;
}

/* Each axis's polynomial and its derivative, by Horner's rule; the weight's first, by which the
   others are divided. */
SHARED static void evaluate(sf_course *course, sf_real u) {
    const sf_piece *piece = piece_at(course, u);
    sf_real t = u - *course->curve.knot, *at = course->curve.at, *slope = course->curve.slope;
    int axes = course->axes, axis = axes;
    do {
        const sf_real *first = piece->powers[--axis], *power = first + course->degree;
        sf_real value = *power, rate = R(0);
        do {
            rate = rate * t + value;
            value = value * t + *--power;
        } while (power > first);
        if (axes == SF_AXES && axis < SF_WEIGHT) {
            value /= at[SF_WEIGHT];
            rate = (rate - slope[SF_WEIGHT] * value) / at[SF_WEIGHT];
        }
        at[axis] = value;
        slope[axis] = rate;
    } while (axis > 0);
}

SHARED sf_real sf_on_curve(const sf_course *course, sf_real s) {
    return sf_clamp(s, R(0), course->curve.length);
}

void sf_curve_place(sf_course *course, sf_real s) {
    sf_curve *curve = &course->curve;
    s = sf_on_curve(course, s);
    const sf_cell *cell = curve->cell; /* The search starts at the one found last. */
    while (cell + 1 < curve->last && s >= cell[1].s) cell++;
    while (cell > course->table && s < cell->s) cell--;
    curve->cell = cell;
    sf_real size = cell[1].s - cell->s, part = (s - cell->s) / size, rest = R(1) - part;
    sf_real m0 = (sf_real)cell->slope * size, m1 = (sf_real)cell[1].slope * size;
    sf_real value = rest * rest * ((R(1) + R(2) * part) * cell->u + part * m0);
    sf_real more = (R(3) - R(2) * part) * cell[1].u - rest * m1;
    value += part * part * more;
    evaluate(course, sf_least(sf_positive(value), *curve->end));
}

SHARED static sf_real speed(sf_course *course, sf_real u) {
    const sf_real *slope = course->curve.slope;
    evaluate(course, u);
    return sf_length(slope[SF_X], slope[SF_Y]);
}

/* The cell that ends the table: its parameter, arc length, and slope. */
SHARED static void end_table(sf_course *course, sf_real u, sf_real s) {
    sf_cell *cell = course->curve.last;
    cell->u = u;
    cell->s = s;
    cell->slope = (float)(R(1) / sf_most(speed(course, u), R(1e-9)));
}

int sf_curve_begin(sf_plan *plan, sf_course *course) {
    sf_curve *curve = &course->curve;
    const sf_real *knot = course->knots + course->degree;
    unsigned spans = plan->parts, parts = SF_CELLS / spans, enough = MOST_CELLS / spans;
    if (enough < LEAST_CELLS_PER_SPAN) enough = LEAST_CELLS_PER_SPAN;
    if (SF_CELLS > MOST_CELLS && parts > enough) parts = enough;
    plan->parts = parts < CELLS_PER_SPAN ? parts : CELLS_PER_SPAN;
    plan->knot = knot + 1;
    curve->cell = curve->last = course->table;
    curve->piece = &course->pieces[0];
    curve->spare = &course->pieces[1];
    curve->piece->knot = curve->spare->knot = NULL;
    curve->knot = knot;
    curve->end = course->knots + course->count;
    end_table(course, R(0), R(0));
    return NEXT;
}

int sf_measure_cell(sf_plan *plan, sf_course *course) {
    sf_curve *curve = &course->curve;
    const sf_real *knot = plan->knot;
    curve->length = curve->last->s;
    if (knot > curve->end) return NEXT;
    sf_real step = (*knot - knot[-1]) / (sf_real)plan->parts, u0 = knot[-1] + (sf_real)plan->at * step;
    sf_real u1 = u0 + step, size = R(0);
    if (++plan->at == plan->parts || step == R(0)) { /* Go on with the next span; this may be empty. */
        u1 = *knot;
        plan->at = 0;
        plan->knot++;
    }
    sf_real middle = R(0.5) * (u0 + u1), half = R(0.5) * (u1 - u0);
    for (int i = 0; i < 5; i++) size += GAUSS[i][1] * speed(course, middle + half * GAUSS[i][0]);
    sf_real end = curve->length + half * size;
    if (end > curve->length) { /* A cell so short that its length is lost is none. */
        curve->last++;
        end_table(course, u1, end);
    }
    return AGAIN;
}

#include "core_end.h"
