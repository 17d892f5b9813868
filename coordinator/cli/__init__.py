"""The commands: their options and exit codes, and which shell each starts.

A new command is a function in the module of its group.  It names the panel of the help that lists
it: Plan, Run, Operate, Inspect or Keys.
"""
