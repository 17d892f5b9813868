"""Simulated bodies, links and whole fleets; imports the other packages."""
