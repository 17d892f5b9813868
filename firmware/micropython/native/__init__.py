"""Native code for MicroPython: the agent core in C as splinefleet_core.mpy."""
