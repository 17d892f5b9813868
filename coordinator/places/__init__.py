"""Places where robots may rest, and the order of moves by which they change places.

Takes a floor and robots and finds moves from place to place, one after the other, and when they may
start so that robots arrive early.  Must not know: curves and speeds.  Other rooms take `Graph`,
`place_graph`, `find_moves` and `early_moves`.
"""
