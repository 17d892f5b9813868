"""Many seeded runs in virtual time: their random faults, judgement, shrinking and results."""
