"""The mission around the fleet core: plans, orders and what lost robots ask of the others.

The room decides what is searched for, when a course found is committed, and how a fleet begins, is
frozen and goes on.  It must not know links, clocks, files or threads.  Other rooms import
`mission.Mission`, `mission_driver.MissionDriver` and `fleet_from_plan`.
"""
