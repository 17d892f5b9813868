"""The fleet core: members, phases, epochs, authority and orders, from messages and `now_ns`.

The room decides what a fleet is told next.  It must not know how courses are found, nor links,
clocks, files or threads.  Other rooms import `core.Fleet` and the functions of `log_records`, which
make records for the log.
"""
