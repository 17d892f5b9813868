"""Planar NURBS curves as arrays: evaluation, knots, bounds, chords, intersections.

The room decides the numerics of the paper's Eq. (5)-(14) and Algorithm 1.  It must not know robots,
floors or times.  Other rooms import `nurbs.Nurbs` and the modules `knots`, `bounds`, `chords`,
`splines` and `intersections`.
"""
