"""Ways in space and time: who has to wait long gives way aside, where others come when."""
