"""From a scenario to a fleet in motion: the only package that plans."""
