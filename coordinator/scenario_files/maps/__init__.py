"""Map files as polygons: ROS map_server, MovingAI grids, DXF drawings.

A new format needs a module here and a line in `map_reader.py`.  Every reader returns a
`floor_map.FloorMap`: a boundary and obstacles in metres.
"""
