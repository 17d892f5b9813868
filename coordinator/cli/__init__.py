"""The commands: options, exit codes, which shell is started.

A new command is a function in the module of its group.  It names its panel of the help: Plan, Run,
Operate, Inspect or Keys.
"""
