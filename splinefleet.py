"""The command line: gathers the commands of the three packages, and nothing else."""
