"""Many seeded runs in virtual time: drawn, judged, shrunk when they fail, and reported."""
