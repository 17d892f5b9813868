"""Places where robots may rest, and the order of moves by which they change places.

Takes a floor and robots and finds moves from place to place, one after the other.  Must not know:
curves, speeds and times.  Other rooms take `Graph`, `place_graph` and `find_moves`.
"""
