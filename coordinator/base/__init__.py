"""What every room may use: errors, the terminal, compiled kernels and the cache of their code.

Nothing here knows robots, plans or floors.
"""
