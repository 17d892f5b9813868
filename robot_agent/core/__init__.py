"""The firmware core: the agent as a state machine, its ride, steering and clock.

Pure and small: it uses no bytes, links, files or clocks, and `tick` leaves no memory allocated.
"""
