"""What every room may use: errors, the terminal, compiled kernels and where their code is kept.

Nothing here knows robots, plans or floors.
"""
