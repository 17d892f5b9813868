"""The commands that run, judge and test whole fleets, and replay logs."""
