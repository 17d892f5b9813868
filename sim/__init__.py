"""Bodies, links and whole fleets that are not made of metal; stands on the other packages."""
