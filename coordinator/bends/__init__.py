"""Ways in space and time: who has to wait long moves aside, where others come when."""
