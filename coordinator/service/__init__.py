"""The shells around the pure rooms: link, clock, log, threads, and a log run again.

The room decides when the fleet core is called.  It must not decide what a fleet does.
"""
