"""Where the centre of a disc may be on a floor: configuration spaces and shortest ways.

The room decides what is free, which way is the shortest and how corners are rounded clear of
obstacles.  It must not know times or the other robots' motions.  Other rooms use
`grown_floor.GrownFloor` and `free_space`.
"""
