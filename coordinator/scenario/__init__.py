"""What a user asks for: floor, robots, limits, tau and margin, as checked data.

The room decides which values a scenario may have and how the margin is shared.  It must not know
files (scenario_files) or how anything is planned.  Other rooms use `model.Scenario` and
`floor.Floor`.
"""
