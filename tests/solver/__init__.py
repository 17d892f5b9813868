"""What the argument rests on, proven by z3 for all numbers; each proof fails without a premise."""
