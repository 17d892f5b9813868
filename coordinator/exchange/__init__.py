"""Plans and logs for other tools: VDA 5050, Foxglove, points, CSV.

A new export is a module here and an option of `cli/log_commands.py`.
"""
