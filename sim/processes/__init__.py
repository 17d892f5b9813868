"""Whole fleets of processes on this machine: started, struck by faults, ended, summed up."""
