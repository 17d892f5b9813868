"""Speed along one path under its robot's limits.

The room decides velocity profiles and how a robot takes corners.  It must not know other robots.
Other rooms import `velocity_profile.Motion` and `cornering.Handling`.
"""
