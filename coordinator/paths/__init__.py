"""The path of one robot, alone: around obstacles, smooth, honouring headings and via points.

The room decides the curve that a robot drives.  It must not know times or who goes first.  Other
rooms use `path_planner` and `given_path`.
"""
