"""A fleet in virtual time: bodies, robots, the in-memory link, faults, the coordinator's shell.

This package decides the order of events.  A new fault is a kind in `fault_text.py`, its odds in
`fault_script.py` and its effect in `strikes.py`.
"""
