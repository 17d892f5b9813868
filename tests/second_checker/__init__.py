"""A second checker of plans, slow and plain, that shares no code with the product.

It reads the bytes of Plan messages itself and imports nothing of `protocol`, `coordinator` or
`robot_agent`.  Curves become Bezier pieces in exact rational arithmetic.  Everything after that is
bounds from below and above in floating point, widened by `path.ROUNDING`, far more than rounding
can add up to.  So each answer is a bracket (low, high) that contains the truth.

`python -m tests.second_checker` compares it with the product's proof on many plans.
"""
