"""The fleet core: members, phases, epochs, recovery, and the mission around it.

The room decides what a fleet does next, from messages and `now_ns`.  It must not know links,
clocks, files or threads.  Others take `core.Fleet`, `mission.Mission` and the records that go to
the log.
"""
