"""A recorded run continued in virtual time from a moment of its log."""
