"""The robot's firmware: a pure core, a fixed-rate loop, and the driver contract."""
