"""The firmware core: the agent as a state machine, its ride, steering and clock.

Pure and small: no bytes, links, files or clocks; `tick` allocates nothing that stays.
"""
