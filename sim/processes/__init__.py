"""Whole fleets of processes on this machine: their start, faults, end and summary."""
