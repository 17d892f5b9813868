"""Speed along one path under its robot's limits.

The room decides velocity profiles and how a robot takes corners.  It must not know other robots.
Others take `velocity_profile.Motion`.
"""
