"""The shells around the pure rooms: link, clock, log and threads; and the replay of a log.

The room decides when the fleet core is called.  It must not decide what a fleet does.
"""
