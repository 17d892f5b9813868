"""The commands that run, judge and try whole fleets, and replay logs."""
