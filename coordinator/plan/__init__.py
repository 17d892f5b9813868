"""The plan document and its bytes on the wire.

The room decides the fields of plan.json, how they become Plan messages and back, and which faults a
plan survives with a given tau.  It must not know how plans are found or proven.  Other rooms import
`document.PlanDocument`, `plan_file`, `wire` and `fault_budget`.
"""
