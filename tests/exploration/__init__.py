"""All runs of a small fleet's real cores, up to a number of faults."""
