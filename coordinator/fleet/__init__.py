"""The fleet core: members, phases, epochs, recovery, and the mission around it.

The room decides what a fleet does next, from messages and `now_ns`.  It must not know links,
clocks, files or threads.  Other rooms import `core.Fleet`, `mission.Mission`,
`mission_driver.MissionDriver` and the functions of `log_records`, which make records for the log.
"""
