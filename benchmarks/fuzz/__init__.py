"""Fuzz targets: every reader of bytes from outside, and the program that runs them."""
