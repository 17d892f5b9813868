"""From a scenario to a proven plan: the rooms below put together.

The room decides the order of the stages and that nothing leaves without its proof.  It must not
know files, clocks or links.  Others take `planner.plan_scenario`; programs take `library`.
"""
