"""Sums up what happened in a run, as data and as tables.

The room decides how a log or plan is summed up: epochs, waits, faults, distances, traffic.  It gets
the records of a log as data; the room `log` opens the files.
"""
