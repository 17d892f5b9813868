"""What the coordinator and the robots must agree on, and nothing else; without numpy."""
