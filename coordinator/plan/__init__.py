"""The plan document and its bytes on the wire.

The room decides the fields of plan.json, how they become Plan messages and back, and which faults a
tau survives.  It must not know how plans are found or proven.  Others take `document.PlanDocument`,
`plan_file` and `wire`.
"""
