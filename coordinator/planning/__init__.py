"""From a scenario to a proven plan: this room runs the stages of the rooms below.

The room decides the order of the stages, and that no plan is returned without its proof.  It must
not know files, clocks or links.  Other rooms import `planner` and `retiming.retime`; other programs
use the names in `library`.
"""
