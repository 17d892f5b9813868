"""Who goes first, and when: conflict zones, waits of one robot, the search over orders.

The room decides precedences, waits and detours.  It must not know messages or the proof.  Other
rooms import `junctions.Junctions`, `priority_order.find_schedule` and `lateness.Lateness`.
"""
