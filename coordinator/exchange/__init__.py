"""Converts plans and logs to formats of other tools: VDA 5050, Foxglove, points, CSV.

A new export is a module of this room and an option in `cli/log_commands.py`.
"""
