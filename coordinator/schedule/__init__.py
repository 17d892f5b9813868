"""Who goes first, and when: conflict zones, one robot among others, the search over orders.

The room decides precedences, waits and other ways around.  It must not know messages or the proof.
Others take `priority_order.schedule` and `conflict_zones`.
"""
