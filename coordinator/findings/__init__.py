"""What happened in a run, as data and tables.

The room decides how a log or plan is summed up: epochs, waits, faults, distances, traffic.  It
takes records of a log as data; what opens files is `log`.
"""
