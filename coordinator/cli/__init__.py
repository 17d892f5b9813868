"""The commands: their options, their exit codes, and which part of the program each one runs.

A new command is a function in the module of its group.  Its decorator names the panel of the help
that lists it: Plan, Run, Operate, Inspect or Keys.
"""
